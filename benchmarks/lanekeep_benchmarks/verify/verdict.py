"""What comes of a verification: what does not hold, a line each, and everything as plain data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lanekeep_benchmarks.endings import one_line, short
from lanekeep_benchmarks.machine import this_machine
from lanekeep_benchmarks.verify.again import Again
from lanekeep_benchmarks.verify.claims import Claims
from lanekeep_benchmarks.verify.fresh import Fresh


@dataclass
class Verdict:
    """What was claimed, driven again, and driven on fresh episodes of a seed; the lists fill as it is driven."""

    folder: Path
    claims: Claims
    again: list[Again] = field(default_factory=list)
    fresh: list[Fresh] = field(default_factory=list)
    seed: int = 0

    @property
    def faults(self) -> list[str]:
        """What does not hold."""
        found = [*self.claims.faults, *map(_of_again, filter(_is_wrong, self.again)), *self._of_fresh()]
        return [short(one_line(fault)) for fault in found]

    @property
    def worse(self) -> list[Fresh]:
        """Scores that are worse on fresh episodes than claimed, beyond chance."""
        return [one for one in self.fresh if one.worse(len(self.fresh))]

    def _of_fresh(self) -> Iterator[str]:
        failed = {one.policy for one in self.again if one.error}
        for one in self.fresh:
            if one.error and one.policy not in failed:
                yield f"{one.policy} on {one.scenario}, fresh episodes: {one.error}"
        for one in self.worse:
            yield (
                f"{one.policy} on {one.scenario}: {one.key} is {one.claimed:.4g} in the folder, {one.fresh:.4g} on "
                f"fresh episodes (by chance: {one.probability:.1g})"
            )

    @property
    def driven(self) -> int:
        """Episodes that were driven again."""
        return sum(one.episodes for one in self.again)

    @property
    def differ(self) -> int:
        """Those of them that are not what the folder says."""
        return len({differs.place for one in self.again for differs in one.differs})

    def to_dict(self) -> dict[str, Any]:
        """JSON-able."""
        record = self.claims.record
        return {
            "folder": str(self.folder),
            "suite": record.suite,
            "episodes": record.episodes,
            "seed": record.seed,
            "machines": list(record.machines),
            "verified_on": this_machine(),
            "holds": not self.faults,
            "faults": self.faults,
            "left_out": self.claims.left_out,
            "lines": len(self.claims.lines),
            "driven_again": self.driven,
            "differ": self.differ,
            "fresh_seed": self.seed,
            "scores": [_score(one, self.worse) for one in self.fresh],
        }


def _is_wrong(one: Again) -> bool:
    return bool(one.error or one.differs)


def _of_again(one: Again) -> str:
    if one.error:
        return f"{one.policy} on {one.scenario}: {one.error}"
    first, bad = one.differs[0], len({differs.place for differs in one.differs})
    return (
        f"{one.policy} on {one.scenario}: {bad} of {one.episodes} episodes driven again differ, e.g. {first.place[2]}: "
        f"{first.field} is {_number(first.claimed)} in the folder, {_number(first.driven)} driven"
    )


def _number(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)


def _score(one: Fresh, worse: Sequence[Fresh]) -> dict[str, Any]:
    difference = (
        None if one.difference is None else {key: _finite(value) for key, value in vars(one.difference).items()}
    )
    numbers = {key: _finite(getattr(one, key)) for key in ("claimed", "fresh", "probability")}
    return {**one._asdict(), **numbers, "difference": difference, "worse": one in worse}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
