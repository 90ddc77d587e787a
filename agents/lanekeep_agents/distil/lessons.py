"""What a teacher shows of a set: drives that are as good as they can be, and what to do beside them."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import lanekeep_baselines
from lanekeep_agents.distil.mix import Lessons
from lanekeep_agents.optimum import Optimiser, best
from lanekeep_agents.teacher import Floats, Teacher
from lanekeep_env.checks import shown_path
from lanekeep_env.files import read_bounded, write_atomic

#: What the optimum starts from beside the controllers of the student.
_FURTHER = ("stanley",)
#: Returns below which a drive teaches nothing: where even the optimum leaves the lane, say.
_WORST = -15.0
#: How far beside a drive its feedback is believed: m along the road and across, rad.
_NEAR = (5.0, 1.0, 0.2)
LARGEST_LESSONS = 1 << 30


class Shown(NamedTuple):
    """Drives of a set: ``seeds`` (n,), ``actions`` (steps, n), ``states`` and ``gains`` (steps, n, states),
    ``curvature`` (steps, n) of the return by the action, ``returns`` (n,) and the student's base's, ``good`` (n,)."""

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
        the curvature of the return, 0 where it does not say."""
        way = teacher.from_states(teacher.states, self.states[step])
        action = self.actions[step] + np.einsum("nj,nj->n", self.gains[step], way)
        near = self.good & (np.abs(way[:, :3]) < _NEAR).all(axis=1)
        return action.clip(-1.0, 1.0), np.where(near, self.curvature[step], 0.0)


def shown_by_teacher(lessons: Lessons, seeds: NDArray[np.int64], bases: tuple[str, ...]) -> Shown:
    """Let the teacher drive a set; its sensors do not matter, for the teacher needs none."""
    optimiser = Optimiser(lessons.env_id, lessons.keywords, seeds.tolist())
    scenario: Any = optimiser.teacher.scenario
    driving = [lanekeep_baselines.make(name, scenario) for name in (*bases, *_FURTHER)]
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
    try:
        with np.load(io.BytesIO(read_bounded(file, LARGEST_LESSONS)), allow_pickle=False) as found:
            return Shown(**{name: found[name] for name in Shown._fields})
    except (OSError, KeyError, ValueError, EOFError) as error:
        raise ValueError(f"{shown_path(file)} is not what a teacher showed ({error}); use --overwrite") from None
