"""Werling's speed, gap and stop laws and their override, on a car whose acceleration lags by 0.1 s."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from lanekeep_baselines.werling_longitudinal import (
    Lead,
    LongitudinalControl,
    LongitudinalTuning,
    StopLaw,
    constant_deceleration,
    gap_law,
    override,
    speed_law,
)

TUNING = LongitudinalTuning()
NOBODY = np.inf


class Run(NamedTuple):
    """Every 20 ms: time, speed, way, acceleration, what is asked for, gap and distance to the stop point."""

    t: np.ndarray
    v: np.ndarray
    s: np.ndarray
    a: np.ndarray
    asked: np.ndarray
    gap: np.ndarray
    left: np.ndarray


class Car:
    """s' = v, v' = a, 0.1 s a' = asked - a; at standstill the brake holds. Exact over a step, a fifth of 20 ms."""

    def __init__(self, v: float = 0.0) -> None:
        self.v, self.s, self.a = v, 0.0, 0.0

    def advance(self, asked: float, h: float = 0.004, lag: float = 0.1) -> None:
        for _ in range(5):
            excess, gone = self.a - asked, lag * (1.0 - np.exp(-h / lag))
            v = self.v + asked * h + excess * gone
            if v <= 0.0 and asked <= 0.0:
                self.v, self.a = 0.0, 0.0
                continue
            self.s += self.v * h + 0.5 * asked * h * h + excess * lag * (h - gone)
            self.v, self.a = v, asked + excess * np.exp(-h / lag)


def figure_10(step: float = 0.02) -> Run:
    control, car, rows = LongitudinalControl(TUNING), Car(), []
    memory, lead, stop = np.zeros((1, 2)), np.inf, np.inf
    for i in range(round(60.0 / step)):
        t = i * step
        if i == round(15.0 / step):
            lead = car.s + 35.0
        if i == round(30.0 / step):
            lead = np.inf
        if i == round(37.0 / step):
            stop = car.s + 30.0
        wanted = 10.0 if t >= 4.0 - 1e-9 else 0.0
        v, target, gap, change, distance = np.array([car.v, wanted, lead - car.s, 7.5 - car.v, stop - car.s])[:, None]
        asked, memory = control.step(v, target, Lead(gap, change), distance, memory, i == 0)
        rows.append((t, car.v, car.s, car.a, asked[0], lead - car.s, stop - car.s))
        car.advance(asked[0])
        lead += 7.5 * step
    return Run(*np.array(rows).T)


@pytest.fixture(scope="module")
def run() -> Run:
    return figure_10()


def at(run: Run, t: float) -> int:
    return round(t / 0.02)


def test_figure_10_starting(run: Run) -> None:
    """The brake holds up to 4 s; then 1 m/s²; at 12.5 s speed control takes over without a bump."""
    assert (run.v[: at(run, 4.0)] == 0.0).all()
    started = at(run, 4.0)
    over = started + int(np.argmax(run.asked[started:] < 1.0))
    assert (run.asked[started:over] == 1.0).all()
    assert run.t[over] == pytest.approx(12.5, abs=0.05)
    assert np.abs(np.diff(run.asked[over - 5 : at(run, 15.0)])).max() < 0.62 * 1.0 * 0.02 * 1.1


def test_figure_10_following(run: Run) -> None:
    """Car at 7.5 m/s, seen at 35 m: the gap L + tau v is there before it turns off, and no closer on the way."""
    turned_off = at(run, 30.0) - 1
    assert run.gap[turned_off] == pytest.approx(4.0 + 1.5 * run.v[turned_off], rel=0.02)
    assert run.v[turned_off] == pytest.approx(7.5, abs=0.1)
    assert run.gap[at(run, 15.0) : turned_off].min() > 4.0 + 1.5 * 7.5 - 0.1
    assert run.asked.max() <= 1.0 and run.asked[at(run, 30.0) : at(run, 34.0)].max() == pytest.approx(1.0)


def test_figure_10_stopping(run: Run) -> None:
    """From 37 s on 30.0 m: nearly constant deceleration, standstill (2 cm/s) at 45 s, without a jerk, within 2 cm."""
    assert run.left[at(run, 37.0)] == pytest.approx(30.0)
    braking = slice(at(run, 37.6), at(run, 42.0))
    assert -2.0 < run.a[braking].min() < run.a[braking].max() < -1.45
    stood = run.t[(run.t > 37.0) & (run.v < 0.02)][0]
    assert 44.7 <= stood <= 45.0
    assert 0.008 <= run.left[at(run, 45.0)] <= 0.020
    assert 0.0 <= run.left[-1] < 1e-4
    assert np.abs(np.diff(run.a[at(run, 42.0) :])).max() / 0.02 < 2.5
    assert run.left.min() > -1e-9


def stopped(law, v: float = 10.0, distance: float = 30.0, seconds: float = 12.0) -> tuple[float, float, float]:
    """Return way past the stop point (m), speed then, and the smallest acceleration asked for; set speed 10 m/s."""
    car, least = Car(v), 0.0
    for i in range(round(seconds / 0.02)):
        asked = override(TUNING, speed_law(TUNING, np.array([car.v]), np.array([10.0])), law(car, distance - car.s, i))
        least = min(least, asked[0])
        car.advance(asked[0])
    return car.s - distance, car.v, least


def shipped_stop():
    stop, memory = StopLaw(TUNING), [np.zeros((1, 2))]

    def law(car: Car, left: float, i: int) -> np.ndarray:
        asked, memory[0] = stop.step(np.array([car.v]), np.array([left]), memory[0], i == 0)
        return asked

    return law


def printed(car: Car, left: float, i: int) -> np.ndarray:
    """(32) to the letter, its condition asked anew at each step, and (33) by a max selector in the near range."""
    brake = -(car.v**2) / (2.0 * (left - TUNING.ahead))
    brake = brake if brake < TUNING.braking else np.inf
    return np.array([max(brake, 4.0 * left - 4.0 * car.v) if left <= TUNING.near else brake])


def ungated(car: Car, left: float, i: int) -> np.ndarray:
    """Latched, but with (33) in the max selector all the way."""
    brake = -(car.v**2) / (2.0 * (left - TUNING.ahead)) if left > TUNING.ahead else -np.inf
    return np.array([max(brake, 4.0 * left - 4.0 * car.v)])


@pytest.mark.parametrize("v", [3.0, 7.0, 10.0])
@pytest.mark.parametrize("distance", [30.0, 35.0, 50.0])
def test_stop_law_stops_where_it_shall(v: float, distance: float) -> None:
    past, speed, least = stopped(shipped_stop(), v, distance, 40.0)
    assert past == pytest.approx(0.0, abs=1e-3)
    assert speed < 1e-3
    assert least > -2.0


def test_printed_stop_law_drives_through() -> None:
    past, speed, _ = stopped(printed)
    assert past > 10.0 and speed > 5.0


@pytest.mark.parametrize(("v", "distance"), [(10.0, 30.0), (15.0, 90.0)])
def test_ungated_selector_overruns(v: float, distance: float) -> None:
    """It lets the car be until some 2/p seconds before the point: then a_min is not enough."""
    past, _, least = stopped(ungated, v, distance, 20.0)
    assert past > 0.5 and least == TUNING.least
    past, _, least = stopped(shipped_stop(), v, distance, 20.0)
    assert past == pytest.approx(0.0, abs=1e-3) and least > TUNING.least


def test_tangent_is_a_joint_one() -> None:
    """On the curve of constant deceleration (33) asks for no less, and for as much at one point, 3 Delta before."""
    v = np.linspace(0.0, 15.0, 15001)
    left = TUNING.ahead + v**2 / (-2.0 * TUNING.braking)
    difference = 4.0 * left - 4.0 * v - TUNING.braking
    assert constant_deceleration(TUNING, v[1:], left[1:]) == pytest.approx(TUNING.braking)
    assert difference.min() == pytest.approx(0.0, abs=1e-6)
    assert left[difference.argmin()] == pytest.approx(3.0 * TUNING.ahead, rel=1e-2)
    assert 3.0 * TUNING.ahead < TUNING.near == pytest.approx(4.0 * 1.7 / 4.0 + 0.5)


def test_stop_law_row_by_row() -> None:
    """Free; just braking; behind Delta; no point any more; a point that has moved away; standing short of the point."""
    v = np.array([10.0, 10.0, 1.0, 10.0, 8.0, 0.0])
    left = np.array([60.0, 29.0, 0.3, np.inf, 80.0, 1.5])
    memory = np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.4], [1.0, 20.0], [1.0, 20.0], [0.0, 0.0]])
    before = memory.copy()
    asked, following = StopLaw(TUNING).step(v, left, memory, False)
    assert (memory == before).all()
    assert np.isposinf(asked[[0, 3, 4, 5]]).all()
    assert asked[1] == pytest.approx(-100.0 / (2.0 * (29.0 - 0.425)))
    assert asked[2] == pytest.approx(4.0 * 0.3 - 4.0 * 1.0)
    assert following[:, 0].tolist() == [0.0, 1.0, 1.0, 0.0, 0.0, 0.0]
    fresh, _ = StopLaw(TUNING).step(v[:1], left[:1], np.array([[1.0, 61.0]]), True)
    assert np.isposinf(fresh).all()
    assert constant_deceleration(TUNING, v[2:3], left[2:3])[0] == -np.inf


def test_gap_law() -> None:
    """Zero at the wanted gap, so with L and tau positive; (d_f - d_f,wanted)' = -lambda (...) for a steady lead."""
    v = np.array([7.5, 7.5, 7.5])
    asked = gap_law(TUNING, v, np.array([15.25, 17.25, np.inf]), np.array([0.0, 0.0, np.nan]))
    assert asked[:2] == pytest.approx([0.0, 0.5 * 2.0 / 1.5]) and np.isposinf(asked[2])
    wanted, change = 4.0 + 1.5 * 9.0, 7.5 - 9.0
    a = gap_law(TUNING, np.array([9.0]), np.array([20.0]), np.array([change]))[0]
    assert change - 1.5 * a == pytest.approx(-0.5 * (20.0 - wanted))


def test_override_is_continuous_where_laws_cross() -> None:
    """Between a_min and a_max, and with slopes of the laws, without steps."""
    v = np.linspace(0.0, 15.0, 15001)
    gap = 20.0 - v
    asked = override(TUNING, speed_law(TUNING, v, np.full_like(v, 10.0)), gap_law(TUNING, v, gap, 7.5 - v))
    assert asked.min() == TUNING.least and asked.max() == TUNING.most
    steepest = max(0.62, (1.0 + 0.5 * 2.5) / 1.5)
    assert np.abs(np.diff(asked)).max() <= steepest * 1e-3 * (1.0 + 1e-9)
