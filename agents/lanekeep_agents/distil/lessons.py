"""What a teacher shows of a set: drives that are as good as they can be, and what to do beside them."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import lanekeep_baselines
from lanekeep_agents.distil.mix import Lessons
from lanekeep_agents.optimum import Optimiser, best
from lanekeep_agents.teacher import Floats, Teacher
from lanekeep_env.checks import shown_path
from lanekeep_env.files import write_atomic
from lanekeep_env.plain import read_arrays

#: What the optimum starts from beside the controllers of the student, where it can drive.
_FURTHER = ("stanley",)
#: Returns below which a drive teaches nothing: where even the optimum leaves the lane, say.
_WORST = -15.0
#: How far beside a drive its feedback is believed: m along the road and across, rad.
_NEAR = (5.0, 1.0, 0.2)
#: Bytes beyond which files of a run are not read.
LARGEST = 1 << 30


class Shown(NamedTuple):
    """Drives of a set: ``seeds`` (n,), ``actions`` (steps, n), ``states`` and ``gains`` (steps, n, states),
    ``curvature`` (steps, n) of the cost by the action, ``returns`` (n,) and the student's base's, ``good`` (n,)."""

    seeds: NDArray[np.int64]
    actions: Floats
    states: Floats
    gains: NDArray[np.float32]
    curvature: NDArray[np.float32]
    returns: Floats
    base: Floats
    good: NDArray[np.bool_]

    def at(self, step: int, teacher: Teacher) -> tuple[Floats, Floats]:
        """Return what the teacher would do in a step from where its cars are now, (n,), and what another action costs:
        so much times the difference squared, 0 where it does not say."""
        way = teacher.from_states(teacher.states, self.states[step])
        action = self.actions[step] + np.einsum("nj,nj->n", self.gains[step], way)
        near = self.good & (np.abs(way[:, :3]) < _NEAR).all(axis=1)
        return action.clip(-1.0, 1.0), np.where(near, self.curvature[step], 0.0)


def shown_by_teacher(lessons: Lessons, seeds: NDArray[np.int64], bases: tuple[str, ...]) -> Shown:
    """Let the teacher drive a set; its sensors do not matter, for the teacher needs none."""
    optimiser = Optimiser(lessons.env_id, lessons.keywords, seeds.tolist())
    scenario: Any = optimiser.teacher.scenario
    further = [name for name in _FURTHER if name in lanekeep_baselines.names(scenario)]
    driving = [lanekeep_baselines.make(name, scenario) for name in (*bases, *further)]
    base = optimiser.drive(driving[0]).returns
    saturates = getattr(scenario, "tyre", "") == "magic_formula"
    drives = best(optimiser, driving, starts=2 if saturates else 1, most=6)
    law = optimiser.law(drives)
    good = drives.kept & (drives.returns > _WORST) & np.isfinite(law.gains).all(axis=(0, 2))
    return Shown(
        seeds,
        drives.actions,
        drives.states[:-1],
        law.gains.astype(np.float32),
        law.curvature.astype(np.float32),
        drives.returns,
        base,
        good,
    )


def write_shown(file: Path, shown: Shown) -> None:
    """Write what a teacher showed, atomically."""
    content = io.BytesIO()
    np.savez(content, **shown._asdict())
    write_atomic(file, content.getvalue())


def read_shown(file: Path) -> Shown:
    """Read what a teacher showed; ValueError where the file is damaged."""
    found = arrays_in(file, Shown._fields)
    shown = Shown(**found)
    steps, n = shown.actions.shape if shown.actions.ndim == 2 else (0, 0)
    wide = (steps, n, len(shown.states[0, 0]) if shown.states.ndim == 3 and steps and n else 0)
    shapes = [(n,), (steps, n), wide, wide, (steps, n), (n,), (n,), (n,)]
    if not n or [array.shape for array in shown] != shapes:
        raise ValueError(f"{shown_path(file)} is not what a teacher showed; use --overwrite")
    return shown


def arrays_in(file: Path, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    """Read the arrays of a file of this run; ValueError, one line, where they are not all there."""
    try:
        found = read_arrays(file, LARGEST)
    except (OSError, ValueError) as error:
        raise ValueError(f"{shown_path(file)} is damaged ({error}); use --overwrite") from None
    if set(found) != set(names):
        raise ValueError(f"{shown_path(file)} is not of this run: it must hold {', '.join(names)}; use --overwrite")
    return found
