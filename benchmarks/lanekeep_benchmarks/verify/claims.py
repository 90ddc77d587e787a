"""What a result folder claims, and who can drive it again; nothing is driven here, and nothing from a file is run."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from lanekeep_baselines.declared import PREFIX
from lanekeep_benchmarks.bound_table import with_bounds
from lanekeep_benchmarks.budgets import BUDGETS
from lanekeep_benchmarks.lines import EpisodeResult, Place
from lanekeep_benchmarks.own_code import Checked
from lanekeep_benchmarks.plan import Plan, make_plan
from lanekeep_benchmarks.policies import FILE, Entry, entry_of, handed_over, is_known, limited
from lanekeep_benchmarks.replay import record_in, suite_of
from lanekeep_benchmarks.report import failures, markdown
from lanekeep_benchmarks.results import EPISODES, LARGEST_LINES, SUMMARY, TABLE, read_lines
from lanekeep_benchmarks.run_record import RunRecord, told
from lanekeep_benchmarks.summary import summarise
from lanekeep_benchmarks.verify.apart import Apart
from lanekeep_env.checks import shown
from lanekeep_env.files import read_bounded
from lanekeep_env.plain import parse_json

#: Numbers agree that differ by less, as a share of them, or in their unit where they are below 1.
TOLERANCE = 1e-6


@dataclass
class Claims:
    """A folder's record and result lines.

    Attributes:
        record: of the run.
        plan: the same run with those of its policies that can be driven here.
        lines: by their places.
        apart: policies of own code, each in a process of its own.
        left_out: policies that cannot be driven, and why.
        faults: what does not hold in the files.
    """

    record: RunRecord
    plan: Plan
    lines: dict[Place, EpisodeResult] = field(default_factory=dict)
    apart: list[Apart] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    def close(self) -> None:
        """End the processes of own code."""
        for one in self.apart:
            one.close()


def read_claims(folder: Path, named: Sequence[str]) -> Claims:
    """Read a folder; ``named`` is the own code that the person who asks wants run.

    Raises:
        ValueError, OSError: it holds no run of this version, a file is damaged, or none of its policies can be driven.
    """
    record = record_in(folder)
    for name in named:
        if name not in record.policies:
            raise ValueError(f"--policies {shown(name)} is none of the run's: {', '.join(record.policies)}")
    apart: list[Apart] = []
    entries: list[Entry] = []
    left_out: dict[str, str] = {}
    for name in record.policies:
        try:
            if handed_over(name, record.policy_sha256.get(name)):
                raise ValueError("handed over in Python, so that no command can make it again")
            entry = _entry(name, name in named, apart)
            if entry.sha256 != record.policy_sha256.get(name):
                raise ValueError("its file is not the one of the run")
            entries.append(entry)
        except (ValueError, OSError) as error:
            left_out[name] = str(error)
    if not entries:
        why = "; ".join(f"{shown(name)}: {reason}" for name, reason in left_out.items())
        raise ValueError(f"{folder}: none of its policies can be driven: {why}")
    road = None if record.road is None else Path(record.road)
    suite = None if road is not None else record.suite_file or record.suite
    plan = make_plan(suite, entries, road, record.episodes, record.seed, record.smoothing)
    claims = Claims(record, plan, apart=apart, left_out=left_out)
    claims.faults += [f"{name}: {why}" for name, why in left_out.items() if why.startswith("its file")]
    claims.faults += _foreign(record, plan)
    _read_lines(claims, folder)
    if not claims.faults:
        claims.faults += _wrong_tables(claims, folder)
    return claims


def _entry(name: str, named: bool, apart: list[Apart]) -> Entry:
    """The entry of a policy as a record names it: shipped, the file of a learned one, or code that a person named."""
    if is_known(name) or name.endswith(FILE):
        return entry_of(name, code=False)
    if not named:
        raise ValueError(f"own code, which is run only where you name it: --policies {name}")
    own = name.removeprefix(PREFIX)
    one = Apart(own)
    apart.append(one)
    entry = Entry(own, lambda scenario: Checked(own, one.make, scenario), one.sha256(), own)
    return limited(entry) if name.startswith(PREFIX) else entry


def _foreign(record: RunRecord, plan: Plan) -> list[str]:
    """Scenarios and metrics that are not those of the suite here."""
    here = {name: record.scenario_hash.get(name) for name in plan.scenario_hash}
    there = replace(
        record,
        scenario_hash={name: hash_ for name, hash_ in here.items() if hash_ is not None},
        metrics={name: record.metrics.get(name, ()) for name in plan.metrics},
    )
    wanted = replace(plan.record, policies=record.policies, policy_sha256=record.policy_sha256, trace=record.trace)
    differences = wanted.differences(there)
    return [f"run.json: {told(differences)}"] if differences else []


def _read_lines(claims: Claims, folder: Path) -> None:
    content = read_bounded(folder / EPISODES, LARGEST_LINES)
    try:
        for number, line in read_lines(content):
            if foreign := claims.record.line_differences(line):
                claims.faults.append(f"{EPISODES} line {number}: {told(foreign)}")
            elif line.place in claims.lines:
                claims.faults.append(f"{EPISODES} line {number} repeats {', '.join(map(str, line.place))}")
            else:
                claims.lines[line.place] = line
    except ValueError as error:
        raise ValueError(f"{folder / EPISODES} {error}") from None
    counts = Counter((scenario, policy) for scenario, policy, _ in claims.lines)
    wanted = {(scenario, policy) for scenario, those in claims.plan.drivers.items() for policy in those}
    for scenario, policy in sorted(wanted | counts.keys()):
        missing = claims.record.episodes - counts[scenario, policy]
        if missing:
            claims.faults.append(
                f"{EPISODES}: {missing} of {claims.record.episodes} episodes of {policy} on {scenario} are missing"
            )


def _wrong_tables(claims: Claims, folder: Path) -> Iterator[str]:
    """Where summary and tables are not what the lines give."""
    suite = suite_of(claims.record)
    suite = replace(suite, scenarios=tuple(one for one in suite.scenarios if one.name in claims.record.scenario_hash))
    try:
        found = parse_json(read_bounded(folder / SUMMARY, LARGEST_LINES))
        table = read_bounded(folder / TABLE, LARGEST_LINES).decode()
    except (OSError, ValueError) as error:
        yield f"{SUMMARY} and {TABLE}: {getattr(error, 'strerror', None) or error}"
        return
    results = list(claims.lines.values())
    wanted = json.loads(json.dumps(with_bounds(summarise(suite, results, claims.record.policies), results, folder)))
    place = next(_differences(found, wanted), None)
    if place is not None:
        yield f"{SUMMARY} is not what the lines give: {place}"
    elif not _shows(table, found, results):
        yield f"{TABLE} does not show what {SUMMARY} says"


def _shows(table: str, summary: Any, results: Sequence[EpisodeResult]) -> bool:
    """Whether a table is that of summary and lines; what was spent on policies stands between, and their files say."""
    between = table.removeprefix(markdown(summary)).removesuffix(failures(results))
    return not between or between.startswith(f"\n{BUDGETS}\n")


def _differences(found: Any, wanted: Any, where: str = "") -> Iterator[str]:
    """Where plain data differ."""
    if isinstance(wanted, Mapping) and isinstance(found, Mapping) and found.keys() == wanted.keys():
        for key in wanted:
            yield from _differences(found[key], wanted[key], f"{where}.{key}" if where else key)
    elif isinstance(wanted, list) and isinstance(found, list) and len(found) == len(wanted):
        for number, pair in enumerate(zip(found, wanted, strict=True)):
            yield from _differences(*pair, f"{where}.{number}")
    elif not agree(found, wanted):
        yield f"{where} is {shown(found)} there, {shown(wanted)} here"


def agree(found: Any, wanted: Any) -> bool:
    """Whether two plain values are one: numbers up to `TOLERANCE`, everything else exactly."""
    if isinstance(found, float) and isinstance(wanted, float | int):
        return math.isclose(found, wanted, rel_tol=TOLERANCE, abs_tol=TOLERANCE)
    return type(found) is type(wanted) and bool(found == wanted)
