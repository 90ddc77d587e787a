"""`lanekeep new`: a controller to begin with, which runs, and its test."""

from __future__ import annotations

import keyword
import re
import sys
from pathlib import Path
from typing import Annotated

import typer

from lanekeep_benchmarks.endings import input_errors
from lanekeep_env.checks import shown
from lanekeep_env.files import write_atomic

_TEMPLATES = Path(__file__).parent / "templates"
_NAME = re.compile(r"[a-z][a-z0-9]*([-_][a-z0-9]+)*")

new = typer.Typer(help="Write a file to begin with.", no_args_is_help=True)


@new.callback()
def _group() -> None:
    """Keep `controller` a command of its own, however many there are."""


@new.command()
def controller(
    name: Annotated[str, typer.Argument(help="Of the controller, as in my-controller.")],
    out: Annotated[Path, typer.Option(help="Folder for both files.")] = Path("."),
) -> None:
    """Write a controller that runs, NAME.py, and its test, test_NAME.py.

    Example: lanekeep new controller my-controller
    """
    with input_errors():
        module = name.replace("-", "_")
        if not _NAME.fullmatch(name) or keyword.iskeyword(module) or module in sys.stdlib_module_names:
            raise ValueError(f"NAME={shown(name)} is not allowed: small letters, digits and -, and no name of Python's")
        parts = re.split("[-_]", name)
        names = {"MyController": "".join(map(str.title, parts)), "my_controller": module, "my-controller": name}
        files = {}
        for template in ("my_controller.py", "test_my_controller.py"):
            text = (_TEMPLATES / template).read_text(encoding="utf-8")
            for old, mine in names.items():
                text = text.replace(old, mine)
            files[out / template.replace("my_controller", module)] = text
        for file in files:
            if file.exists():
                raise ValueError(f"{file} exists; allowed: another NAME or another --out")
        out.mkdir(parents=True, exist_ok=True)
        for file, text in files.items():
            write_atomic(file, text)
    first, test = files
    print(
        f"{first}, {test}\n"
        f"  lanekeep bench --policies stanley,{first}:{names['MyController']} --episodes 16\n"
        f"  python -m pytest {test}"
    )
