"""`lanekeep play`: a GIF with the right frames, nothing overwritten, errors in one line."""

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("pygame")
from lanekeep_benchmarks import cli, play
from lanekeep_env.envs.single import SingleEnv


def run(capsys, *arguments):
    code = cli.run(["play", *arguments])
    return code, capsys.readouterr()


def test_a_failed_episode_of_highway_env_is_played_as_the_benchmark_says(tmp_path, capsys, monkeypatch):
    pytest.importorskip("highway_env")
    monkeypatch.delenv("SDL_VIDEODRIVER", raising=False)  # "dummy" makes their viewer draw nothing
    out, file = tmp_path / "run", tmp_path / "failed.gif"
    assert cli.run(["bench", "racetrack", "--policies", "pd", "--episodes", "1", "--out", str(out)]) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if "lanekeep play" in line)
    code, said = run(capsys, *line.partition("lanekeep play ")[2].split(), "--gif", str(file))
    assert code == 0 and "m, and failed; pictures" in said.out
    with Image.open(file) as picture:
        assert picture.n_frames > 1 and np.ptp(np.asarray(picture.convert("L"))) > 0


def test_what_happens_among_others_is_said(tmp_path, capsys, monkeypatch):
    """Full throttle in one's lane ends at the car ahead; what drives by default changes lanes.

    Nobody looks at the pictures: the longer drive has one of four points, 600 times.
    """
    own = tmp_path / "throttle.py"
    own.write_text(
        "import numpy as np\nclass Throttle:\n    def __init__(self, scenario): pass\n"
        "    def predict(self, observation, *_):\n"
        "        e = np.asarray(observation)[..., :2] @ np.array([-0.04, -0.6])\n"
        "        return np.stack([e, np.ones_like(e)], axis=-1), None\n"
    )
    given = ("Traffic-v0", "--policy", f"{own}:Throttle", "--seconds", "12", "--gif", str(tmp_path / "a.gif"))
    with monkeypatch.context() as patch:
        patch.setattr(SingleEnv, "render", lambda self: np.zeros((2, 2, 3), dtype=np.uint8))
        code, said = run(capsys, *given)
    assert code == 0 and "m, and met another car; pictures" in said.out
    code, said = run(capsys, "Traffic-v0", "--seconds", "0.5", "--gif", str(tmp_path / "b.gif"))
    assert code == 0 and said.out.startswith("werling-traffic drove 0.5 s")


def test_a_gif_of_two_seconds(tmp_path, capsys):
    file = tmp_path / "drive.gif"
    code, said = run(capsys, "--seconds", "2", "--policy", "yin-lqr-observer", "--gif", str(file))
    assert code == 0 and "stayed in its lane" in said.out and str(file) in said.out
    with Image.open(file) as picture:
        assert picture.n_frames == 40 and picture.size[0] == 640
        assert picture.info["duration"] == 50 and picture.info["loop"] == 0
    assert file.stat().st_size < 1_000_000
    before = file.read_bytes()
    code, said = run(capsys, "--seconds", "1", "--gif", str(file))
    assert code == 2 and "--overwrite" in said.err and said.err.count("\n") == 1
    assert file.read_bytes() == before
    assert run(capsys, "--seconds", "1", "--gif", str(file), "--overwrite")[0] == 0


def test_a_gif_keeps_the_colour_of_a_car_that_is_small(tmp_path, capsys):
    """Half a thousandth of the picture is blue."""
    file = tmp_path / "lap.gif"
    assert run(capsys, "Circuit-v0", "--seconds", "0.5", "--gif", str(file))[0] == 0
    with Image.open(file) as picture:
        colours = np.asarray(picture.convert("RGB"), dtype=int)
    assert 20 < (colours[..., 2] - colours[..., 0] > 60).sum() < 400


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["lanekeep/LaneKep-v0"], "lanekeep/LaneKeep-v0"),
        (["CartPole-v1"], "lanekeep/RoadWorks-v0"),
        (["--gif", "x.mp4"], ".gif"),
        (["--gif", "nowhere/x.gif"], "there is no folder nowhere"),
        (["--policy", "yin-lq"], "yin-lqr"),
        (["--road", "nowhere.csv"], "nowhere.csv"),
        (["--human", "--gif", "x.gif"], "--human"),
        (["--seconds", "-1"], "seconds"),
        (["--seconds", "inf"], "--seconds=inf"),
        (["--seconds", "nan"], "--seconds=nan"),
        (["--scenario", "nominal"], "--scenario 'nominal' has no effect without --run"),
        (["--run", "x", "--episode", "0", "--seed", "4"], "leave --seed out"),
        (["Drive-v0", "--run", "x", "--episode", "0", "--road", "sine"], "leave ENV and --road out"),
    ],
)
def test_wrong_input_is_one_line(arguments, word, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, said = run(capsys, *arguments)
    assert code == 2 and word in said.err and said.err.count("\n") == 1
    assert not list(tmp_path.rglob("*.gif"))


def test_a_long_film_holds_few_pictures_evenly_spaced(monkeypatch):
    monkeypatch.setattr(play, "MOST_PICTURES", 8)
    film = play.Film()
    for number in range(100):
        film.see(np.full((20, 40, 3), number, np.uint8))
    numbers = [int(frame[0, 0, 0]) for frame in film.frames]
    assert numbers == list(range(0, 100, numbers[1])) and 4 <= len(numbers) <= 8


def test_a_window_under_the_dummy_driver(capsys, monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    code, said = run(capsys, "--human", "--seconds", "0.2")
    assert code == 0 and "drove 0.2 s" in said.out
