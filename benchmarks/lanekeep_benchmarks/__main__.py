"""Entry point of the `lanekeep` command: names the missing extra instead of failing with a traceback."""

from __future__ import annotations

import sys
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code (0 success, 1 failure, 2 bad input, 130 interrupted)."""
    try:
        from lanekeep_benchmarks.cli import run
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("lanekeep"):
            raise
        print(f'lanekeep: {error.name} is not installed; pip install "lanekeep[bench]"', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("lanekeep: interrupted", file=sys.stderr)
        return 130
    return run(arguments)


if __name__ == "__main__":
    sys.exit(main())
