"""What is measured of an episode: metrics as a table, which of them a task has, and how steps become them.

An episode that departed (left its lane, touched a wall) is capped where it did: its errors count for the rest of its
length as what they were there, everything else as if it had ended there. Else a spun car would rule every mean, and one
that is thrown out early would have the smaller error. The return alone is what the environment has paid, whose steps
have a cap of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from lanekeep_benchmarks.evaluate import Step

Floats = NDArray[np.float64]

#: The rate of change of a truth: name of the signal, of the truth that is differenced over a control step.
RATES = {"lateral_jerk": "lateral_acceleration"}
#: The policy's own: the root of the mean square of its actions, of which 1 is all that the actuator gives.
ACTION = "action"


@dataclass(frozen=True)
class Metric:
    """One number of an episode, and how tables show it.

    Attributes:
        key: in result lines.
        label, unit, digits: of its column.
        signal: what it is made of: a name in `info`, one of `RATES`, or `ACTION`; empty where `how` says all.
        how: "rms", "peak" (of the size), "ever" (1 where it was at all: means are rates), "least", "last", "time"
            (driven, s), "lap" (time of the lap, s; the episode's length where it failed) or "return".
        holds: whether a departure's value counts for the rest of the episode.
        more_is_better: whether less is worse.
        most: what lies beyond counts as this much: a gap to nobody is no number.
    """

    key: str
    label: str
    unit: str
    digits: int
    signal: str
    how: str
    holds: bool = False
    more_is_better: bool = False
    most: float = np.inf

    @property
    def possible(self) -> tuple[float, float]:
        """Bounds of what it can be: sizes and times are not below 0, rates not above 1 either."""
        return 0.0 if self.how in _SIZES else -np.inf, 1.0 if self.how == "ever" else np.inf


#: Ways of measuring whose numbers cannot be negative.
_SIZES = ("rms", "peak", "ever", "time", "lap")
_ALL = (
    Metric("lap_time", "lap time", "s", 2, "lap_time", "lap"),
    Metric("rms_lateral_error", "RMS lateral error", "m", 3, "lateral_error", "rms", holds=True),
    Metric("peak_lateral_error", "peak lateral error", "m", 3, "lateral_error", "peak"),
    Metric("rms_heading_error", "RMS heading error", "rad", 4, "heading_error", "rms", holds=True),
    Metric("space_share", "share in the space", "", 3, "space_share", "last", more_is_better=True),
    Metric("kerb_distance", "distance of the kerb", "m", 3, "kerb_distance", "last"),
    Metric("end_heading_error", "heading error at the end", "rad", 4, "heading_error", "last"),
    Metric("smallest_clearance", "smallest clearance", "m", 3, "clearance", "least", more_is_better=True),
    Metric("rms_speed_error", "RMS speed error", "m/s", 3, "speed_error", "rms", holds=True),
    Metric("smallest_gap", "smallest gap", "m", 2, "gap", "least", more_is_better=True, most=200.0),
    Metric(
        "least_time_to_collision",
        "least time to collision",
        "s",
        2,
        "time_to_collision",
        "least",
        more_is_better=True,
        most=30.0,
    ),
    Metric("peak_stop_error", "peak stop error", "m", 3, "stop_error", "peak", most=200.0),
    Metric("contacts", "contact", "", 2, "contact", "ever"),
    Metric("avoidable_contacts", "avoidable contact", "", 2, "avoidable_contact", "ever"),
    Metric("overruns", "overrun", "", 2, "overrun", "ever"),
    Metric("avoidable_overruns", "avoidable overrun", "", 2, "avoidable_overrun", "ever"),
    Metric("interventions", "interventions", "", 1, "interventions", "last"),
    Metric("rms_jerk", "RMS jerk", "m/s³", 3, "jerk", "rms"),
    Metric("rms_steering_rate", "RMS steering rate", "rad/s", 4, "steering_rate", "rms"),
    Metric("rms_lateral_jerk", "RMS lateral jerk", "m/s³", 2, "lateral_jerk", "rms"),
    Metric("peak_lateral_acceleration", "peak lateral acceleration", "m/s²", 2, "lateral_acceleration", "peak"),
    Metric("rms_action", "RMS action", "", 4, ACTION, "rms"),
    Metric("time", "time driven", "s", 2, "", "time", more_is_better=True),
    Metric("return", "return", "", 1, "", "return", more_is_better=True),
)
#: Every metric by its key, in the order of the tables.
METRICS = {metric.key: metric for metric in _ALL}

_ERRORS = ("rms_lateral_error", "peak_lateral_error", "rms_heading_error")
_COMFORT = ("rms_steering_rate", "rms_lateral_jerk", "peak_lateral_acceleration", "rms_action")
_SPEED = ("rms_speed_error", "smallest_gap", "least_time_to_collision", "peak_stop_error", "rms_jerk")
#: Whether an episode had one, so that their means are rates.
_TRAFFIC = ("contacts", "avoidable_contacts", "overruns", "avoidable_overruns")
_LAP = ("lap_time", "smallest_clearance", *_COMFORT, "return")
_POSE = ("space_share", "kerb_distance", "end_heading_error")
#: The metrics of a task, where its scenario names none; of those, what its truth (`info`) does not tell is left out.
_OF_TASK = {
    "lanekeep/Drive-v0": (*_ERRORS, *_SPEED, *_TRAFFIC, *_COMFORT, "time", "return"),
    "lanekeep/Traffic-v0": (*_ERRORS, *_SPEED, *_TRAFFIC, *_COMFORT, "time", "return"),
    "lanekeep/LaneSupport-v0": (*_ERRORS, "interventions", *_COMFORT, "time", "return"),
    "lanekeep/WallFollow-v0": (*_ERRORS, "smallest_clearance", *_COMFORT, "time", "return"),
    "lanekeep/Circuit-v0": _LAP,
    "lanekeep/ObstacleCircuit-v0": _LAP,
    "lanekeep/ParallelPark-v0": ("lap_time", *_POSE, "smallest_clearance", *_COMFORT, "return"),
}
_OF_ROADS = (*_ERRORS, *_COMFORT, "time", "return")


def metrics_of(env_id: str, truth: Iterable[str], named: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the keys of a scenario's metrics in the order of the tables; the first is what differences are of.

    Args:
        env_id: of the environment, whose task says which they are where ``named`` does not.
        truth: names of what its `info` tells.
        named: by the scenario.

    Raises:
        ValueError: one is named of which `info` tells nothing.
    """
    told = {*truth, *RATES, ACTION, ""}
    missing = [key for key in named if METRICS[key].signal not in told]
    if missing:
        raise ValueError(
            f"metrics={missing[0]!r} is not allowed: {env_id} tells no {METRICS[missing[0]].signal!r} in its info"
        )
    wanted = named or _OF_TASK.get(env_id, _OF_ROADS)
    return tuple(key for key in wanted if METRICS[key].signal in told)


class Measured:
    """The metrics of a batch of episodes, gathered step by step; each car's sums are its own, in the order of steps.

    Args:
        keys: of the metrics.
        cars: number of episodes.
        steps: length of an episode, control steps.
        control_step: s.
        laps: whether a success is what the end of an episode says, not what all of its steps say.
    """

    def __init__(self, keys: Sequence[str], cars: int, steps: int, control_step: float, laps: bool) -> None:
        self._metrics = [METRICS[key] for key in keys]
        self._length, self._seconds, self._laps = steps, control_step, laps
        self._rate = 1.0 / control_step
        self._names = list(dict.fromkeys(metric.signal for metric in self._metrics if metric.signal))
        self._asks_for_least = any(metric.how == "least" for metric in self._metrics)
        size = (len(self._names), cars)
        self._now, self._squares, self._peak = np.zeros(size), np.zeros(size), np.zeros(size)
        self._least, self._last = np.full(size, np.inf), np.zeros(size)
        self._before: dict[str, Floats] = {}
        self._return, self._lap = np.zeros(cars), np.zeros(cars)
        self.failed, self.departed = np.zeros(cars, dtype=bool), np.zeros(cars, dtype=bool)
        #: Steps driven, and those of them up to the departure.
        self.count, self.counted = np.zeros((2, cars), dtype=np.int64)

    def watch(self, steps: Iterable[Step]) -> None:
        """Take all steps of `evaluate.drive`."""
        for step in steps:
            self.add(step)

    def add(self, step: Step) -> None:
        """Take a step."""
        alive, info = step.alive, step.info
        counts = alive & ~self.departed
        everyone = bool(counts.all())
        for row, name in enumerate(self._names):
            self._now[row] = self._signal(name, step)
        where: Any = True if everyone else counts
        np.copyto(self._last, self._now, where=where)
        if self._asks_for_least:
            np.minimum(self._least, self._now, out=self._least, where=where)
        if not everyone:  # once, which is cheaper than two masked sums
            np.copyto(self._now, 0.0, where=~counts)
        self._squares += self._now * self._now
        np.maximum(self._peak, np.abs(self._now, out=self._now), out=self._peak)
        self.departed |= counts & (info["cost"] > 0.0)
        self.counted += counts
        self.count += alive
        np.add(self._return, step.reward, out=self._return, where=True if everyone else alive)
        succeeds = info["is_success"]
        if self._laps:  # a success is at the end
            np.copyto(self.failed, ~succeeds, where=alive)
            np.copyto(self._lap, info["lap_time"], where=alive)
        else:
            self.failed |= alive & ~succeeds

    def _signal(self, name: str, step: Step) -> Any:
        if name == ACTION:
            action = step.action.clip(-1.0, 1.0)
            return (
                action[:, 0]
                if action.shape[1] == 1
                else np.sqrt(np.einsum("ij,ij->i", action, action) / action.shape[1])
            )
        if name not in RATES:
            return step.info[name]
        now = step.info[RATES[name]]
        before = self._before.get(name, now)
        self._before[name] = now
        return (now - before) * self._rate

    def results(self) -> dict[str, Floats]:
        """The metrics by key, (cars,) each."""
        return {metric.key: np.minimum(self._value(metric), metric.most) for metric in self._metrics}

    def _value(self, metric: Metric) -> Floats:
        if metric.how == "return":
            return self._return
        if metric.how == "time":
            return self._seconds * self.counted.astype(np.float64)
        if metric.how == "lap":
            return np.where(self.failed, self._length * self._seconds, self._lap)
        row = self._names.index(metric.signal)
        if metric.how == "rms":
            return self._rms(row, metric)
        return {"peak": self._peak, "ever": self._peak, "least": self._least, "last": np.abs(self._last)}[metric.how][
            row
        ]

    def _rms(self, row: int, metric: Metric) -> Floats:
        # The first step knows no rate.
        steps = np.maximum(self.counted - 1, 1) if metric.signal in RATES else self.counted
        rest = np.where(self.departed & metric.holds, np.maximum(self._length - self.counted, 0), 0)
        mean: Floats = (self._squares[row] + rest * self._last[row] ** 2) / (steps + rest)
        return np.sqrt(mean)
