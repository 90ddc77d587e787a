"""Yin 2010: identification from a driven run, and the identified model against another run."""

from __future__ import annotations

import numpy as np

from lanekeep_baselines.identification import DrivenRun, excited_drive, identify
from lanekeep_baselines.identification.result import PARAMETERS, UNITS, Identification
from lanekeep_baselines.identification.simulate import OUTPUTS, Inputs, simulate
from lanekeep_baselines.policy import Floats
from lanekeep_baselines.yin_design import YinModel
from lanekeep_benchmarks.replications import yin_plots as plots
from lanekeep_benchmarks.replications.record import Replication, Table
from lanekeep_env.physics.vehicles import VEHICLES

#: Length of the second run, in which the model never looks at a measurement but the speed, s.
SECONDS = 30.0


def modelled(run: DrivenRun, found: Identification) -> Floats:
    """Return what the identified model makes of a run's command and speed, (samples, 5), from its start."""
    parameters = np.array([found.values[name] for name in PARAMETERS])
    assert run.steering is not None and run.heading is not None and run.x is not None and run.y is not None
    start = np.array([run.steering[0], 0.0, run.yaw_rate[0]])
    anchor = np.stack([run.heading, run.x, run.y], axis=1)
    inputs = Inputs(run.speed, run.input, run.step, delay=run.delay)
    return simulate(parameters[None], start[None], inputs, anchor=anchor)[0]


def identification(found: Replication) -> None:
    """Parameters from one run of a minute; the model beside the measurement of another one."""
    result = identify(excited_drive(0))
    other = excited_drive(1, seconds=SECONDS)
    model = modelled(other, result)
    found.pictures["identification.png"] = plots.identification(other, model)
    car = VEHICLES["yin"]
    truth = YinModel.of(car, car.steering_ratio)
    true = (truth.a11, truth.a12, truth.a21, truth.a22, truth.b1, truth.b2, car.steering.lag)
    rows = []
    for name, unit, value in zip(PARAMETERS, UNITS, true, strict=True):
        low, high = result.intervals[name]
        numbers = (f"{value:.4g}", f"{result.values[name]:.4g}", f"{low:.4g} to {high:.4g}")
        rows.append((f"{name} [{unit}]", *numbers, f"{100.0 * (result.values[name] / value - 1.0):+.2f}"))
    found.tables.append(
        Table(
            "Identification from a minute at 10 to 25 m/s (the slides print no value; the car is known here)",
            ("parameter", "of the car", "identified", "95 % interval", "error [%]"),
            tuple(rows),
        )
    )
    said = []
    for k, (name, unit, scale) in enumerate(
        zip(OUTPUTS, ("°", "°/s", "°", "m", "m"), (180 / np.pi, 180 / np.pi, 180 / np.pi, 1.0, 1.0), strict=True)
    ):
        measured = getattr(other, name)
        rest, size = scale * np.std(model[:, k] - measured), scale * np.std(measured)
        said.append((f"{name.replace('_', ' ')} [{unit}]", f"{rest:.3f}", f"{size:.3f}"))
    found.tables.append(
        Table(
            f"Measurement against identified model over another run, {SECONDS:.0f} s from its start without correction",
            ("measured", "standard deviation of the difference", "of the measurement"),
            tuple(said),
        )
    )
