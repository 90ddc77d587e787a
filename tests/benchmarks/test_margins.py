"""`lanekeep margins`: table, JSON and picture, a user's own controller, one-line errors."""

import json
import math

import pytest

from lanekeep_benchmarks.cli import run

OWN = """
import numpy as np

class Law:
    def __init__(self, scenario):
        self.order = [c.name for c in scenario.channels]
        self.scale = scenario.max_steering_angle

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        seen = dict(zip(self.order, np.atleast_2d(observation).T))
        return ((-0.02 * seen["lateral_error"] - 0.5 * seen["heading_error"]) / self.scale)[:, None], None
"""


def told(capsys, *arguments):
    assert run(["margins", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_what_cannot_be_linearised_is_said_by_its_name(tmp_path, capsys):
    own = tmp_path / "bang.py"
    own.write_text(OWN.replace("return ((", "return np.sign(("))
    (row,) = told(capsys, f"{own}:Law", "--speeds", "10")
    assert "stable" not in row and f"policy '{own}:Law' is not smooth" in row["why"]


def test_table_json_and_picture(tmp_path, capsys, monkeypatch):
    picture, own = tmp_path / "margins.png", tmp_path / "law.py"
    own.write_text(OWN)
    arguments = [f"pd,{own}:Law", "--vehicle", "yin,commonroad-1", "--speeds", "5,30"]
    rows = told(capsys, *arguments, "--out", str(picture))
    assert [(row["policy"][-3:], row["vehicle"], row["speed"]) for row in rows] == [
        (policy, car, speed) for policy in ("pd", "Law") for car in ("yin", "commonroad-1") for speed in (5.0, 30.0)
    ]
    assert all(row["stable"] and row["gain"] > 1.0 and row["phase"] < math.pi for row in rows)
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert run(["margins", *arguments, "--out", str(picture)]) == 2
    assert "exists" in capsys.readouterr().err
    for width in (80, 60):
        monkeypatch.setenv("COLUMNS", str(width))
        assert run(["margins", *arguments]) == 0
        said = capsys.readouterr().out
        lines = said.splitlines()
        assert max(map(len, lines)) <= width and sum(line.startswith("Margins of") for line in lines) == 2
        assert "…" not in said and all(heading in said for heading in ("policy", "damping", "camera"))


def test_a_known_delay_takes_from_the_margins_and_an_unstable_loop_says_so(capsys):
    (late,) = told(capsys, "pd", "--vehicle", "commonroad-1", "--speeds", "50", "--delay", "0.05")
    (prompt,) = told(capsys, "pd", "--vehicle", "commonroad-1", "--speeds", "50")
    assert prompt["stable"] and not late["stable"] and late["damping"] < 0.0
    assert run(["margins", "pd", "--vehicle", "commonroad-1", "--speeds", "50", "--delay", "0.05"]) == 0
    assert "unstable" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["pd", "--speeds", "fast"], "--speeds 'fast'"),
        (["pd", "--speeds", "0.5"], "speed=0.5"),
        (["pd", "--vehicle", "lorry"], "lorry"),
        (["pd", "--vehicle", ","], "--vehicle ',' is not allowed"),
        (["pd", "--out", "no/such/folder/margins.png"], "there is no folder no/such/folder"),
        (["knightriders-pd"], "distance_right"),
        (["nobody"], "unknown"),
        (["pd", "--out", "margins.pdf"], ".png"),
        (["pd", "--delay", "0.013"], "steering.delay"),
    ],
)
def test_wrong_input_is_one_line(arguments, message, capsys):
    assert run(["margins", *arguments]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
