"""How fast this checkout's environments are beside another checkout's.

    python tests/same_speed.py OLD_CHECKOUT [--quick] [--only ID]

Prints new speed / old speed of every id: steps of a single environment, of 1,024 cars on one thread in both
precisions, and start-up (from the start of a process to its first step, kernels compiled before). Both run in turns,
in bursts too short for a machine's moods, and processor time counts. Several pairs of processes, since where a
process lies in memory is worth percents as well. Exit status 1 if anything is slower than 0.97 with all its interval.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from side_by_side.cases import options_module
from side_by_side.checkouts import HERE, Worker, checked

#: Least ratio that counts as equally fast.
LEAST = 0.97
#: Processor seconds of a burst.
BURST = 0.01
FORMS = ("single", "float64", "float32")


def timed_pair(env_id: str, places: list[int], paths: list[Path], rounds: int) -> dict[str, list[float]]:
    """Ratios old time / new time of one pair of processes, by form; ``places`` says which starts first."""
    workers = [Worker(path, "side_by_side.speed") for path in paths]
    spent = [0.0, 0.0]
    for place in places:
        spent[place] = workers[place].ask(("start", env_id))
    ratios = {"start-up": [spent[0] / spent[1]]}
    for form in FORMS:
        calls = 1
        while workers[0].ask((form, calls)) < BURST:
            calls *= 2
        workers[1].ask((form, calls))
        ratios[form] = []
        for _ in range(rounds):
            spent = [0.0, 0.0]
            for place in (*places, *reversed(places)):
                spent[place] += workers[place].ask((form, calls))
            ratios[form].append(spent[0] / spent[1])
    for worker in workers:
        worker.close()
    return ratios


def interval(ratios: np.ndarray, resamples: int = 2000) -> tuple[float, float, float]:
    """Median of the ratios (pairs, rounds), and its 95 % bootstrap interval over pairs and rounds within them."""
    rng = np.random.default_rng(0)
    pairs, rounds = ratios.shape
    drawn = rng.integers(pairs, size=(resamples, pairs, 1)), rng.integers(rounds, size=(resamples, pairs, rounds))
    low, high = np.quantile(np.median(ratios[drawn], axis=(1, 2)), (0.025, 0.975))
    return float(np.median(ratios)), float(low), float(high)


def main() -> int:
    """Print the table; 1 if anything became slower."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old_checkout", metavar="OLD_CHECKOUT")
    parser.add_argument("--quick", action="store_true", help="fewer processes and rounds")
    parser.add_argument("--only", metavar="ID", help="one environment")
    given = parser.parse_args()
    try:
        paths = [checked(given.old_checkout), HERE]
    except ValueError as error:
        parser.error(str(error))
    pairs, rounds = (3, 10) if given.quick else (6, 20)
    slower = 0
    print("new speed / old speed (95 % interval)\n")
    print(f"{'':24}" + "".join(f"{name:24}" for name in ("single", "1,024 float64", "1,024 float32", "start-up")))
    for env_id in [given.only] if given.only else options_module().OPTIONS:
        for path in paths:
            worker = Worker(path, "side_by_side.speed")  # compiles what is not yet compiled
            worker.ask(("start", env_id))
            worker.close()
        found = [timed_pair(env_id, [[0, 1], [1, 0]][pair % 2], paths, rounds) for pair in range(pairs)]
        row = f"{env_id:24}"
        for form in (*FORMS, "start-up"):
            middle, low, high = interval(np.array([ratios[form] for ratios in found]))
            mark = " slow" if max(middle, high) < LEAST else ""
            slower += bool(mark)
            row += f"{f'{middle:.3f} ({low:.3f}…{high:.3f}){mark}':24}"
        print(row, flush=True)
    print(f"\n{slower} slower than {LEAST}" if slower else f"\nnothing is slower than {LEAST}")
    return int(slower > 0)


if __name__ == "__main__":
    raise SystemExit(main())
