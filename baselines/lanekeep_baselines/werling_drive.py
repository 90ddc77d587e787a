"""Werling, Gröll, Bretthauer 2008, 3.1: from a wanted acceleration to throttle and brake.

a = k(i) A_M(omega, gas) - b p - A_W(v) (25). The static inverse of the engine's map splits the range: what the engine
cannot hold back with a closed throttle is the brake's. An integrator makes good what the model does not know, wind and
slope; it stands still where an actuator is at its end, or the driver has taken over, and would be driven further in.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.policy import Floats


class EngineMap:
    """A_M over engine speed and throttle: bilinear between its grid points, clamped outside, with its inverse.

    Args:
        speeds: engine speeds, rad/s, increasing, (w,).
        throttles: throttle, increasing, from closed to open, (g,).
        values: acceleration per ratio k, m/s², increasing with the throttle, (w, g).
    """

    def __init__(self, speeds: Floats, throttles: Floats, values: Floats) -> None:
        if values.shape != (len(speeds), len(throttles)) or not (np.diff(values, axis=1) > 0.0).all():
            raise ValueError(
                f"values has shape {values.shape}, allowed: {(len(speeds), len(throttles))}, increasing with the "
                "throttle: elsewise it has no inverse"
            )
        self._speeds, self._throttles, self._values = speeds, throttles, values

    def at(self, speed: Floats) -> Floats:
        """Return the accelerations of all throttles of the grid at an engine speed (n,), (n, g)."""
        place = np.interp(speed, self._speeds, np.arange(len(self._speeds), dtype=np.float64))
        index = np.minimum(place.astype(np.intp), len(self._speeds) - 2)
        part = (place - index)[:, None]
        return self._values[index] + part * (self._values[index + 1] - self._values[index])

    def value(self, speed: Floats, throttle: Floats) -> Floats:
        """Return A_M, m/s², (n,)."""
        return _between(np.broadcast_to(self._throttles, (len(speed), len(self._throttles))), self.at(speed), throttle)

    def throttle(self, speed: Floats, value: Floats) -> Floats:
        """Return the throttle that gives ``value``, clamped to closed and open, (n,)."""
        rows = self.at(speed)
        return _between(rows, np.broadcast_to(self._throttles, rows.shape), value)


def _between(x: Floats, y: Floats, at: Floats) -> Floats:
    """Return y at ``at`` (n,), linear between increasing x, (n, g) each, clamped outside."""
    held = np.clip(at, x[:, 0], x[:, -1])
    index = np.clip((x <= held[:, None]).sum(axis=1) - 1, 0, x.shape[1] - 2)
    rows = np.arange(len(x))
    low, high = x[rows, index], x[rows, index + 1]
    return y[rows, index] + (held - low) / (high - low) * (y[rows, index + 1] - y[rows, index])


class DriveCommand(NamedTuple):
    """Throttle in the map's unit, brake pressure in bar, and the acceleration (m/s²) that the model expects, (n,)."""

    throttle: Floats
    pressure: Floats
    expected: Floats


def split_range(
    engine: EngineMap,
    acceleration: Floats,
    engine_speed: Floats,
    ratio: Floats,
    resistance: Floats,
    brake_constant: float,
    most_pressure: float,
) -> DriveCommand:
    """Return throttle and brake for an acceleration, m/s², by inverting (25).

    Args:
        engine: A_M.
        acceleration: wanted, m/s², (n,).
        engine_speed: rad/s, (n,).
        ratio: k of the present gear, (n,), above zero.
        resistance: A_W, m/s², (n,): drag, rolling, and what an automatic gearbox's creep takes off.
        brake_constant: b, m/s² per bar.
        most_pressure: bar.
    """
    needed = acceleration + resistance
    throttle = engine.throttle(engine_speed, needed / ratio)
    driving = ratio * engine.value(engine_speed, throttle)
    closed = ratio * engine.at(engine_speed)[:, 0]
    pressure = np.clip((closed - needed) / brake_constant, 0.0, most_pressure)
    return DriveCommand(throttle, pressure, driving - brake_constant * pressure - resistance)


class AccelerationIntegrator:
    """The integrator of the acceleration control. Memory, (n, 1): its state, m/s², added to what is asked for.

    Args:
        rate: of the integration, 1/s.
        step: control step, s.
        bound: of the state, m/s².
    """

    memory = 1

    def __init__(self, rate: float, step: float, bound: float = 3.0) -> None:
        self._gain, self._bound = rate * step, bound

    def asked(self, wanted: Floats, memory: Floats, fresh: NDArray[np.bool_] | bool) -> Floats:
        """Return the acceleration to give to `split_range`, m/s², (n,)."""
        return wanted + np.where(fresh, 0.0, memory[:, 0])

    def advance(
        self,
        wanted: Floats,
        measured: Floats,
        asked: Floats,
        expected: Floats,
        manual: NDArray[np.bool_] | bool,
        memory: Floats,
        fresh: NDArray[np.bool_] | bool,
    ) -> Floats:
        """Return the next memory, (n, 1).

        Args:
            wanted, measured: acceleration, m/s², (n,).
            asked: what `split_range` was given, m/s².
            expected: what throttle and brake can give of it, m/s²: less, or more, where one is at its end.
            manual: where the driver drives: the state stands still.
            memory, fresh: as above.
        """
        state = np.where(fresh, 0.0, memory[:, 0])
        change = self._gain * (wanted - measured)
        missing = np.where(np.abs(asked - expected) > 1e-9, asked - expected, 0.0)
        held = np.logical_or(manual, missing * change > 0.0)
        return np.clip(np.where(held, state, state + change), -self._bound, self._bound)[:, None]
