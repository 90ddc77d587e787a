"""One thread or several, whichever is faster at the time; on a clock of the test's own."""

from __future__ import annotations

import os
from collections import Counter

import pytest

from lanekeep_env.engine.threads import TRIED, Faster, start_threads


class Machine:
    """Two functions that take as long as it says, in seconds."""

    def __init__(self, one: float, several: float) -> None:
        self.seconds = {"one": one, "several": several}
        self.now = 0.0
        self.calls: Counter[str] = Counter()
        self.faster = Faster(lambda: self._run("one"), lambda: self._run("several"), lambda: self.now)

    def _run(self, name: str) -> None:
        self.now += self.seconds[name]
        self.calls[name] += 1

    def step(self, steps: int) -> float:
        """Return the seconds that steps take."""
        begin = self.now
        for _ in range(steps):
            self.faster()
        return self.now - begin


@pytest.mark.parametrize("slowness", [1.1, 2.0, 100.0])
@pytest.mark.parametrize("slower", ["one", "several"])
def test_what_is_slower_costs_no_more_than_its_share(slower: str, slowness: float) -> None:
    machine = Machine(1.0, 1.0)
    machine.seconds[slower] = slowness
    machine.step(10)  # each once to compile and once to see
    steps = 20_000
    assert machine.step(steps) <= steps / (1.0 - TRIED) + 2 * slowness


def test_it_changes_when_the_machine_does() -> None:
    machine = Machine(1.0, 0.5)
    machine.step(1000)
    machine.seconds["several"] = 50.0  # other programs run
    busy = machine.step(5000)
    assert busy <= 5000 * 1.1 + 5 * 50.0
    machine.seconds["several"] = 0.5
    machine.step(200_000)
    machine.calls.clear()
    machine.step(1000)
    assert machine.calls["several"] > 900


@pytest.mark.parametrize(("said", "expected"), [({}, True), ({"OMP_WAIT_POLICY": "active"}, False)])
def test_how_threads_wait_is_told_to_these_alone(
    monkeypatch: pytest.MonkeyPatch, said: dict[str, str], expected: bool
) -> None:
    for name in ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT"):
        monkeypatch.delenv(name, raising=False)
    for name, value in said.items():
        monkeypatch.setenv(name, value)
    before, seen = dict(os.environ), []
    monkeypatch.setattr("numba.set_num_threads", lambda number: seen.append("GOMP_SPINCOUNT" in os.environ))
    start_threads(2)
    assert seen == [expected]
    assert dict(os.environ) == before
