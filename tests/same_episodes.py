"""Whether this checkout's episodes equal another checkout's, bit for bit.

    python tests/same_episodes.py OLD_CHECKOUT [--quick] [--only ID]

Both drive the same cases at the same time, each in a process of its own, and every observation, reward, end and entry
of info is compared. Exit status 1 if anything differs by more than the last bit within a step.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter, defaultdict

from side_by_side.cases import all_cases
from side_by_side.checkouts import HERE, Worker, both, checked
from side_by_side.compare import compare
from side_by_side.drive import Case


class Findings:
    """What was found so far, case by case."""

    def __init__(self) -> None:
        self.count: Counter[str] = Counter()
        self.names: defaultdict[str, set[str]] = defaultdict(set)

    def add(self, kind: str, case: Case, what: object) -> None:
        """Count a case and, unless it is equal, show it at once."""
        self.count[kind] += 1
        if kind not in ("equal", "refused", "new id"):
            print(f"{kind}: {case}: {what}", flush=True)

    def lone_names(self, case: Case, side: str, names: set[str]) -> None:
        """Keep the quantities that one side alone shows."""
        if names:
            self.names[f"{case.env_id}: only {side} has"] |= names

    def summary(self) -> str:
        """All counts in a line."""
        n = self.count
        equal = n["equal"] + n["refused"] + n["message changed"]
        return (
            f"{sum(n.values())} cases: {equal} equal ({n['refused'] + n['message changed']} of them refused by both, "
            f"{n['message changed']} in other words), {n['last bit']} last bit, {n['different']} different"
            + (f", {n['new id']} of ids that old has not" if n["new id"] else "")
        )


def judge(case: Case, old: Worker, new: Worker, findings: Findings) -> None:
    """Drive a case in both checkouts and say how they differ."""
    before, after = both(old, new, case)
    if isinstance(before, str) or isinstance(after, str):
        if isinstance(before, str) and before.startswith("NameNotFound") and not isinstance(after, str):
            findings.add("new id", case, before)
        elif not (isinstance(before, str) and isinstance(after, str)):
            told = f"old raises {before}" if isinstance(before, str) else f"new raises {after}"
            findings.add("different", case, told)
        elif before != after:
            findings.add("message changed", case, f"{before} -> {after}")
        else:
            findings.add("refused", case, before)
        return
    gone = before.keys() - after.keys()
    findings.lone_names(case, "old", gone)
    findings.lone_names(case, "new", after.keys() - before.keys())
    differing = [name for name in before if name in after and before[name] != after[name]]
    difference = compare(*both(old, new, differing), case.columns) if differing else None
    if gone or (difference and not difference.last_bit):
        findings.add("different", case, difference or f"without {', '.join(sorted(gone))}")
    else:
        findings.add("last bit" if difference else "equal", case, difference)


def main() -> int:
    """Compare all cases; 1 if any differs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old_checkout", metavar="OLD_CHECKOUT")
    parser.add_argument("--quick", action="store_true", help="defaults and a handful of options, float64")
    parser.add_argument("--only", metavar="ID", help="one environment")
    given = parser.parse_args()
    try:
        checkout, cases = checked(given.old_checkout), all_cases(given.quick, given.only)
    except ValueError as error:
        parser.error(str(error))
    old, new = (Worker(path, "side_by_side.drive") for path in (checkout, HERE))
    findings = Findings()
    for env_id, some in cases.items():
        begin = time.perf_counter()
        for case in some:
            judge(case, old, new, findings)
        print(f"{env_id}: {len(some)} cases in {time.perf_counter() - begin:.0f} s", flush=True)
    for where, names in findings.names.items():
        print(f"{where} {', '.join(sorted(names))}")
    for worker in (old, new):
        worker.close()
    print(findings.summary())
    return int(findings.count["different"] > 0)


if __name__ == "__main__":
    raise SystemExit(main())
