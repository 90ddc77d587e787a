"""Run the notebooks: python docs/run_notebooks.py FOLDER

Their sources are Python in percent format, which Jupyter opens by jupytext and which hold no output; what is written
are notebooks with it, which the site shows.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import repeat
from pathlib import Path

import lanekeep_agents
import lanekeep_baselines
import lanekeep_benchmarks
import lanekeep_env
from lanekeep_env.files import write_atomic

SOURCES = {file.stem: file for file in sorted((Path(__file__).parent / "notebooks").glob("*.py"))}
#: What their output depends on beside their text.
PACKAGES = (lanekeep_env, lanekeep_baselines, lanekeep_agents, lanekeep_benchmarks)
#: Pictures between the lines, also where the reader's own are not shown; a processor for each notebook.
_KERNEL = {
    "MPLBACKEND": "module://matplotlib_inline.backend_inline",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
#: Of a cell, s.
_LONGEST = 1200
#: What pandas says of the looks of its tables; the site has its own.
_LOOKS = re.compile(r'<style scoped>.*?</style>\n| border="1" class="dataframe"| style="text-align: right;"', re.DOTALL)


def run(name: str, folder: Path) -> Path:
    """Run a notebook in a folder of its own below ``folder``; return the file with its output."""
    import jupytext
    import nbformat
    from nbclient import NotebookClient
    from traitlets.config import Config

    files = folder / "files" / name
    files.mkdir(parents=True, exist_ok=True)
    notebook = jupytext.read(SOURCES[name])
    where = {"metadata": {"path": str(files)}}
    with tempfile.TemporaryDirectory() as sockets:  # files, out of others' reach
        local = Config(KernelManager={"transport": "ipc", "ip": f"{sockets}/kernel"})
        client = NotebookClient(notebook, timeout=_LONGEST, kernel_name="python3", resources=where, config=local)
        client.execute(env=os.environ | _KERNEL)
    write_atomic(folder / f"{name}.ipynb", nbformat.writes(notebook))
    return folder / f"{name}.ipynb"


@cache
def changed() -> float:
    """When a source of the packages was last changed."""
    files = (file for package in PACKAGES for file in Path(package.__path__[0]).rglob("*.py"))
    return max(file.stat().st_mtime for file in files)


def executed(name: str, folder: Path) -> Path:
    """A notebook with its output, which is run where that is missing, or older than its source or the packages."""
    file = folder / f"{name}.ipynb"
    there = file.exists() and file.stat().st_mtime >= max(SOURCES[name].stat().st_mtime, changed())
    return file if there else run(name, folder)


def all_of(make: Callable[[str, Path], Path], folder: Path) -> list[Path]:
    """What ``make``, `run` or `executed`, returns for each notebook, side by side on all processors."""
    with ProcessPoolExecutor(os.cpu_count()) as pool:  # processes, which Ctrl-C reaches
        return list(pool.map(make, SOURCES, repeat(folder)))


def page(name: str, folder: Path) -> tuple[str, dict[str, bytes]]:
    """A notebook with its output, from ``folder``, as Markdown, and its pictures by their place beside it."""
    import nbformat
    from nbconvert import MarkdownExporter

    notebook = nbformat.read(folder / f"{name}.ipynb", as_version=4)
    resources = {"unique_key": name, "output_files_dir": name}
    text, found = MarkdownExporter().from_notebook_node(notebook, resources)
    return _LOOKS.sub("", text), found["outputs"]


def title(name: str) -> str:
    """A notebook's heading."""
    return SOURCES[name].read_text(encoding="utf-8").splitlines()[1].removeprefix("# # ")


if __name__ == "__main__":
    print(*all_of(run, Path(sys.argv[1])), sep="\n")
