"""Runs: what makes them unusable is named; files are plain numbers; recording tells the truth."""

from __future__ import annotations

import os
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

import lanekeep_baselines
from lanekeep_baselines.identification import (
    DrivenRun,
    SensorNoise,
    UnusableRun,
    excited_drive,
    multi_sine,
    record_run,
)
from lanekeep_env.physics.vehicles import VEHICLES

SILENT = SensorNoise(speed=0.0, steering=0.0, yaw_rate=0.0, heading=0.0, position=0.0)


@pytest.fixture(scope="module")
def run() -> DrivenRun:
    return excited_drive(0, seconds=20.0, step=0.05)


def spoilt(values: np.ndarray, where: int, value: float) -> np.ndarray:
    values = values.copy()
    values[where] = value
    return values


def test_unusable_runs_say_why(run: DrivenRun) -> None:
    few = {name: getattr(run, name)[:90] for name in ("speed", "command", "yaw_rate", "steering", "heading", "x", "y")}
    faults = [
        (few, "too short: 4.45 s and 90 samples"),
        ({"yaw_rate": spoilt(run.yaw_rate, 40, np.nan)}, r"yaw_rate is nan at sample 40 \(2 s\)"),
        ({"x": spoilt(run.x, 7, np.inf)}, "x is inf at sample 7"),
        (
            {"command": run.command[:-1]},
            r"command has shape \(400,\); it must have one number a sample of speed: \(401,\)",
        ),
        ({"speed": spoilt(run.speed, 200, 0.5)}, "speed falls to 0.5 m/s at 10 s"),
        ({"command": None, "steering": None}, "neither command nor steering"),
        ({"heading": None}, "x and y need the heading"),
        ({"step": 0.0}, r"step=0.0 is not allowed"),
        ({"steering_ratio": -1.0}, "steering_ratio=-1.0 is not allowed"),
    ]
    for changes, message in faults:
        with pytest.raises(ValueError, match=message):
            replace(run, **changes)


def test_files_hold_what_was_measured(run: DrivenRun, tmp_path) -> None:
    run.save(tmp_path / "run.npz")
    again = DrivenRun.load(tmp_path / "run.npz")
    for name in ("speed", "command", "yaw_rate", "steering", "heading", "x", "y"):
        np.testing.assert_array_equal(getattr(again, name), getattr(run, name))
    assert (again.step, again.steering_ratio, again.delay) == (0.05, 16.0, 0.0)
    replace(run, x=None, y=None).save(tmp_path / "less.npz")
    assert DrivenRun.load(tmp_path / "less.npz").x is None
    assert (tmp_path / "run.npz").stat().st_size < 30_000


def test_files_of_another_kind_are_refused(run: DrivenRun, tmp_path) -> None:
    np.savez(tmp_path / "a.npz", speed=run.speed)
    with pytest.raises(UnusableRun, match="has no 'step'"):
        DrivenRun.load(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", step=0.05, speed=run.speed, command=run.command, yaw_rate=run.yaw_rate, yaw=run.x)
    with pytest.raises(UnusableRun, match="unknown entry 'yaw'"):
        DrivenRun.load(tmp_path / "b.npz")
    np.savez(tmp_path / "c.npz", step=0.05, speed=np.array([object()]), command=run.command, yaw_rate=run.yaw_rate)
    with pytest.raises(ValueError, match="allow_pickle"):
        DrivenRun.load(tmp_path / "c.npz")


def test_damaged_files_are_refused_in_one_line(run: DrivenRun, tmp_path) -> None:
    """Cut off, bombs, arrays of another kind or shape, and what is no file."""
    good = {name: getattr(run, name) for name in ("step", "speed", "command", "yaw_rate")}
    file = tmp_path / "run.npz"

    def refused(words: str, path=file) -> None:
        with pytest.raises((UnusableRun, OSError), match=words) as error:
            DrivenRun.load(path)
        assert "\n" not in str(error.value) and len(str(error.value)) < 500

    for changes, words in (
        ({"speed": np.array(["x" * 1000] * 401)}, "speed has dtype '<U1000'; allowed: numbers"),
        ({"speed": run.speed.astype(complex)}, "dtype 'complex128'"),
        ({"speed": run.speed > 0.0}, "speed has dtype 'bool'"),
        ({"speed": np.zeros((401, 2))}, "yaw_rate has shape|speed has shape"),
        ({"speed": np.array(20.0)}, "speed has shape"),
        ({"step": np.array("0.05")}, "step has dtype '<U4'"),
        ({"step": np.full(3, 0.05)}, "step="),
        ({"step": np.nan}, "step=nan"),
        ({"yaw_rate": spoilt(run.yaw_rate, 3, np.inf)}, "yaw_rate is inf at sample 3"),
        ({"x" * 1000: run.speed}, "unknown entry"),
    ):
        np.savez(file, **{**good, **changes})
        refused(words)
    np.savez(file, **good)
    content = file.read_bytes()
    for length in np.random.default_rng(0).integers(0, len(content), 50):
        file.write_bytes(content[:length])
        refused("run.npz")
    np.savez_compressed(file, **good, x=np.zeros(17 << 20))
    assert file.stat().st_size < 1 << 20
    refused("its arrays have")
    os.mkfifo(tmp_path / "pipe")
    refused("not an ordinary file", tmp_path / "pipe")
    refused("not an ordinary file", tmp_path)
    refused("No such file", tmp_path / "missing.npz")


def test_noise_has_the_stated_deviation_and_its_own_seed() -> None:
    clean, noise = excited_drive(0, noise=SILENT, step=0.05), SensorNoise()
    noisy, same = noise.added_to(clean, 5), noise.added_to(clean, 5)
    for name, deviation in {"speed": 0.02, "steering": 2e-3, "yaw_rate": 5e-3, "heading": 3e-3, "x": 0.03}.items():
        error = getattr(noisy, name) - getattr(clean, name)
        assert error.std() == pytest.approx(deviation, rel=0.1) and abs(error.mean()) < 4.0 * deviation / 34.0
        np.testing.assert_array_equal(getattr(noisy, name), getattr(same, name))
    np.testing.assert_array_equal(noisy.command, clean.command)
    # A measurement that is missing shifts nobody else's noise.
    np.testing.assert_array_equal(noise.added_to(replace(clean, steering=None), 5).yaw_rate, noisy.yaw_rate)


def test_heading_and_position_belong_together() -> None:
    """Position moves along heading plus sideslip, and the heading turns with the yaw rate, on a road of any shape."""
    run = excited_drive(1, noise=SILENT, seconds=20.0, road="yin")
    np.testing.assert_allclose(np.diff(run.heading), 0.01 * run.yaw_rate[:-1], atol=2e-4)
    way = np.hypot(np.diff(run.x), np.diff(run.y))
    np.testing.assert_allclose(way, 0.01 * run.speed[:-1], rtol=3e-3)
    course = np.unwrap(np.arctan2(np.diff(run.y), np.diff(run.x)))
    assert 0.005 < np.abs(course - run.heading[:-1]).max() < 0.1


@pytest.mark.parametrize("action", ["steering_angle", "steering_rate"])
@pytest.mark.parametrize("held", [False, True])
def test_excitation_arrives_as_asked(action: str, held: bool) -> None:
    """The command is the policy's plus the excitation, whichever way actions are given."""
    env = gym.make(
        "lanekeep_env:lanekeep/LaneKeep-v0", road="straight", speed=25.0, departure="off", action=action, preview=1
    )
    car = VEHICLES["yin"]
    steering = multi_sine(car, acceleration=0.5, seed=3)
    policy = lanekeep_baselines.make("stanley", env.unwrapped.scenario) if held else None
    run = record_run(env, 20.0, policy=policy, steering=steering)
    wanted = 16.0 * np.array([steering(0.05 * k, 25.0) for k in range(400)])
    np.testing.assert_allclose(run.command[:400] - wanted, 0.0, atol=16.0 * 0.05 if held else 1e-5)
    if held:
        assert np.abs(run.y).max() < 0.5


def test_multi_sine_is_felt_alike_at_every_speed() -> None:
    steering = multi_sine(VEHICLES["yin"], acceleration=1.5, band=(0.2, 1.0), seed=1)
    times = np.arange(0.0, 95.0, 0.05)
    for speed in (8.0, 20.0, 40.0):
        angle = np.array([steering(t, speed) for t in times])
        understeer = 1700.0 / 2.8 * (1.5 / 61850.0 - 1.3 / 107665.0)
        acceleration = angle / (2.8 / speed**2 + understeer)
        assert np.sqrt(np.mean(acceleration**2)) == pytest.approx(1.5, rel=0.03)
    spectrum = np.abs(np.fft.rfft(angle))
    frequency = np.fft.rfftfreq(len(times), 0.05)
    inside = (frequency > 0.15) & (frequency < 1.05)
    assert (spectrum[~inside] ** 2).sum() < 0.02 * (spectrum**2).sum()


def test_a_drive_that_ends_early_says_why() -> None:
    env = gym.make("lanekeep_env:lanekeep/LaneKeep-v0", road="straight", speed=20.0)
    with pytest.raises(ValueError, match=r"after 30 of 60 s: the time is up.*1200 or more"):
        record_run(env, 60.0, policy=lanekeep_baselines.make("pd", env.unwrapped.scenario))
    with pytest.raises(ValueError, match=r"the car left its lane: .*departure='off'"):
        record_run(env, 20.0, steering=lambda t, v: 0.05)
