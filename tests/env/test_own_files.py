"""The trial of a folder of other people's files tells driven, refused and broken ones apart."""

import importlib
from pathlib import Path

import numpy as np


def test_a_folder_is_driven_or_refused_line_by_line(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1]))
    own_files = importlib.import_module("own_files")
    line = np.column_stack([np.arange(0.0, 300.0, 5.0), np.zeros(60)])
    np.savetxt(tmp_path / "straight.csv", line, delimiter=",", header="x_m,y_m")
    (tmp_path / "broken.gpx").write_text("<kml/>")
    (tmp_path / "read.me").write_text("no road")
    monkeypatch.setattr("sys.argv", ["own_files", str(tmp_path), "--policies", "stanley"])
    assert own_files.main() == 0
    broken, straight = capsys.readouterr().out.splitlines()
    assert broken.startswith("broken.gpx | stanley | refused: ") and "<gpx>" in broken
    assert straight.startswith("straight.csv | stanley | driven after ")
    monkeypatch.setattr(own_files, "driven", lambda *_, **__: 1 / 0)
    assert own_files.main() == 1
    assert "ERROR ZeroDivisionError" in capsys.readouterr().out
