"""Run the notebooks: python docs/run_notebooks.py build/notebooks

Their sources are Python in percent format, which Jupyter opens by jupytext and which hold no output; what is written
are notebooks with it, which the site shows.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
from pathlib import Path

from lanekeep_env.files import write_atomic

SOURCES = {file.stem: file for file in sorted((Path(__file__).parent / "notebooks").glob("*.py"))}
#: Where notebooks are with their output, and what they write themselves.
EXECUTED = Path(__file__).resolve().parents[1] / "build" / "notebooks"
#: Pictures between the lines, also where the reader's own are not shown.
_INLINE = {"MPLBACKEND": "module://matplotlib_inline.backend_inline"}
#: Of a cell, s.
_LONGEST = 1200
#: What pandas says of the looks of its tables; the site has its own.
_LOOKS = re.compile(r'<style scoped>.*?</style>\n| border="1" class="dataframe"| style="text-align: right;"', re.DOTALL)


def run(name: str, folder: Path) -> Path:
    """Run a notebook in a folder of its own; return the file with its output."""
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
        client.execute(env=os.environ | _INLINE)
    write_atomic(folder / f"{name}.ipynb", nbformat.writes(notebook))
    return folder / f"{name}.ipynb"


def executed(name: str, folder: Path = EXECUTED) -> Path:
    """A notebook with its output, which is run where that is missing or older than the source."""
    file = folder / f"{name}.ipynb"
    there = file.exists() and file.stat().st_mtime >= SOURCES[name].stat().st_mtime
    return file if there else run(name, folder)


def page(name: str) -> tuple[str, dict[str, bytes]]:
    """A notebook with its output as Markdown, and its pictures by their place beside it."""
    import nbformat
    from nbconvert import MarkdownExporter

    notebook = nbformat.read(executed(name), as_version=4)
    resources = {"unique_key": name, "output_files_dir": name}
    text, found = MarkdownExporter().from_notebook_node(notebook, resources)
    return _LOOKS.sub("", text), found["outputs"]


def title(name: str) -> str:
    """A notebook's heading."""
    return SOURCES[name].read_text(encoding="utf-8").splitlines()[1].removeprefix("# # ")


if __name__ == "__main__":
    for one in SOURCES:
        print(run(one, Path(sys.argv[1])))
