"""`lanekeep tune`: runs that are killed, repeated, damaged and refused, and what they leave for the benchmark."""

import json
import shutil

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_agents.distil.mix import Lessons
from lanekeep_agents.training import settings as training_settings
from lanekeep_agents.training.evaluation import HeldOut
from lanekeep_baselines.tunable import read_tuned
from lanekeep_benchmarks import policies
from lanekeep_benchmarks.budgets import budgets
from lanekeep_benchmarks.cli import run
from lanekeep_benchmarks.statistics import Interval
from lanekeep_benchmarks.tune import run as tuning
from lanekeep_benchmarks.tune.drives import paired_gains, score_of
from lanekeep_benchmarks.tune.picture import plot_trials
from lanekeep_benchmarks.tune.record import best_text, chance, in_words
from lanekeep_benchmarks.tune.search import seed_of
from lanekeep_benchmarks.tune.settings import TuneSettings, settings_for, settings_in
from lanekeep_benchmarks.tune.space import space_of
from lanekeep_env.scenario import LaneKeepScenario

SHORT = {"departure": "cost", "episode_steps": 40, "speed": 20.0}
SETS = (
    Lessons("plain", keywords=SHORT),
    Lessons("heavy", keywords={**SHORT, "randomisation": {"mass": [1.1, 1.3]}}, noise=(0.0, 1.0)),
)
TRIALS = 5


def _settings(**changes):
    given = {"policy": "pd", "env_id": "lanekeep/LaneKeep-v0", "trials": TRIALS, "seed": 3, "steps": None, "sets": SETS}
    return TuneSettings(**{**given, "versions": settings_for("pd", "LaneKeep-v0", 1).versions, **changes})


@pytest.fixture(autouse=True, scope="module")
def _few_episodes():
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("lanekeep_benchmarks.tune.settings.EPISODES", 3)
        yield


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A run from its beginning to its end."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    outcome = tuning.Tuning(_settings(), folder).run()
    return folder, outcome


def test_a_trials_returns_are_those_of_single_episodes(whole):
    """Of the set of plain cars, with the values that the file says."""
    folder, _ = whole
    for line in (folder / tuning.TRIALS).read_text().splitlines()[:2]:
        found, returns = json.loads(line), []
        for i in range(3):
            env = gym.make("lanekeep/LaneKeep-v0", **SHORT)
            policy = lanekeep_baselines.make("pd", env.unwrapped.scenario, **found["values"])
            observation, _ = env.reset(seed=seed_of("search", "lanekeep/LaneKeep-v0", 3, 0) + i)
            total, over = 0.0, False
            while not over:
                observation, reward, terminated, truncated, _ = env.step(policy.predict(observation)[0])
                total, over = total + reward, terminated or truncated
            returns.append(total)
        assert found["returns"][0] == pytest.approx(np.mean(returns), rel=1e-5)
        assert found["steps"] == 3 * 3 * 40


def test_a_run_that_was_killed_ends_as_one_that_was_not(whole, tmp_path):
    folder, outcome = whole
    wanted = (folder / tuning.TRIALS).read_bytes()
    assert len(wanted.splitlines()) == TRIALS
    for killed in range(TRIALS):
        there = tmp_path / str(killed)

        def kill(done, words, killed=killed):
            if done == killed + 1:
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            tuning.Tuning(_settings(), there).run(kill)
        assert len((there / tuning.TRIALS).read_bytes().splitlines()) == killed + 1
        again = tuning.Tuning(_settings(), there, resume=True).run()
        assert (there / tuning.TRIALS).read_bytes() == wanted
        assert (again.number, again.gain, again.steps) == (outcome.number, outcome.gain, outcome.steps)
    # What is written after the trials' seconds and before the trials themselves is written again.
    lines = wanted.splitlines(keepends=True)
    (there / tuning.TRIALS).write_bytes(b"".join(lines[:2]))
    tuning.Tuning(_settings(), there, resume=True).run()
    assert (there / tuning.TRIALS).read_bytes() == wanted


def test_another_seed_meets_other_episodes_and_searches_elsewhere(whole, tmp_path):
    tuning.Tuning(_settings(seed=4, trials=2), tmp_path / "run").run()
    ours, theirs = ((one / tuning.TRIALS).read_text().splitlines() for one in (tmp_path / "run", whole[0]))
    for mine, yours in zip(map(json.loads, ours), map(json.loads, theirs), strict=False):
        assert mine["returns"] != yours["returns"]
        assert (mine["values"] == yours["values"]) == (mine["trial"] == 0)


def _line(number, **changes):
    def change(lines):
        lines[number] = json.dumps({**json.loads(lines[number]), **changes})
        return lines

    return change


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (_line(2, values={"lateral_gain": 0.1, "heading_gain": 0.5}), "asks for other values"),
        (_line(1, values={"lateral_gain": 0.1}), "asks for other values"),
        (_line(1, score=9.0), "not that of the returns"),
        (_line(1, returns=[0.0, 0.0, 0.0]), "not that of the returns"),
        (_line(1, returns=[0.0]), "returns must be 3 numbers"),
        (_line(1, returns=None), "line 2 is not of this run"),
        (_line(3, trial=4), "must be trial 3"),
        (_line(3, more=1), "must be trial 3"),
        (_line(0, steps=-1), "steps=-1 is not allowed"),
        (_line(0, score=None), "line 1 is not of this run"),
        (lambda lines: [*lines[:1], *lines[2:]], "must be trial 1"),
        (lambda lines: [*lines, lines[-1]], "has 6 trials; it must have 1 to 5"),
        (lambda lines: [lines[0].replace("0.0,", "NaN,", 1), *lines[1:]], "line 1 is not of this run"),
        (lambda lines: [*lines[:2], "[" * 100_000], "nested deeper"),
        (lambda lines: [*lines[:2], "[]"], "line 3 is not of this run"),
        (lambda lines: [*lines[:2], lines[2][:40]], "line 3 is not of this run"),
    ],
)
def test_trials_that_the_run_has_not_written_are_refused(whole, tmp_path, damage, says):
    folder = shutil.copytree(whole[0], tmp_path / "run")
    lines = damage((folder / tuning.TRIALS).read_text().splitlines())
    (folder / tuning.TRIALS).write_text("\n".join(lines) + "\n")
    with pytest.raises(ValueError, match=says) as error:
        tuning.Tuning(_settings(), folder, resume=True)
    assert "\n" not in str(error.value) and len(str(error.value)) < 1000


def test_runs_are_not_replaced_and_only_that_very_run_goes_on(whole, tmp_path):
    folder = whole[0]
    with pytest.raises(ValueError, match="already holds a run; name another folder, or go on with it: --resume"):
        tuning.Tuning(_settings(), folder)
    for changes in ({"trials": 6}, {"seed": 4}, {"policy": "stanley"}, {"sets": SETS[:1]}, {"versions": {}}):
        with pytest.raises(ValueError, match="holds another run"):
            tuning.Tuning(_settings(**changes), folder, resume=True)
    with pytest.raises(ValueError, match="holds no run to resume"):
        tuning.Tuning(_settings(), tmp_path, resume=True)
    (tmp_path / tuning.BEST).write_text("somebody's")
    with pytest.raises(ValueError, match="already holds a run"):
        tuning.Tuning(_settings(), tmp_path)
    with pytest.raises(ValueError, match="holds another run, or one of another version"):
        tuning.Tuning(settings_in(folder), folder, resume=True)  # its sets are not those of the id
    today = settings_for("pd", "LaneKeep-v0", 3).text()
    (tmp_path / "settings.json").write_text(today.replace('"optuna": "', '"optuna": "0.'))
    assert settings_in(tmp_path).text() == today
    for text in ('{"sets": [{"name": "x", "code": 1}]}', '{"policy": ["pd"]}', '{"policy": "pd", "env_id": 3}'):
        (tmp_path / "settings.json").write_text(text)
        with pytest.raises(ValueError, match="not the record of a run"):
            settings_in(tmp_path)


def test_scores_are_shares_of_the_shipped_values_return():
    """Minus 2 instead of minus 4 is half of a cost less, 6 instead of 4 half of a gain more; both count alike."""
    assert score_of([-2.0, 6.0], [-4.0, 4.0]) == pytest.approx(0.5)
    assert score_of([-4.0, 4.0], [-4.0, 4.0]) == 0.0
    assert score_of([1.0], [0.0]) == 1.0


def test_paired_gains_mean_the_score(whole):
    _, outcome = whole
    gains = paired_gains(outcome.tuned, outcome.shipped)
    means = [[float(one.returns.mean()) for one in drives] for drives in (outcome.tuned, outcome.shipped)]
    assert gains.mean() == pytest.approx(score_of(*means), rel=1e-12) == pytest.approx(outcome.gain.value, rel=1e-12)
    assert outcome.gain.low <= outcome.gain.value <= outcome.gain.high


def test_a_tuned_controller_drives_in_the_benchmark_as_the_same_values_in_python(whole, tmp_path):
    folder, outcome = whole
    file = tmp_path / "best.json"
    file.write_text(best_text(_settings(), outcome, folder))
    found = read_tuned(file)
    assert found == ("pd", outcome.best.values)
    budget = json.loads(file.read_text())["budget"]
    assert budget["trials"] == TRIALS and budget["environment_steps"] == TRIALS * 3 * 3 * 40
    scenario = LaneKeepScenario()
    entry = policies.entry_of(str(file))
    assert len(entry.sha256) == 64
    drivers = [
        entry.make(scenario),
        lanekeep_baselines.load(file, scenario),
        lanekeep_baselines.make("pd", scenario, **found.values),
    ]
    returns = {
        tuple(HeldOut("lanekeep/LaneKeep-v0", {"episode_steps": 30}, 4, 5).drive(one).returns) for one in drivers
    }
    assert len(returns) == 1
    shipped = HeldOut("lanekeep/LaneKeep-v0", {"episode_steps": 30}, 4, 5).drive(
        lanekeep_baselines.make("pd", scenario)
    )
    assert tuple(shipped.returns) not in returns


def test_shipped_values_are_the_shipped_controller(whole):
    """To the last bit."""
    scenario = LaneKeepScenario(preview=20)
    observations = np.random.default_rng(1).normal(0.0, 0.1, (50, len(scenario.channels)))
    observations[:, [channel.name for channel in scenario.channels].index("speed")] = 20.0
    for name in ("pd", "stanley", "pure-pursuit", "lq-preview", "lqg"):
        start = space_of(name, "lanekeep/LaneKeep-v0").start
        actions = [lanekeep_baselines.make(name, scenario, **values).predict(observations)[0] for values in ({}, start)]
        assert np.array_equal(*actions), name


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["pdd"], "policy 'pdd' is unknown (did you mean 'pd'?); allowed: pd, "),
        (["yin-lqr"], "policy 'yin-lqr' has nothing to tune"),
        (["pd", "LaneKep-v0"], "did you mean 'lanekeep/LaneKeep-v0'"),
        (["pd", "--steps", "100"], "--steps 100 is of trainings"),
        (["pd", "--trials", "100000"], "--trials=100000 is not allowed"),
        ([], "POLICY is missing"),
        (["--resume"], "--resume needs --out"),
        (["--resume", "--out", "x", "--trials", "3"], "no other options"),
        (["--resume", "--out", "nowhere"], "holds no run to resume"),
        (["lq-preview", "CameraLane-v0"], "policy 'lq-preview' "),
    ],
)
def test_what_cannot_be_tuned_is_one_line(words, says, capfd, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(["tune", *words]) == 2
    error = capfd.readouterr().err
    assert says in error and error.count("\n") == 1
    assert not (tmp_path / "results").exists()


def test_the_command_says_what_it_found_and_goes_on(capfd, tmp_path, monkeypatch):
    monkeypatch.setattr("lanekeep_benchmarks.tune.settings.ALONE", 4)
    monkeypatch.setattr("lanekeep_benchmarks.tune.settings.MIXES", tmp_path)  # no mix
    there = str(tmp_path / "run")
    assert run(["tune", "pd", "--trials", "4", "--out", there]) == 0
    told = capfd.readouterr()
    assert "pd on LaneKeep-v0: 4 trials of 4 episodes, " in told.out
    picture = (tmp_path / "run" / "trials.png").read_bytes()
    assert picture.startswith(b"\x89PNG")
    best = json.loads((tmp_path / "run" / "best.json").read_text())
    assert best["command"] == "lanekeep tune pd LaneKeep-v0 --trials 4 --seed 0"
    assert run(["tune", "pd", "--trials", "4", "--out", there]) == 2
    assert "already holds a run" in capfd.readouterr().err
    assert run(["tune", "--resume", "--out", there]) == 0
    assert json.loads((tmp_path / "run" / "best.json").read_text()) == best


def test_a_gain_that_may_be_none_is_warned_of(whole):
    _, outcome = whole
    sure = outcome._replace(number=1, gain=Interval(0.02, 0.01, 0.03))
    unsure = sure._replace(gain=Interval(0.02, -0.01, 0.05))
    assert chance(sure) == "" and "may be none: keep the shipped values" in chance(unsure)
    none = outcome._replace(number=0)
    assert chance(none) == "" and "No trial beat the shipped values." in in_words(_settings(), none, whole[0])


def test_pictures_of_odd_searches_are_drawn(whole):
    """Trials that failed, one trial alone, all alike, and one that is far below the others."""
    run_ = tuning.Tuning(_settings(), whole[0], resume=True)
    trials, first = run_.trials, run_.trials[0]
    for odd in (trials[:1], [first, first], [*trials, first._replace(score=None)], [first, first._replace(score=-1e6)]):
        assert plot_trials("title", run_.space, odd).startswith(b"\x89PNG")


@pytest.fixture
def tiny(monkeypatch):
    """Trainings of a few steps."""
    whole_ = training_settings.settings_for

    def changed(*arguments, parameters=(), env=(), **changes):
        parameters = {**dict(parameters), "n_steps": 32, "n_epochs": 1}
        few = {"num_envs": 16, "evaluations": 2, "evaluation_episodes": 2, "hidden": [4], "critic": [4]}
        return whole_(*arguments, **few, env={**dict(env), "episode_steps": 20}, parameters=parameters, **changes)

    monkeypatch.setattr(training_settings, "settings_for", changed)
    monkeypatch.setattr("lanekeep_benchmarks.tune.settings.ALONE", 4)


def test_values_that_give_no_controller_are_left_behind(tmp_path, monkeypatch):
    make = lanekeep_baselines.make

    def failing(name, scenario, **values):
        if values["heading_gain"] not in (0.6, *kept):
            kept.append(values["heading_gain"])
            raise np.linalg.LinAlgError("singular")
        return make(name, scenario, **values)

    kept = []
    monkeypatch.setattr(lanekeep_baselines, "make", failing)
    run_ = tuning.Tuning(_settings(trials=3), tmp_path / "run")
    outcome = run_.run()
    assert [one.score for one in run_.trials] == [0.0, None, None] and outcome.number == 0
    again = tuning.Tuning(_settings(trials=3), tmp_path / "run", resume=True)
    assert again.trials == run_.trials


def test_a_strangers_training_in_the_place_of_a_trials_is_refused(tiny, tmp_path):
    settings = settings_for("ppo", "LaneKeep-v0", 2, seed=2, steps=600)
    there = tmp_path / "trial-0"
    there.mkdir()
    (there / "settings.json").write_text("{}")
    with pytest.raises(ValueError, match="not the record of a training run"):
        tuning.Tuning(settings, tmp_path).run()
    assert not (tmp_path / tuning.TRIALS).exists()


def test_trainings_are_tuned_and_go_on_where_they_were_killed(tiny, tmp_path):
    settings = settings_for("ppo", "LaneKeep-v0", 3, seed=2, steps=2000)
    assert settings.steps == 2000 and "torch" in settings.versions
    outcome = tuning.Tuning(settings, tmp_path / "whole").run()
    wanted = (tmp_path / "whole" / tuning.TRIALS).read_bytes()
    assert json.loads(wanted.splitlines()[0])["values"]["gamma"] == 0.96  # as ppo.yaml has it
    assert outcome.steps == 3 * (2000 + 4 * 20)

    def kill(done, words):
        if done == 1 and "steps" in words and "1,024" in words:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        tuning.Tuning(settings, tmp_path / "killed").run(kill)
    assert (tmp_path / "killed" / "trial-1" / "settings.json").exists()
    tuning.Tuning(settings, tmp_path / "killed", resume=True).run()
    assert (tmp_path / "killed" / tuning.TRIALS).read_bytes() == wanted
    (tmp_path / "whole" / "best.json").write_text(text := best_text(settings, outcome, tmp_path / "whole"))
    found = json.loads(text)
    scenario = LaneKeepScenario(**settings.sets[0].keywords)
    policies.entry_of(str(tmp_path / "whole" / found["policy_file"])).make(scenario)
    with pytest.raises(ValueError, match="it is the record of trainings; the policy is trial-"):
        policies.entry_of(str(tmp_path / "whole" / "best.json")).make(scenario)
    assert found["train"].startswith("lanekeep train ppo lanekeep/LaneKeep-v0 --seed 2 --steps 2000 ")


#: Where the search of the shipped weights began, and where it drove.
START = {"rate": 1.0, "slip": 1e-3, "drift": 1e-2, "bend": 0.3, "lag": 0.03}
NOMINAL = {"preview": 20}
MISMATCH = {**NOMINAL, "tyre": "magic_formula", "randomisation": "mismatch"}
MISMATCHES = (MISMATCH, {**MISMATCH, "sensors": "production"})


@pytest.mark.parametrize(
    ("name", "start", "scenarios"),
    [
        ("lq-preview", {"rate": 1.0}, (NOMINAL,)),
        ("lq-preview-offset-free", START, MISMATCHES),
        ("lqg", START, MISMATCHES),
    ],
)
def test_shipped_weights_beat_the_start_of_their_search_on_other_training_roads(name, start, scenarios):
    """In the mean over its scenarios, 128 episodes each."""
    means = []
    for values in (start, {}):
        returns = []
        for keywords in scenarios:
            held_out = HeldOut("lanekeep/LaneKeep-v0", {"dtype": "float32", **keywords}, 128, 1000)
            returns.append(held_out.drive(lanekeep_baselines.make(name, held_out.scenario, **values)).returns.mean())
        means.append(np.mean(returns))
    assert means[1] > means[0]


def test_tables_show_what_was_spent(whole, tmp_path):
    """Of searches and trainings as their files say; nothing of what has none, or is damaged."""
    folder, outcome = whole
    steps = {seed: json.loads((policies.ZOO / f"ppo-evasive-seed{seed}.json").read_text()) for seed in (0, 1)}
    trained = sum(one["training"]["steps"] for one in steps.values())
    search, damaged = tmp_path / "best.json", tmp_path / "damaged.json"
    search.write_text(text := best_text(_settings(), outcome, folder))
    damaged.write_text(text.replace('"trials": 5', '"trials": "<b>"'))
    # A training of a search: what all of it took.
    (tmp_path / "trial-1").mkdir()
    for ending in (".json", ".safetensors"):
        shutil.copy(policies.ZOO / f"ppo-evasive-seed2{ending}", tmp_path / "trial-1")
    names = ["pd", str(search), "ppo-evasive-seed0", str(damaged), "ppo-evasive-seed1", "x.py:f", "gone.json"]
    assert budgets(names).splitlines()[5:] == [
        f"| {search} | {TRIALS * 3 * 3 * 40:,} | {TRIALS} |",
        f"| ppo-evasive (2 seeds) | {trained:,} |  |",
    ]
    assert budgets(["pd", "x.py:f", str(damaged)]) == ""
    one = str(tmp_path / "trial-1" / "ppo-evasive-seed2.json")
    own = f"{json.loads((policies.ZOO / 'ppo-evasive-seed2.json').read_text())['training']['steps']:,}"
    assert f"| {own} |  |" in budgets([one])
    search.write_text(json.dumps({**json.loads(text), "policy_file": "trial-1/ppo-evasive-seed2.json"}))
    assert f"| {TRIALS * 3 * 3 * 40:,} | {TRIALS} |" in budgets([one])
