"""Sizes of the code beside their aims, read from the syntax alone.

    python tests/code_metrics.py [--strict]

--strict: exit status 1 if an aim is missed. What a comment directly above a function explains ("Eleven parameters, for
...") is listed and does not count.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]
PACKAGES = ("lanekeep_env", "baselines/lanekeep_baselines", "agents/lanekeep_agents", "benchmarks/lanekeep_benchmarks")
#: How the names of modules end whose functions' parameters are the options of a command.
COMMANDS = ("cli", "command", "commands", "__main__")
SHOWN = 4
Function = ast.FunctionDef | ast.AsyncFunctionDef


@dataclass(frozen=True)
class Metric:
    """A figure and whether its aim is met; the worst offenders say where to begin."""

    name: str
    figure: str
    aim: str
    met: bool
    offenders: tuple[str, ...]

    def __str__(self) -> str:
        head = f"{self.name:44}{self.figure:>9}  aim {self.aim:8}{'' if self.met else '  missed'}"
        return "\n".join([head.rstrip(), *(f"    {offender}" for offender in self.offenders)])


@dataclass(frozen=True)
class Definition:
    """A function or class, where it stands, and whether a user sees it."""

    node: Function | ast.ClassDef
    file: Path
    name: str
    public: bool
    #: The comment directly above.
    comment: str

    @property
    def place(self) -> str:
        """As editors open it."""
        return f"{self.file.relative_to(HERE).as_posix()}:{self.node.lineno} {self.name}"


def definitions(file: Path) -> Iterator[Definition]:
    """Every function and class of a module, those within others included."""

    text = file.read_text(encoding="utf-8")
    written = text.splitlines()

    def above(node: Function | ast.ClassDef) -> str:
        first = last = min([node.lineno, *(mark.lineno for mark in node.decorator_list)]) - 1
        while first and written[first - 1].lstrip().startswith("# "):
            first -= 1
        return " ".join(line.strip() for line in written[first:last])

    def below(node: ast.AST, prefix: str, public: bool) -> Iterator[Definition]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, Function | ast.ClassDef):
                seen = public and not child.name.startswith("_")
                yield Definition(child, file, prefix + child.name, seen, above(child))
                inner_seen = seen and isinstance(child, ast.ClassDef)
                yield from below(child, f"{prefix}{child.name}.", inner_seen)
            else:
                yield from below(child, prefix, public)

    yield from below(ast.parse(text), "", True)


def lines(node: Function) -> int:
    """From ``def`` to the last line."""
    return (node.end_lineno or node.lineno) - node.lineno + 1


def parameters(node: Function) -> list[ast.arg]:
    """All of them but self and cls."""
    a = node.args
    named = [*a.posonlyargs, *a.args, *a.kwonlyargs, *(star for star in (a.vararg, a.kwarg) if star)]
    return [arg for arg in named if arg.arg not in ("self", "cls")]


def compiled_scalar(node: Function) -> bool:
    """Whether it is a scalar function of the compiled loops."""
    return any(isinstance(mark, ast.Name) and mark.id in ("inline", "helper") for mark in node.decorator_list)


def compiled(node: Function) -> bool:
    """Whether numba compiles it: its types are those of the arguments at the call."""
    marks = [mark.func if isinstance(mark, ast.Call) else mark for mark in node.decorator_list]
    return any(isinstance(mark, ast.Name) and mark.id in ("inline", "helper", "kernel") for mark in marks)


def typed(node: Function) -> bool:
    """Whether every parameter and what is returned are annotated."""
    return node.returns is not None and all(arg.annotation is not None for arg in parameters(node))


def largest(name: str, sizes: dict[str, int], aim: int, explained: Collection[str] = ()) -> Metric:
    """The largest of ``sizes`` by place, but for those ``explained`` there; offenders exceed ``aim``."""
    worst = sorted(((size, place) for place, size in sizes.items() if size > aim), reverse=True)
    figure = max((size for place, size in sizes.items() if place not in explained), default=0)
    shown = tuple(f"{size:5} {place}{', explained there' * (place in explained)}" for size, place in worst[:SHOWN])
    more = (f"      and {len(worst) - SHOWN} more above {aim}",) if len(worst) > SHOWN else ()
    return Metric(name, str(figure), f"≤ {aim}", figure <= aim, shown + more)


def share(name: str, good: dict[str, bool], aim: int) -> Metric:
    """Percentage of ``good`` by place; offenders are the files with most that are not."""
    files: dict[str, int] = {}
    for place, fine in good.items():
        file = place.partition(":")[0]
        files[file] = files.get(file, 0) + (not fine)
    worst = sorted(((count, file) for file, count in files.items() if count), reverse=True)[:SHOWN]
    percent = 100.0 * sum(good.values()) / max(len(good), 1)
    shown = tuple(f"{count:5} without in {file}" for count, file in worst)
    return Metric(name, f"{percent:.1f} %", f"≥ {aim} %", percent >= aim, shown)


def metrics() -> list[Metric]:
    """All figures of the four packages."""
    files = sorted(file for package in PACKAGES for file in (HERE / package).rglob("*.py"))
    found = [definition for file in files for definition in definitions(file)]
    functions = {d.place: d.node for d in found if isinstance(d.node, Function)}
    command = {d.place for d in found if d.file.stem.endswith(COMMANDS)}
    long, many = ({d.place for d in found if f"{what}, for" in d.comment} for what in ("lines", "parameters"))
    counts = {place: len(parameters(node)) for place, node in functions.items() if place not in command}
    scalar = {place for place in counts if compiled_scalar(functions[place])}
    environment = {place: node for place, node in functions.items() if place.startswith("lanekeep_env/")}
    python = {place: node for place, node in environment.items() if not compiled(node)}
    documented = {d.place: ast.get_docstring(d.node) is not None for d in found if d.public}
    modules = {file.relative_to(HERE).as_posix(): len(file.read_text(encoding="utf-8").splitlines()) for file in files}
    rest = {place: count for place, count in counts.items() if place not in scalar}
    return [
        largest("longest function, lines", {place: lines(node) for place, node in functions.items()}, 60, long),
        largest("most parameters", rest, 8, many),
        replace(
            largest("most parameters, compiled scalar functions", {place: counts[place] for place in scalar}, 8),
            aim="none",  # positions and rates by name, for which a record would cost time
            met=True,
        ),
        largest("largest module, lines", modules, 350),
        share("typed functions in lanekeep_env", {place: typed(node) for place, node in python.items()}, 90),
        replace(
            share("the same with those that numba compiles", {p: typed(node) for p, node in environment.items()}, 90),
            aim="none",  # numba reads no annotation: each would say what no checker checks
            met=True,
            offenders=(),
        ),
        share("public functions and classes with docstring", documented, 90),
    ]


def main() -> int:
    """Print all figures; 1 with --strict and an aim missed."""
    if sys.argv[1:] not in ([], ["--strict"]):
        print(__doc__, file=sys.stderr)
        return 2
    found = metrics()
    print("\n".join(map(str, found)))
    return int("--strict" in sys.argv and not all(metric.met for metric in found))


if __name__ == "__main__":
    raise SystemExit(main())
