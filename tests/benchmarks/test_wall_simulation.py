"""Team KnightRiders 2017: the simulations along a wall, the authors' own and the car's."""

from __future__ import annotations

import control
import numpy as np
import pytest

from lanekeep_baselines.wall_design import PD_SPEED, misprinted_pd_design, pd_locus, pi_design
from lanekeep_baselines.wall_estimator import WallNoise
from lanekeep_benchmarks.replications.wall_simulation import (
    CAR,
    DEGREE,
    FIGURES,
    PD_CAR,
    Run,
    figure,
    kinematic_plant,
    linear_plant,
    settled,
    simulate,
    simulate_estimated,
)


def share_at_limit(run: Run) -> float:
    """Return the share of the steps whose steering is at 22 degrees."""
    return float(np.mean(abs(run.steering) > 22.0 - 1e-9))


# --- the report's


def test_published_peaks() -> None:
    pi, state, cascade = (figure(number).distance for number in ("3.9", "3.10", "3.35"))
    assert pi.max() == pytest.approx(2.11, abs=5e-3)
    assert state.max() == pytest.approx(1.44, abs=5e-3) and state[state.argmax() :].min() == pytest.approx(
        0.62, abs=5e-3
    )
    assert cascade.max() == pytest.approx(1.44, abs=5e-3)
    assert cascade.min() == pytest.approx(0.8) and cascade[cascade.argmax() :].min() == pytest.approx(0.92, abs=5e-3)


def test_peaks_in_radians() -> None:
    pi, state, cascade = (simulate(name, "si", (0.8, 20.0, 0.4)) for name in ("pi", "pi-state", "cascade"))
    # 1.10 is the rear axle's; the sensor, ahead of it and headed outwards, peaks 1.7 cm further off.
    rear = pi.distance - CAR.sensor * np.sin(np.deg2rad(pi.heading))
    assert rear.max() == pytest.approx(1.10, abs=5e-3)
    assert 1.10 < pi.distance.max() < 1.12 and settled(pi) < 1e-3
    assert cascade.distance.max() == pytest.approx(1.00, abs=1e-3) and settled(cascade) < 1e-3
    # Diverges: on the car it turns round with the steering at its limit, on the linear plant it swings ever wider.
    assert share_at_limit(state) > 0.98 and abs(state.heading).max() > 180.0
    linear = simulate("pi-state", "si", (0.8, 20.0, 0.4), plant=linear_plant(CAR, 0.4), duration=40.0).distance
    first, second = np.array_split(abs(linear - 1.0), 2)
    assert second.max() > 1.2 * first.max() > 2.0


def test_without_a_limit_the_simulation_is_the_step_response_of_the_loop() -> None:
    steps = np.arange(200) * CAR.step
    design = pi_design(CAR, 0.4)
    pi = control.zpk([float(design.zero)], [1.0], float(design.gain), CAR.step) * CAR.transfer(0.4)
    run = simulate("pi", "published", (0.0, 0.0, 0.4), limit=np.inf, duration=9.0)
    np.testing.assert_allclose(run.distance, control.step_response(control.feedback(pi, 1), steps)[1], atol=1e-5)
    pd = control.feedback(pd_locus(PD_CAR, PD_SPEED, misprinted_pd_design()), 1)  # Figure 3.40
    np.testing.assert_allclose(figure("3.40").distance[:200], control.step_response(pd, steps)[1], atol=1e-5)


def test_every_published_figure_ends_at_the_wanted_distance() -> None:
    for number in FIGURES:
        assert figure(number).distance[-1] == pytest.approx(1.0, abs=5e-3), number


def test_what_the_report_says_of_its_figures() -> None:
    runs = {number: figure(number) for number in FIGURES}
    # 3.14 and 3.18: without a limit the state feedback asks for more than there is.
    for number in ("3.12", "3.16"):
        assert abs(runs[number].steering).max() > 22.0
    # 3.13 and 3.17: with it, it winds up; 3.33 and 3.37: the cascade does not swing over at all.
    for free, limited, cascade in (("3.12", "3.13", "3.33"), ("3.16", "3.17", "3.37")):
        assert runs[limited].distance.max() > runs[free].distance.max() + 0.05
        assert runs[cascade].distance.max() < 1.001
    # 3.9 against 3.10 against 3.35: the PI swings furthest, the cascade least, to both sides.
    swings = [np.ptp(runs[number].distance) for number in ("3.9", "3.10", "3.35")]
    assert swings[0] > swings[1] > swings[2]
    # 3.40: a pole pair off the real axis swings over.
    assert runs["3.40"].distance.max() > 1.1


def test_as_driven_the_distance_weighs_57_times_less() -> None:
    steering = []
    for variant in ("as-driven", "si"):
        start = simulate("pi", variant, (0.999, 0.0, 0.4), duration=0.045)
        steering.append(start.steering[0])
    assert steering[1] / steering[0] == pytest.approx(180.0 / np.pi)
    steering = [
        simulate("pi-state", variant, (1.0, 2.0, 0.4), duration=0.045).steering[0] for variant in ("as-driven", "si")
    ]
    assert steering[1] == pytest.approx(steering[0])  # the heading as much
    # So the cascade as driven creeps up to the wall, and the PI, stable only with enough gain, swings for good.
    assert simulate("cascade", "as-driven", (0.8, 20.0, 0.4)).distance[-1] < 0.98
    assert settled(simulate("pi", "as-driven", (0.8, 20.0, 0.4))) > 0.1


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ValueError, match="cascade-redesigned"):
        simulate("lqr", "si", (1.0, 0.0, 1.0))
    with pytest.raises(ValueError, match="as-driven"):
        simulate("pi", "radians", (1.0, 0.0, 1.0))
    with pytest.raises(ValueError, match="radians"):
        simulate("cascade-redesigned", "as-driven", (1.0, 0.0, 1.0))


# --- on the car


def test_it_chatters_on_the_measured_yaw_rate() -> None:
    run = simulate("cascade-delayed", "si", (0.8, 20.0, 0.4), plant=linear_plant(CAR, 0.4))
    assert share_at_limit(run) == pytest.approx(0.92, abs=5e-3)
    run = simulate("cascade-delayed", "si", (0.8, 20.0, 0.4))
    assert share_at_limit(run) > 0.9


STARTS = [(0.0, 0.0), (0.5, -20.0), (0.8, 20.0), (1.5, 0.0), (1.3, -20.0)]


@pytest.mark.parametrize("offset", [0.0, 3.0, -3.0])
@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("speed", [0.4, 0.7, 1.0, 1.5, 2.0])
def test_the_redesign_neither_overshoots_nor_winds_up_nor_chatters(
    speed: float, start: tuple[float, float], offset: float
) -> None:
    car = kinematic_plant(CAR, speed, offset * DEGREE)
    run = simulate("cascade-redesigned", "si", (*start, speed), plant=car, duration=30.0)
    beyond = (run.distance - 1.0) * np.sign(1.0 - start[0])
    assert beyond.max() < 0.005
    assert settled(run) < 1e-3
    assert np.abs(np.diff(run.steering[-200:])).max() < 0.01
    # The steering settles on what the offset asks for, and it never swings between its limits.
    assert run.steering[-1] == pytest.approx(-offset, abs=0.02)
    at_limit = np.sign(run.steering) * (abs(run.steering) > 21.99)
    assert np.count_nonzero(np.diff(at_limit[at_limit != 0.0])) <= 2


def test_the_pd_drove_but_leaves_an_error_behind() -> None:
    assert settled(simulate("pd", "as-driven", (0.8, 20.0, PD_SPEED), car=PD_CAR)) < 1e-3
    plant = kinematic_plant(PD_CAR, PD_SPEED, 3.0 * DEGREE)
    # 3 degrees of offset are balanced by 15 degrees per metre.
    run = simulate("pd", "as-driven", (1.0, 0.0, PD_SPEED), car=PD_CAR, plant=plant)
    assert run.distance[-1] == pytest.approx(1.0 + 3.0 / 15.0, abs=1e-3)
    run = simulate("pd", "si", (0.8, 20.0, PD_SPEED), car=PD_CAR)
    assert settled(run) > 0.1 and share_at_limit(run) > 0.9


@pytest.mark.parametrize("servo_lag", [0.0, 0.05])
@pytest.mark.parametrize("noise", [None, WallNoise()])
@pytest.mark.parametrize("offset", [3.0, -3.0])
@pytest.mark.parametrize("speed", [0.4, 1.0, 2.0])
@pytest.mark.parametrize("seeds", [(1,), pytest.param((0, 2), marks=pytest.mark.slow)])
def test_the_cascade_on_the_filter_holds_the_wall_within_2_cm(
    seeds: tuple[int, ...], speed: float, offset: float, noise: WallNoise | None, servo_lag: float
) -> None:
    for seed in seeds:
        start = [(1.0, 0.0), (0.8, 20.0), (0.5, -20.0)][seed]
        run = simulate_estimated((*start, speed), steering_offset=offset, noise=noise, servo_lag=servo_lag, seed=seed)
        assert settled(run, last=10.0) < 0.02
        assert np.std(np.diff(run.steering[-400:])) < (1.5 if noise else 0.01)
