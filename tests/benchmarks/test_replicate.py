"""`lanekeep replicate`: figures, published beside reproduced, nothing overwritten, errors in one line."""

import json

import pytest
from PIL import Image

from lanekeep_benchmarks import cli
from lanekeep_benchmarks.replications import WORKS


@pytest.fixture(scope="module")
def replicated(tmp_path_factory):
    """Folder of a work's replication; each is driven once, when a test asks for it."""
    folder, driven = tmp_path_factory.mktemp("replications"), set()

    def drive(work):
        if work not in driven:
            assert cli.run(["replicate", work, "--out", str(folder / work)]) == 0
            driven.add(work)
        return folder / work

    return drive


def read(folder):
    return json.loads((folder / "replication.json").read_text())


def table_of(folder, title):
    (table,) = (table for table in read(folder)["tables"] if title in table["title"])
    return table["rows"]


def van_tolerance(row):
    return {"mm": 0.6, "m": 0.1 * row["published"]}.get(row["unit"], 0.006)


def wall_tolerance(row):
    """Half of the last digit that is published; of r1 in radians only "52" is."""
    return 1.0 if row["unit"] == "rad/m" else 0.501 * 10.0 ** -row["digits"]


@pytest.mark.parametrize(
    ("work", "count", "tolerance"), [("traechtler", 17, van_tolerance), ("knightriders", 33, wall_tolerance)]
)
def test_every_number_comes_back(replicated, work, count, tolerance):
    rows = read(replicated(work))["rows"]
    assert len(rows) == count
    for row in rows:
        assert abs(row["reproduced"] - row["published"]) <= tolerance(row), row


PICTURES = {
    "traechtler": {"figure_5.png", "figure_7.png"},
    "knightriders": {
        "comparison.png",
        "figures_3_08_to_3_10.png",
        "figures_3_12_to_3_19.png",
        "figures_3_33_to_3_40.png",
        "kalman_filter.png",
        "one_sample_late.png",
        "root_loci.png",
        "root_loci_one_sample_late.png",
    },
}


@pytest.mark.parametrize("work", WORKS)
def test_files_are_pictures_and_tables(replicated, work):
    folder = replicated(work)
    found = read(folder)
    assert {file.name for file in folder.glob("*.png")} == set(found["pictures"]) == PICTURES[work]
    assert {file.name for file in folder.iterdir()} == PICTURES[work] | {"replication.json", "replication.md"}
    text = (folder / "replication.md").read_text()
    for name in PICTURES[work]:
        assert f"![{name}]({name})" in text
        with Image.open(folder / name) as picture:
            assert picture.size[0] > 1000
    for entry in (*(row["quantity"] for row in found["rows"]), *(table["title"] for table in found["tables"])):
        assert entry in text
    for table in found["tables"]:
        assert {len(cells) for cells in table["rows"]} == {len(table["headings"])}


@pytest.mark.parametrize("work", WORKS)
def test_an_earlier_replication_stays(replicated, work, capsys):
    folder = replicated(work)
    capsys.readouterr()
    before = (folder / "replication.md").read_bytes()
    assert cli.run(["replicate", work, "--out", str(folder)]) == 2
    said = capsys.readouterr().err
    assert "--overwrite" in said and said.count("\n") == 1
    assert (folder / "replication.md").read_bytes() == before


@pytest.mark.parametrize(("typed", "nearest"), [("traechtl", "traechtler"), ("knightrider", "knightriders")])
def test_an_unknown_work_names_the_nearest(capsys, tmp_path, typed, nearest):
    assert cli.run(["replicate", typed, "--out", str(tmp_path / "x")]) == 2
    said = capsys.readouterr().err
    assert f"'{nearest}'" in said and said.count("\n") == 1 and not (tmp_path / "x").exists()


def test_the_help_lists_every_work(capsys):
    assert cli.run(["replicate", "--help"]) == 0
    said = capsys.readouterr().out
    assert all(work in said for work in WORKS)


# --- the van


def test_blind_turns_are_as_good_as_the_suite_asks(replicated):
    """Bounds of the task: largest error by edge radius, 5 cm from 25 m after the switch on, calm at 20 m."""
    table = table_of(replicated("traechtler"), "Blind")
    bounds = {"8": 0.70, "10": 0.55, "12": 0.45, "20": 0.25}
    assert len(table) == 24
    for radius, _, policy, largest, after, jump, *_ in table:
        assert float(largest) <= bounds[radius] * (1.0 if policy == "blind" else 0.5)
        assert float(after) <= 0.05
        if radius == "20":
            assert float(jump) < 5.0


# --- the car along a wall


def test_every_controller_is_compared_and_the_redesign_holds_the_wall(replicated):
    rows = table_of(replicated("knightriders"), "Every controller")
    assert len(rows) == 2 * (6 * 3 + 1)
    for _, controller, variant, largest, _, smallest, error, share in rows:
        if controller == "cascade, redesigned":
            assert variant == "si" and float(largest) <= 1.0 and float(error) == 0.0 and float(share) < 5.0
        elif controller == "PI state feedback" and variant == "si":
            assert float(share) > 98.0 and float(smallest) < 0.0 and float(error) > 0.5
        elif controller == "cascade, one sample late" and variant == "si":
            assert float(share) > 90.0


def test_one_sample_makes_the_published_cascade_chatter_and_the_redesign_not(replicated):
    rows = table_of(replicated("knightriders"), "one sample late")
    assert len(rows) == 6
    for cascade, _, pole, share, beyond, error, change in rows:
        if cascade == "cascade, one sample late":
            assert float(pole) > 16.0 and float(share) > 90.0 and float(change) == 44.0
        else:
            assert float(pole) < 1.0 and float(share) < 5.0 and float(beyond) < 0.5
            assert float(error) < 1.0 and float(change) < 0.02


def test_the_cascade_on_the_filter_stays_within_2_cm_and_the_pd_does_not(replicated):
    rows = table_of(replicated("knightriders"), "Steering offset")
    assert len(rows) == 18
    for _, _, controller, largest, mean, _ in rows:
        if controller == "PD as driven":
            assert float(mean) > 10.0
        else:
            assert float(largest) < 2.0 and abs(float(mean)) < 0.5
