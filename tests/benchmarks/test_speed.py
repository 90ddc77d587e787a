"""`lanekeep speed`: ratios within rounds, a history of them; the figures themselves belong to a quiet machine."""

import importlib.util
import json

import pytest

from lanekeep_benchmarks.cli import run as main
from lanekeep_benchmarks.speed import contenders, history, rounds, start_up
from lanekeep_benchmarks.speed.contenders import Contender, groups, single, vector


def test_ratios_are_paired_within_rounds():
    """A machine that is slower in every other round changes no ratio."""
    field = [Contender("ours", int), Contender("theirs", int, rival=True)]
    found = rounds.compared(field, [{"ours": 6.0 * pace, "theirs": 2.0 * pace} for pace in (1.0, 0.1, 1.0, 0.2)])
    assert found.ratios == {"ours": {"theirs": pytest.approx((3.0, 3.0, 3.0))}}
    assert found.rates["ours"] == pytest.approx(3.6)


def test_every_contender_runs_as_long_and_in_turns(monkeypatch):
    now, order = [0.0], []
    monkeypatch.setattr(rounds.time, "perf_counter", lambda: now[0])

    def taking(name, seconds):
        def run(calls):
            now[0] += calls * seconds
            order.append((name, calls))
            return calls

        return Contender(name, run, rival=name == "b")

    found = rounds.measure([taking("a", 0.001), taking("b", 0.01)], 2, 0.4)
    assert order[-4:] == [("a", 400), ("b", 40), ("b", 40), ("a", 400)]
    assert found.ratios["a"]["b"].median == pytest.approx(10.0)


@pytest.mark.parametrize(("make", "cars"), [(single, 1), (vector, contenders.CARS)])
def test_steps_are_counted(make, cars):
    assert make("CartPole-v1")(300) == 300 * cars


def test_what_is_compared(monkeypatch):
    """Every group has rivals and others, of names of their own; what is not installed is told, once."""
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *given: None if "highway" in name or name == "gymnax" else find(name)
    )
    notes = []
    found = groups(["lanekeep/LaneKeep-v0", "lanekeep/Traffic-v0"], notes)
    assert [note.split()[0] for note in notes] == ["highway-env", "gymnax"]
    for field in found.values():
        assert {one.rival for one in field} == {True, False}
        assert len({one.name for one in field}) == len(field)
    names = [one.name for one in found[f"{contenders.CARS} cars"]]
    for name in (
        "LaneKeep-v0, float64",
        "LaneKeep-v0, float32",
        "Traffic-v0, float32",
        "LaneKeep-v0, float32, 65536 cars",
    ):
        assert f"lanekeep/{name}" in names


class TestCommand:
    @pytest.fixture(autouse=True)
    def short(self, monkeypatch):
        field = [Contender("ours", single("CartPole-v1")), Contender("theirs", single("Pendulum-v1"), rival=True)]
        monkeypatch.setattr(contenders, "groups", lambda ids, notes: {"Some": field})
        monkeypatch.setattr(start_up, "start_up", lambda ids, kinds, tell: {f"{one}, {kinds[0]}": 1.5 for one in ids})

    def test_json_has_rates_ratios_and_start_up(self, capsys):
        assert main(["speed", "--quick", "--json", "LaneKeep-v0"]) == 0
        found = json.loads(capsys.readouterr().out)
        ratio = found["groups"]["Some"]["times_as_fast"]["ours"]["theirs"]
        assert 0.0 < ratio["low"] <= ratio["median"] <= ratio["high"]
        assert found["start_up_s"] == {"lanekeep/LaneKeep-v0, single": 1.5}

    def test_history_grows_and_is_drawn(self, capsys, tmp_path):
        file = tmp_path / "new" / "speed.jsonl"
        for _ in range(2):
            assert main(["speed", "--quick", "--history", str(file)]) == 0
        assert "ours" in capsys.readouterr().out
        first, second = history.read(file)
        assert first["ratios"].keys() == second["ratios"].keys() == {"Some: ours ÷ theirs"}
        assert file.with_suffix(".png").read_bytes().startswith(b"\x89PNG")

    @pytest.mark.parametrize(
        "content", [b"{", b"[]\n", b'{"date": 1}\n', b'{"date":"","version":"","code":"","ratios":{"a":[1,2]}}\n']
    )
    def test_another_file_is_left_as_it_is(self, capsys, tmp_path, content):
        file = tmp_path / "speed.jsonl"
        file.write_bytes(content)
        assert main(["speed", "--quick", "--history", str(file)]) != 0
        assert "line 1 is no measurement" in capsys.readouterr().err
        assert file.read_bytes() == content

    @pytest.mark.parametrize("wrong", [["LaneKep-v0"], ["--history", "speed.png"]])
    def test_wrong_input_is_one_line(self, capsys, wrong):
        assert main(["speed", *wrong]) != 0
        error = capsys.readouterr().err
        assert wrong[-1] in error and len(error.splitlines()) == 1


@pytest.mark.slow
def test_start_up_is_shorter_once_compiled():
    found = start_up.start_up(["lanekeep/LaneKeep-v0"], ["single"])
    assert found["import"] < found["lanekeep/LaneKeep-v0, single, compiled before"]
    assert (
        found["lanekeep/LaneKeep-v0, single, compiled before"] < found["lanekeep/LaneKeep-v0, single, nothing compiled"]
    )
