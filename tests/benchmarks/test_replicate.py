"""`lanekeep replicate`: figures, published beside reproduced, nothing overwritten, errors in one line."""

import json

import pytest
from PIL import Image

from lanekeep_benchmarks import cli


@pytest.fixture(scope="module")
def van(tmp_path_factory):
    folder = tmp_path_factory.mktemp("van")
    assert cli.run(["replicate", "traechtler", "--out", str(folder / "run")]) == 0
    return folder / "run"


def test_every_number_of_the_van_comes_back(van):
    rows = json.loads((van / "replication.json").read_text())["rows"]
    assert len(rows) == 17
    for row in rows:
        tolerance = {"mm": 0.6, "m": 0.1 * row["published"]}.get(row["unit"], 0.006)
        assert abs(row["reproduced"] - row["published"]) <= tolerance, row


def test_blind_turns_are_as_good_as_the_suite_asks(van):
    """Bounds of the task: largest error by edge radius, 5 cm from 25 m after the switch on, calm at 20 m."""
    (table,) = (t for t in json.loads((van / "replication.json").read_text())["tables"] if "Blind" in t["title"])
    bounds = {"8": 0.70, "10": 0.55, "12": 0.45, "20": 0.25}
    assert len(table["rows"]) == 24
    for radius, _, policy, largest, after, jump, *_ in table["rows"]:
        assert float(largest) <= bounds[radius] * (1.0 if policy == "blind" else 0.5)
        assert float(after) <= 0.05
        if radius == "20":
            assert float(jump) < 5.0


def test_files_are_pictures_and_tables(van):
    text = (van / "replication.md").read_text()
    assert text.count("| section 3") == 5 and "![figure_7.png](figure_7.png)" in text
    for name in ("figure_5.png", "figure_7.png"):
        with Image.open(van / name) as picture:
            assert picture.size[0] > 1000


def test_an_earlier_replication_stays(van, capsys):
    before = (van / "replication.md").read_bytes()
    assert cli.run(["replicate", "traechtler", "--out", str(van)]) == 2
    said = capsys.readouterr().err
    assert "--overwrite" in said and said.count("\n") == 1
    assert (van / "replication.md").read_bytes() == before


def test_an_unknown_work_names_the_nearest(capsys, tmp_path):
    assert cli.run(["replicate", "traechtl", "--out", str(tmp_path / "x")]) == 2
    said = capsys.readouterr().err
    assert "'traechtler'" in said and said.count("\n") == 1 and not (tmp_path / "x").exists()
