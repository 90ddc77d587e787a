"""The page for control engineers: its files, commands and Python are run as they stand there."""

import re
import shlex
import shutil
from pathlib import Path

import pytest

from lanekeep_benchmarks.__main__ import main

pytest.importorskip("casadi")
pytest.importorskip("pygame")
ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "control-engineers.md").read_text(encoding="utf-8")
#: Language, name of the file if it is one, text.
BLOCKS = re.findall(r"^```(\w*) ?(\S*)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def test_the_page_runs_from_top_to_bottom(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("lqr.py", "mpc.py"):
        shutil.copy(ROOT / "benchmarks" / "examples" / name, tmp_path)
    scope: dict = {}
    for language, name, text in BLOCKS:
        if name:
            Path(name).write_text(text)
        elif language == "python":
            exec(compile(text, "control-engineers.md", "exec"), scope)
        elif language == "console":
            for line in text.splitlines():
                program, *arguments = shlex.split(line)
                assert program == "lanekeep" and main(arguments) == 0, capsys.readouterr().err
    said = capsys.readouterr().out
    assert "my-pd: " in said and "observed.lateral_error" in said
    assert Path("worst.gif").is_file() and Path("tables", "results.csv").is_file()
    means = scope["results"].groupby("policy")["rms_lateral_error"].mean()
    assert means["lqr"] < means["my-pd"]
    assert not scope["results"]["failed"].any()


def test_the_page_shows_the_example_and_the_reference_table():
    """Its PD is the one of the examples, and its table names what its command drives."""
    (source,) = (text for _, name, text in BLOCKS if name == "pd.py")
    assert source == (ROOT / "benchmarks" / "examples" / "pd.py").read_text()
    (table,) = (text for language, _, text in BLOCKS if language == "text")
    commands = "".join(text for language, _, text in BLOCKS if language == "console")
    (bench,) = re.findall(r"--policies (\S+)", commands)
    for policy in bench.split(","):
        assert policy.rsplit("-", 1)[0] in table
