"""Distillation: least squares, the teacher's word, and runs that are killed, repeated and refused."""

import functools
import json

import numpy as np
import pytest

import lanekeep_agents
import lanekeep_baselines
from lanekeep_agents.distil import rounds
from lanekeep_agents.distil.lessons import read_shown, shown_by_teacher, write_shown
from lanekeep_agents.distil.mix import Lessons, read_mix
from lanekeep_agents.distil.run import MIXES, Distillation, settings_for, settings_in
from lanekeep_agents.teacher import Teacher
from lanekeep_benchmarks.cli import run
from lanekeep_env import ENVIRONMENTS, SENSOR_SETS

MIX = """
base = "lq-preview-offset-free"
beside = ["lq-preview"]
bound = 0.15
fade = 8.0
rounds = 2
[common.keywords]
preview = 20
departure = "cost"
episode_steps = 70
[[set]]
name = "nominal"
episodes = 5
noise = [0.0, 1.0]
[[set]]
name = "mass"
episodes = 4
keywords = { randomisation = { mass = 1.2 } }
"""


@pytest.fixture(autouse=True, scope="module")
def _designed_once():
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(lanekeep_baselines, "make", functools.cache(lanekeep_baselines.make))
        patched.setattr("lanekeep_agents.distil.run.HELD_OUT", 3)
        yield


@pytest.fixture(scope="module")
def mix(tmp_path_factory):
    file = tmp_path_factory.mktemp("mix") / "mix.toml"
    file.write_text(MIX)
    return file


@pytest.fixture(scope="module")
def whole(mix, tmp_path_factory):
    """A run from its beginning to its end."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    policy = Distillation(settings_for("LaneKeep-v0", 5, mix), folder).run()
    return folder, policy


def _weights(folder):
    return (folder / "distilled-lane-keep-seed5.safetensors").read_bytes()


def test_normal_equations_are_solved_as_numpys_least_squares():
    rng = np.random.default_rng(0)
    f, weight, y = rng.standard_normal((200, 6)), rng.uniform(0.1, 2.0, 200), rng.standard_normal(200)
    sums = rounds.Sums.none(6)
    for part in (slice(0, 90), slice(90, 200)):
        weighted = f[part] * weight[part, None]
        sums = sums.plus(rounds.Sums(f[part].T @ weighted, weighted.T @ y[part]), 1.0)
    root = np.sqrt(weight)
    wanted = np.linalg.lstsq(f * root[:, None], y * root, rcond=None)[0]
    assert sums.solved() == pytest.approx(wanted, abs=1e-4)


def test_teacher_says_what_it_did_on_its_way_and_what_another_action_costs(tmp_path):
    """A short step aside at one time costs the curvature times the step squared."""
    keywords = {"preview": 20, "departure": "cost", "episode_steps": 120}
    lessons = Lessons("one", keywords=keywords, episodes=3)
    shown = shown_by_teacher(lessons, np.array([3, 4, 5]), ("lq-preview", "lq-preview-offset-free"))
    write_shown(tmp_path / "a.npz", shown)
    shown = read_shown(tmp_path / "a.npz")
    assert (shown.returns >= shown.base).all() and shown.good.all()
    step, aside = 40, 0.02
    totals = []
    for moved in (0.0, aside):
        teacher = Teacher(lessons.env_id, 3, **keywords)
        teacher.reset([3, 4, 5])
        total = np.zeros(3)
        for k in range(120):
            action, curvature = shown.at(k, teacher)
            if k == step:
                said = curvature
                action = action + moved
            total += teacher.step(action)[1]
        totals.append(total)
    assert totals[0] == pytest.approx(shown.returns, rel=1e-6)
    assert totals[0] - totals[1] == pytest.approx(said * aside**2, rel=1e-3)


def test_a_killed_run_goes_on_to_the_last_bit(whole, mix, tmp_path):
    """Killed in the middle of the second round, and once more between teachers."""
    settings = settings_for("LaneKeep-v0", 5, mix)
    for dies_after in (1, 7):

        def report(done, total, words, last=dies_after):
            if done >= last:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            Distillation(settings, tmp_path / "run", resume=dies_after > 1).run(report)
    assert not (tmp_path / "run" / "distilled-lane-keep-seed5.json").exists()
    Distillation(settings_in(tmp_path / "run"), tmp_path / "run", resume=True).run()
    assert _weights(tmp_path / "run") == _weights(whole[0])


def test_another_seed_gives_another_policy(whole, mix, tmp_path):
    Distillation(settings_for("LaneKeep-v0", 6, mix), tmp_path / "run").run()
    assert (tmp_path / "run" / "distilled-lane-keep-seed6.safetensors").read_bytes() != _weights(whole[0])


def test_the_files_load_and_say_how_they_were_made(whole):
    folder, policy = whole
    record = lanekeep_agents.load(folder / "distilled-lane-keep-seed5.json").record
    assert record == policy.record and record.student.beside == ("lq-preview",)
    assert record.training.command == "lanekeep distil LaneKeep-v0 --seed 5"
    assert len(record.training.scores["rounds"]) == 2
    assert record.training.scores == json.loads((folder / "scores.json").read_text())


def test_damaged_files_and_other_runs_are_refused_in_a_line(whole, mix, tmp_path, capsys):
    folder, _ = whole
    arguments = ["distil", "LaneKeep-v0", "--mix", str(mix), "--out", str(folder)]
    for more, words in (
        ([], "already holds a run"),
        (["--seed", "7", "--resume"], "holds another run"),
        (["--resume", "--overwrite"], "exclude each other"),
    ):
        assert run([*arguments, *more]) == 2
        said = capsys.readouterr().err
        assert words in said and said.count("\n") == 1
    for name in ("teacher-mass.npz", "round-1.npz"):
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[: len(content) // 2])
        assert run(["distil", "--resume", "--out", str(folder)]) == 2
        assert name in capsys.readouterr().err
        (folder / name).write_bytes(content)
    assert run(["distil", "--resume", "--out", str(tmp_path)]) == 2
    assert "holds no run to resume" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("rounds = 2", "rounds = 0"), "rounds=0 is not allowed"),
        (("rounds = 2", ""), "rounds is missing"),
        (('name = "mass"', 'name = "nominal"'), "names of sets must differ"),
        (('name = "mass"', 'name = "../mass"'), "set.name='../mass' is not allowed"),
        (("episodes = 4", "episodes = 4000"), "set.episodes=4000 is not allowed"),
        (("episodes = 4", "episods = 4"), "did you mean 'episodes'"),
        (("noise = [0.0, 1.0]", "noise = [-1.0]"), "set.noise=-1.0 is not allowed"),
        (("[[set]]", "[[sets]]"), "it has no tables [[set]]"),
    ],
)
def test_wrong_mixes_are_refused_in_a_line(change, words, tmp_path):
    file = tmp_path / "mix.toml"
    file.write_text(MIX.replace(*change))
    with pytest.raises(ValueError) as refused:
        read_mix(file)
    assert words in str(refused.value) and "\n" not in str(refused.value)


def test_shipped_mixes_learn_on_training_roads_alone():
    """The benchmark drives roads of seed 1."""
    for file in MIXES.glob("*.toml"):
        for lessons in read_mix(file).sets:
            road = ENVIRONMENTS[lessons.env_id].scenario.from_keywords(**lessons.keywords).road
            assert getattr(road, "seed", 0) == 0


@pytest.mark.parametrize(("env_id", "keywords"), [("LaneKeep-v0", {"preview": 20}), ("Evasive-v0", {})])
def test_noise_is_a_factor_of_the_environments_own_production_sensors(env_id, keywords):
    """Of a manoeuvre at 50 Hz, samples come every second step."""
    lessons = Lessons("one", f"lanekeep/{env_id}", keywords)
    assert lessons.with_noise(0.0) == keywords
    found = lessons.with_noise(2.0)["sensors"]
    assert {name: sensor["noise"] for name, sensor in found.items()} == {
        name: 2.0 * sensor.noise for name, sensor in SENSOR_SETS["production"].items()
    }
    assert found["lateral_error"]["period"] == (0.05 if env_id == "LaneKeep-v0" else 0.04)
    record = ENVIRONMENTS[lessons.env_id].scenario
    assert record.from_keywords(**lessons.with_noise(1.0)) == record.from_keywords(**keywords, sensors="production")


def test_sets_without_an_id_are_of_the_mix_own(tmp_path):
    file = tmp_path / "mix.toml"
    of_evasive = MIX.replace("preview = 20\n", "").replace(
        "[common.keywords]", '[common]\nenv_id = "lanekeep/Evasive-v0"\n\n[common.keywords]'
    )
    file.write_text(of_evasive.replace('name = "mass"', 'name = "mass"\nenv_id = "lanekeep/LaneKeep-v0"'))
    assert [one.env_id for one in read_mix(file).sets] == ["lanekeep/Evasive-v0", "lanekeep/LaneKeep-v0"]


REVERSE = """
base = "werling-reverse-ahead"
beside = []
bound = 0.4
fade = 8.0
rounds = 1
[common]
env_id = "lanekeep/ReversePath-v0"
keywords = { departure = "cost", episode_steps = 200 }
[[set]]
name = "nominal"
episodes = 6
"""


def test_a_controller_that_estimates_nothing_is_corrected_on_its_own(tmp_path):
    """A car that rolls without slip, one controller: products name nothing that there is not."""
    file = tmp_path / "mix.toml"
    file.write_text(REVERSE)
    policy = Distillation(settings_for("ReversePath-v0", 0, file), tmp_path / "run").run()
    terms = policy.record.student.terms
    assert not [term for term in terms if term.startswith(("base0.", "base1"))] and "curvature_preview_0" in terms
    assert lanekeep_agents.load(tmp_path / "run" / "distilled-reverse-path-seed0.json").record == policy.record


def test_an_id_without_a_mix_names_those_that_have_one():
    with pytest.raises(ValueError, match="allowed: Evasive-v0, LaneKeep-v0, ReversePath-v0, RoadWorks-v0,"):
        settings_for("Circuit-v0")
