"""The optimum of whole episodes for one who knows the road to its end and the true car: iterative LQR on the kernel.

No policy that learns of road and car as it drives can be expected to reach it. Source of the method: W. Li and
E. Todorov, Iterative linear quadratic regulator design for nonlinear biological movement systems, ICINCO 2004; the
cost's curvature is Gauss and Newton's, which it has exactly below its cap.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lanekeep_agents.teacher import Floats, Teacher

#: Shares of a correction that are tried, side by side.
SHARES = (1.0, 0.5, 0.2, 0.05)
#: What is added to the cost's curvature by the action, and how that changes where a correction helps or does not.
LEAST_DAMPING, MOST_DAMPING, FEWER, MORE = 1e-7, 1e-1, 0.1, 10.0
#: Gain of an episode, a share of its return, below which another correction is not worth its time.
SMALLEST_GAIN = 2e-4


@dataclass(frozen=True)
class Drives:
    """Episodes as they were driven.

    Attributes:
        actions: (steps, n).
        states: (steps + 1, n, states), those of `Teacher`.
        returns: (n,).
        kept: which cars never left their lane, (n,).
    """

    actions: Floats
    states: Floats
    returns: Floats
    kept: NDArray[np.bool_]

    def better_of(self, other: Drives) -> Drives:
        """Take the better drive of each episode."""
        mine = self.returns >= other.returns
        return Drives(
            np.where(mine, self.actions, other.actions),
            np.where(mine[:, None], self.states, other.states),
            np.where(mine, self.returns, other.returns),
            np.where(mine, self.kept, other.kept),
        )


@dataclass(frozen=True)
class Law:
    """Feedback around drives: the action ``actions + gains (x - states)`` and what another one costs.

    Attributes:
        correction: of the actions, which vanishes at an optimum, (steps, n).
        gains: (steps, n, states).
        curvature: half the second derivative of the cost to come by the action, (steps, n).
    """

    correction: Floats
    gains: Floats
    curvature: Floats


class Optimiser:
    """Improves drives of n episodes.

    Args:
        env_id, keywords: of `Teacher`.
        seeds: of the episodes.
        options: of `reset`.
        steps: of an episode; by default the scenario's.
    """

    def __init__(
        self,
        env_id: str,
        keywords: Mapping[str, Any],
        seeds: Sequence[int],
        options: Mapping[str, Any] | None = None,
        steps: int | None = None,
    ) -> None:
        self.seeds, self._options = list(seeds), options
        self.teacher = Teacher(env_id, len(self.seeds), **keywords)
        self._trials = Teacher(env_id, len(SHARES) * len(self.seeds), **keywords)
        self.steps = steps or self.teacher.scenario.episode_steps

    def drive(self, policy: Any) -> Drives:
        """Drive the episodes with a policy."""
        teacher, n = self.teacher, len(self.seeds)
        seen, memory, start = teacher.reset(self.seeds, self._options), None, np.ones(n, dtype=bool)
        found = _empty(self.steps, teacher)
        for k in range(self.steps):
            action, memory = policy.predict(seen, memory, start)
            start = np.zeros(n, dtype=bool)
            found.states[k], found.actions[k] = teacher.states, np.clip(action[:, 0], -1.0, 1.0)
            seen, reward, found.kept[:] = teacher.step(found.actions[k])
            found.returns[:] += reward
        found.states[-1] = teacher.states
        return found

    def improve(self, drives: Drives, most: int = 12) -> tuple[Drives, Law]:
        """Return better drives, after ``most`` corrections or when they bring nothing more, and the law around them.

        No episode's return becomes less. The law is that of the drives of the last correction but one where that
        one still brought something; its own correction is then what brought it.
        """
        damping = np.full(len(self.seeds), LEAST_DAMPING)
        for _ in range(most):
            law = self._law(drives, damping)
            found, trials = drives, self._tried(drives, law)
            for trial in trials:
                found = found.better_of(trial)
            gain = found.returns - drives.returns
            helps = gain > SMALLEST_GAIN * np.abs(drives.returns)
            damping = np.clip(damping * np.where(helps, FEWER, MORE), LEAST_DAMPING, MOST_DAMPING)
            drives, done = found, not helps.any() and (damping >= 1e3 * LEAST_DAMPING).all()
            if done or gain.mean() < SMALLEST_GAIN * np.abs(found.returns.mean()) / 4:
                break
        return drives, law

    def law(self, drives: Drives) -> Law:
        """Return the feedback around drives."""
        return self._law(drives, np.full(len(self.seeds), LEAST_DAMPING))

    def _law(self, drives: Drives, damping: Floats) -> Law:
        teacher, (steps, n) = self.teacher, drives.actions.shape
        teacher.reset(self.seeds, self._options)
        states = len(teacher.names)
        model = np.empty((steps, n, states, states + 1))
        for k in range(steps):
            found = teacher.linearise(drives.actions[k])
            model[k, :, :, :states], model[k, :, :, states] = found.a, found.b
            teacher.step(drives.actions[k])
        lateral, steer = teacher.names.index("lateral"), teacher.names.index("steer")
        of_error, of_steering = teacher.cost
        law = Law(np.empty((steps, n)), np.empty((steps, n, states)), np.empty((steps, n)))
        value, slope = np.zeros((n, states, states)), np.zeros((n, states))
        for k in range(steps - 1, -1, -1):
            f = model[k]
            error, turned = of_error * f[:, lateral], of_steering * f[:, steer]
            turned[:, steer] -= of_steering
            now = of_error * drives.states[k + 1, :, lateral]
            way = of_steering * (drives.states[k + 1, :, steer] - drives.states[k, :, steer])
            to_come = f.transpose(0, 2, 1)
            q = to_come @ (value @ f)
            q += error[:, :, None] * error[:, None] + turned[:, :, None] * turned[:, None]
            p = (to_come @ slope[:, :, None])[:, :, 0] + error * now[:, None] + turned * way[:, None]
            curvature = q[:, -1, -1] + damping
            gain = -q[:, -1, :-1] / curvature[:, None]
            law.gains[k], law.curvature[k] = gain, curvature
            law.correction[k] = step = -p[:, -1] / curvature
            value = q[:, :-1, :-1] + q[:, :-1, -1:] * gain[:, None]
            value = 0.5 * (value + value.transpose(0, 2, 1))
            slope = p[:, :-1] + q[:, :-1, -1] * step[:, None]
        return law

    def _tried(self, drives: Drives, law: Law) -> list[Drives]:
        """Drive all `SHARES` of a correction."""
        teacher, n, count = self._trials, len(self.seeds), len(SHARES)
        teacher.reset(self.seeds * count, self._options)
        found = _empty(len(drives.actions), teacher)
        share = np.array(SHARES)[:, None]
        for k, planned in enumerate(drives.actions):
            states = teacher.states
            way = self.teacher.from_states(states.reshape(count, n, -1), drives.states[k])
            actions = planned + share * law.correction[k] + np.einsum("snj,nj->sn", way, law.gains[k])
            found.states[k] = states
            # As the kernel gets them, so that what is driven again is the same to the last bit.
            found.actions[k] = np.clip(actions, -1.0, 1.0).ravel().astype(np.float32)
            _, reward, found.kept[:] = teacher.step(found.actions[k])
            found.returns[:] += reward
        found.states[-1] = teacher.states
        return [_part(found, slice(i * n, (i + 1) * n)) for i in range(count)]


def best(optimiser: Optimiser, policies: Sequence[Any], starts: int = 1, most: int = 12) -> Drives:
    """Return the best drives that corrections lead to from the ``starts`` best of what ``policies`` drive.

    One start may stick where the car spins on saturating tyres: there several are worth their time. No episode is
    worse than with any of the policies.
    """
    driven = [optimiser.drive(policy) for policy in policies]
    order = np.argsort([-drives.returns for drives in driven], axis=0, kind="stable")
    found = None
    for rank in range(min(starts, len(driven))):
        start = _chosen(driven, order[rank])
        better, _ = optimiser.improve(start, most)
        found = better if found is None else found.better_of(better)
    if found is None:
        raise ValueError("policies=() is not allowed: it must be one or more to start from")
    return found


def _chosen(driven: Sequence[Drives], which: NDArray[np.intp]) -> Drives:
    """Take each episode from the drives of its number."""
    n = np.arange(len(which))
    return Drives(
        np.stack([one.actions for one in driven])[which, :, n].T.copy(),
        np.stack([one.states for one in driven])[which, :, n].transpose(1, 0, 2).copy(),
        np.stack([one.returns for one in driven])[which, n],
        np.stack([one.kept for one in driven])[which, n],
    )


def _empty(steps: int, teacher: Teacher) -> Drives:
    n = teacher.num_cars
    return Drives(
        np.empty((steps, n)), np.empty((steps + 1, n, len(teacher.names))), np.zeros(n), np.ones(n, dtype=bool)
    )


def _part(drives: Drives, cars: slice) -> Drives:
    return replace(
        drives,
        actions=drives.actions[:, cars],
        states=drives.states[:, cars],
        returns=drives.returns[cars],
        kept=drives.kept[cars],
    )
