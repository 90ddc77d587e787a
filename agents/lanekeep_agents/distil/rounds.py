"""A round of learning: the student drives every set, the teacher says what it would have done, least squares fit.

Source of the rounds: S. Ross, G. J. Gordon and J. A. Bagnell, A reduction of imitation learning and structured
prediction to no-regret online learning, AISTATS 2011.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lanekeep_agents.distil.lessons import Shown
from lanekeep_agents.distil.mix import Lessons
from lanekeep_agents.policy_record import PolicyRecord
from lanekeep_agents.student import Known, StudentPolicy
from lanekeep_agents.teacher import Floats, Teacher

#: Of an episode's steps all of the first are learned from, then one of so many.
FIRST, ONE_OF = 60, 6
#: Regret of a step (the return's unit) from which on it counts less: what no correction can mend.
OUTLIER = 0.04
#: Largest disturbance of the actions of the first round, drawn for each car: it has to see how to come back.
DISTURBED = 0.004
#: Share of what earlier rounds taught that is kept.
KEPT = 0.5
#: Added to the normalised diagonal of the normal equations.
RIDGE = 1e-5
#: Steps that are summed at a time.
_CHUNK = 16


@dataclass(frozen=True)
class Sums:
    """Normal equations of a weighted least-squares fit: F' W F and F' W y."""

    squares: Floats
    products: Floats

    @classmethod
    def none(cls, size: int) -> Sums:
        """Nothing learned."""
        return cls(np.zeros((size, size)), np.zeros(size))

    def plus(self, other: Sums, factor: float) -> Sums:
        """Add a factor of others."""
        return Sums(self.squares + factor * other.squares, self.products + factor * other.products)

    def solved(self) -> Floats:
        """Return the weights."""
        scale = 1.0 / np.sqrt(np.diag(self.squares) + 1e-12 * np.trace(self.squares) + 1e-300)
        matrix = self.squares * scale[:, None] * scale
        solution: Floats = scale * np.linalg.solve(matrix + RIDGE * np.eye(len(scale)), scale * self.products)
        return solution


@dataclass(frozen=True)
class Drill:
    """A set driven by a student with a factor of noise."""

    lessons: Lessons
    shown: Shown
    noise: float

    def learn(
        self, record: PolicyRecord, tensors: Mapping[str, NDArray[np.float32]], disturbed: bool, seed: int
    ) -> tuple[Sums, float]:
        """Let the student drive; return what there is to learn, and its mean return.

        Args:
            record, tensors: of the student.
            disturbed: add slow noise to its actions.
            seed: of that noise, and of which steps are learned from.
        """
        rng, n = np.random.default_rng(seed), len(self.shown.seeds)
        teacher = Teacher(self.lessons.env_id, n, **self.lessons.with_noise(self.noise))
        student = StudentPolicy(record, tensors, told(teacher.scenario, self.noise))
        size = sum(int(np.prod(shape)) for shape in record.shapes.values())
        sums, phase = Sums.none(size), int(rng.integers(ONE_OF))
        scale, slow = DISTURBED * rng.uniform(0.0, 1.0, n), np.zeros(n)
        seen, memory, start, total = teacher.reset(self.shown.seeds.tolist()), None, np.ones(n, dtype=bool), np.zeros(n)
        rows: list[tuple[NDArray[np.float32], Floats, Floats]] = []
        for k in range(len(self.shown.actions)):
            known, memory = student.know(seen, memory, start)
            start, action = np.zeros(n, dtype=bool), student.correct(known)
            if k < FIRST or k % ONE_OF == phase:
                wanted, curvature = self.shown.at(k, teacher)
                regret = curvature * (action - wanted) ** 2
                weight = (1.0 if k < FIRST else ONE_OF) * curvature / (1.0 + regret / OUTLIER)
                rows.append((features(known, student.places), wanted - known.action, weight))
            if len(rows) == _CHUNK or (rows and k + 1 == len(self.shown.actions)):
                sums, rows = sums.plus(_summed(rows), 1.0), []
            if disturbed:
                slow = 0.8 * slow + 0.6 * rng.standard_normal(n)
                action = (action + scale * slow).clip(-1.0, 1.0)
            seen, reward, _ = teacher.step(action)
            total += reward
        return sums, float(total.mean())


def features(known: Known, places: Sequence[tuple[list[int], list[int]]]) -> NDArray[np.float32]:
    """What each weight is multiplied with, (n, weights), in the order of the tensors; places as a student's."""
    left, right = known.left.T.astype(np.float32), known.right.T.astype(np.float32)
    parts = [(left[:, i, None] * right[:, None, j]).reshape(len(left), -1) for i, j in places]
    return np.concatenate(parts, axis=1)


def tensors_of(record: PolicyRecord, weights: Floats) -> dict[str, NDArray[np.float32]]:
    """Cut the weights into the tensors of a student."""
    found, first = {}, 0
    for name, shape in record.shapes.items():
        size = int(np.prod(shape))
        found[name] = weights[first : first + size].reshape(shape).astype(np.float32)
        first += size
    return found


def told(scenario: Any, noise: float) -> Any:
    """What the controllers of a student are told of a scenario: of noise, production sensors."""
    return replace(scenario, sensors="production") if noise else scenario


def held_out(lessons: Lessons, noise: float, seeds: NDArray[np.int64], policy: Any, worst: float) -> float:
    """Return the mean return of a policy over episodes that nothing is learned from, of an episode ``worst`` at least.

    ``policy``: takes what it is told of the scenario, gives the policy.
    """
    teacher, n = Teacher(lessons.env_id, len(seeds), **lessons.with_noise(noise)), len(seeds)
    driver = policy(told(teacher.scenario, noise))
    seen, memory, start, total = teacher.reset(seeds.tolist()), None, np.ones(n, dtype=bool), np.zeros(n)
    for _ in range(teacher.scenario.episode_steps):
        action, memory = driver.predict(seen, memory, start)
        start = np.zeros(n, dtype=bool)
        seen, reward, _ = teacher.step(action[:, 0])
        total += reward
    return float(np.maximum(total, worst).mean())


def _summed(rows: list[tuple[NDArray[np.float32], Floats, Floats]]) -> Sums:
    root = np.sqrt(np.concatenate([weight for _, _, weight in rows])).astype(np.float32)
    f = np.concatenate([row for row, _, _ in rows])
    f *= root[:, None]
    y = np.concatenate([wanted for _, wanted, _ in rows]).astype(np.float32) * root
    return Sums((f.T @ f).astype(np.float64), (f.T @ y).astype(np.float64))
