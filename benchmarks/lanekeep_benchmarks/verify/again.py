"""A random part of a folder's episodes driven again, line beside line."""

from __future__ import annotations

import math
import secrets
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from lanekeep_benchmarks.evaluate import Batch, Driver
from lanekeep_benchmarks.lines import EpisodeResult, Place
from lanekeep_benchmarks.own_code import OwnCodeError
from lanekeep_benchmarks.verify.claims import Claims, agree

#: Of the episodes that can be driven, which are drawn when it is verified.
SHARE = 0.1
#: Drawn at least, where there are as many: one false line among few is found.
LEAST = 64


class Differs(NamedTuple):
    """A number or a flag of a result line that is not what is driven."""

    place: Place
    field: str
    claimed: Any
    driven: Any


class Again(NamedTuple):
    """A policy's episodes of a scenario, driven again; ``error`` where its code failed."""

    scenario: str
    policy: str
    episodes: int
    differs: Sequence[Differs] = ()
    error: str = ""


def drawn(claims: Claims) -> dict[tuple[str, str], list[int]]:
    """Numbers of a random tenth of the episodes, at least `LEAST`, by scenario and policy."""
    places = sorted(place for place in claims.lines if place[1] in claims.plan.drivers.get(place[0], ()))
    found: dict[tuple[str, str], list[int]] = {}
    count = min(len(places), max(LEAST, math.ceil(SHARE * len(places))))
    for scenario, policy, episode in sorted(secrets.SystemRandom().sample(places, count)):
        found.setdefault((scenario, policy), []).append(episode)
    return found


def drive_again(claims: Claims, episodes: Mapping[tuple[str, str], Sequence[int]]) -> Iterator[Again]:
    """Drive what was ``drawn``."""
    plan = claims.plan
    driver = Driver(plan.suite.name, plan.seed, plan.policy)
    scenarios = {one.name: one for one in plan.suite.scenarios}
    for (scenario, policy), numbers in episodes.items():
        try:
            batch = Batch(scenarios[scenario], policy, numbers, frozenset(numbers))
            lines = driver.drive(batch).results
        except OwnCodeError as error:
            yield Again(scenario, policy, len(numbers), error=str(error))
            continue
        differs = [one for line in lines for one in differences(claims.lines[line.place], line)]
        yield Again(scenario, policy, len(numbers), differs)
    driver.close()


def differences(claimed: EpisodeResult, driven: EpisodeResult) -> Iterator[Differs]:
    """Where a line is not the one that is driven: flags exactly, metrics up to `claims.TOLERANCE`."""
    for name in ("failed", "steps", "episode_seed", "scenario_hash"):
        pair = getattr(claimed, name), getattr(driven, name)
        if pair[0] != pair[1]:
            yield Differs(driven.place, name, *pair)
    for name, value in driven.metrics.items():
        if not agree(float(claimed.metrics[name]), value):
            yield Differs(driven.place, name, claimed.metrics[name], value)
