"""Policies with memory, by numpy alone: a controller, corrected by what the drive has told of car and sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lanekeep_agents.binding import Binding
from lanekeep_agents.identified import IDENTIFIED, MEMORY, READ, Identifier, Seen
from lanekeep_agents.policy_file import check_tensors
from lanekeep_agents.policy_record import PolicyRecord
from lanekeep_agents.student_record import MOST_FACTORS, ONE, SLOWNESS, base_of, factors_of
from lanekeep_baselines.policy import SteeringPolicy
from lanekeep_env.checks import shown
from lanekeep_env.scenario.car import CarScenario

Floats = NDArray[np.float64]

#: m/s, at least, of which slowness is the inverse.
_SLOWEST = 6.0
#: Rows of a matrix product: as `learned.BLOCK`.
BLOCK = 8
#: Numbers of an LQ controller's memory that are its estimates of the axles' slip offsets, rad.
_OFFSETS = (5, 6)


class Known(NamedTuple):
    """What a step knows: the corrected controller's action (n,), and the terms of the products' sides, (terms, n)."""

    action: Floats
    left: Floats
    right: Floats


def _steering(base: Any) -> SteeringPolicy:
    if not isinstance(base, SteeringPolicy):
        raise ValueError(f"base={shown(base.name)} is not allowed: a student corrects controllers that only steer")
    return base


def _order(term: str) -> tuple[int, str]:
    return len(factors_of(term)), term


class StudentPolicy:
    """A policy with memory, with the interface of every policy.

    Args:
        record, tensors: what `read_policy` returns; the record has a ``student``.
        scenario: to drive, by default the one trained on.
        allow_files: let the one trained on read the road or the world whose file it names.

    Attributes:
        name: of the policy.
        record: what it is and how it came about.
        memory: numbers that it remembers of each car.
        places: of each product's terms among all that are on the left, and on the right.

    Raises:
        ValueError: tensors that the record does not ask for, or a scenario that the policy cannot drive.
    """

    def __init__(
        self,
        record: PolicyRecord,
        tensors: Mapping[str, NDArray[np.float32]],
        scenario: CarScenario | None = None,
        *,
        allow_files: bool = False,
    ) -> None:
        check_tensors(record, tensors)
        if record.student is None or record.bound is None:
            raise ValueError(f"policy {record.name!r} has no student")
        self.record, self.name, student = record, record.name, record.student
        self._largest = record.bound
        self._bound = bound = Binding(record, scenario, allow_files=allow_files)
        self._bases = [_steering(base) for base in bound.make_bases()]
        self._widths = [base.memory for base in self._bases]
        self.memory = sum(self._widths) + MEMORY
        car = bound.scenario
        self._identifier = Identifier(car.vehicle, car.control_step, student.fade)
        self._channels = tuple(channel.name for channel in car.channels)
        # One product instead of several: terms that they share are multiplied once. Those of several factors stand
        # side by side, at the end of the left and at the start of the right.
        left, right = (
            sorted({term for product in student.products for term in getattr(product, side)}, key=_order)
            for side in ("left", "right")
        )
        right.reverse()
        self._place([*left, *right])
        self._weights, self.places = np.zeros((len(left), len(right))), []
        for i, product in enumerate(student.products):
            places = [left.index(term) for term in product.left], [right.index(term) for term in product.right]
            np.add.at(self._weights, np.ix_(*places), tensors[f"products.{i}"].astype(np.float64))
            self.places.append(places)

    def _place(self, terms: Sequence[str]) -> None:
        """Give every factor its row among what is known, and every term those of its factors."""
        # Behind what is remembered, where the controllers' estimates stand already.
        names = (ONE, SLOWNESS, *self._channels, *(f"identified.{name}" for name in IDENTIFIED))
        columns = {name: self.memory + i for i, name in enumerate(names)}
        starts, self._width = np.cumsum([0, *self._widths]), self.memory + len(names)
        for factor in dict.fromkeys(factor for term in terms for factor in factors_of(term)):
            if (of := base_of(factor)) is None or factor in columns:
                continue
            number, place = of
            if place is None:
                columns[factor] = self._width
                self._width += 1
                continue
            if place >= self._widths[number]:
                raise ValueError(
                    f"policy {self.name!r}: {shown(factor)} is not known: {self._bases[number].name} remembers "
                    f"{self._widths[number]} numbers"
                )
            columns[factor] = int(starts[number]) + place
        self._actions = [columns.get(f"base{number}", -1) for number in range(len(self._bases))]
        padded = np.array([(factors_of(term) + [ONE] * MOST_FACTORS)[:MOST_FACTORS] for term in terms])
        factors = np.vectorize(columns.__getitem__, otypes=[np.intp])(padded).T
        self._first = factors[0]
        # From where to where terms have a second, a third factor, and which rows those are.
        self._further = []
        for rows in factors[1:]:
            if len(which := np.flatnonzero(rows != columns[ONE])):
                run = slice(which[0], which[-1] + 1)
                self._further.append((run, rows[run]))

    def __repr__(self) -> str:
        record = self.record
        words = f"{record.algorithm} trained on {record.env_id}, corrects {record.base}"
        return f"<{type(self).__name__} {self.name}: {words}>"

    def predict(
        self,
        observation: ArrayLike,
        state: NDArray[Any] | None = None,
        episode_start: ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], NDArray[Any] | None]:
        """Return actions in [-1, 1] and the next state.

        Args:
            observation: (channels,) or (n, channels) of the scenario.
            state: what the last call returned, (memory,) or (n, memory); None starts every row afresh.
            episode_start: () or (n,); rows that are true forget their state.
            deterministic: there is nothing random here; accepted for Stable-Baselines3's sake.

        Returns:
            Actions, float32, (1,) or (n, 1); the next state, float64.

        Raises:
            ValueError: an observation or a state of another shape.
        """
        given = self._bound.given(observation)
        rows = given[None] if given.ndim == 1 else given
        known, following = self.know(rows, state, episode_start)
        action = self.correct(known).astype(np.float32)[:, None]
        action = self._bound.convert(action, rows)
        return (action[0], following[0]) if given.ndim == 1 else (action, following)

    def know(
        self, rows: NDArray[np.float32], state: NDArray[Any] | None, episode_start: ArrayLike | None
    ) -> tuple[Known, Floats]:
        """Return what a step knows of n cars, and the next state (n, memory); as `predict`."""
        n = len(rows)
        memory = np.zeros((n, self.memory)) if state is None else np.atleast_2d(np.asarray(state, dtype=np.float64))
        if memory.shape != (n, self.memory):
            raise ValueError(f"state has shape {memory.shape}, allowed: {(n, self.memory)}, as predict returned it")
        fresh: NDArray[np.bool_] | bool = state is None
        if state is not None and episode_start is not None:
            started = np.asarray(episode_start, dtype=bool).reshape(-1)
            if len(started) != n:
                started = np.broadcast_to(started, (n,))
            fresh = started if started.any() else False
        # A row each, of what is known and what is remembered: rows are gathered ten times as fast as columns.
        known = np.empty((self._width, n))
        following, one, slowness = known[: self.memory], known[self.memory], known[self.memory + 1]
        observed = slice(self.memory + 2, self.memory + 2 + len(self._channels))
        one[:], known[observed] = 1.0, rows.T
        at = dict(zip(self._channels, known[observed], strict=True))
        first, corrected = 0, one
        for number, (base, width) in enumerate(zip(self._bases, self._widths, strict=True)):
            action, after = base.actions_for(at, memory[:, first : first + width], fresh)
            asked = np.minimum(np.maximum(action[:, 0], -1.0), 1.0, dtype=np.float64)
            if after is not None:
                following[first : first + width] = after.T
            if self._actions[number] >= 0:
                known[self._actions[number]] = asked
            corrected = corrected if number else asked
            first += width
        np.divide(1.0, np.maximum(at["speed"], _SLOWEST), out=slowness)
        offsets = (following[place] if self._widths[0] > place else np.zeros(n) for place in _OFFSETS)
        seen = Seen(*(at[name] for name in READ), *offsets)
        own = np.ascontiguousarray(memory.T[first:])
        identified = slice(observed.stop, observed.stop + len(IDENTIFIED))
        known[identified], following[first:] = self._identifier.follow(own, fresh, seen)
        terms = known[self._first]
        for run, factor in self._further:
            terms[run] *= known[factor]
        left = len(self._weights)
        return Known(corrected, terms[:left], terms[left:]), following.T

    def correct(self, known: Known) -> Floats:
        """Return the corrected actions, (n,)."""
        left, n = known.left, len(known.action)
        blocks = np.zeros((-(-n // BLOCK), BLOCK, len(left)))
        blocks.reshape(-1, len(left))[:n] = left.T
        gains = (blocks @ self._weights).reshape(-1, len(known.right))[:n]
        correction = np.vecdot(gains, np.ascontiguousarray(known.right.T))
        # Half as long as `clip`, here and above.
        np.maximum(correction, -self._largest, out=correction)
        np.minimum(correction, self._largest, out=correction)
        correction += known.action
        np.maximum(correction, -1.0, out=correction)
        corrected: Floats = np.minimum(correction, 1.0, out=correction)
        return corrected
