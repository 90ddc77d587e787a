"""Centre-line files: fits of known curves, the real tracks, crossings, and every kind of bad file."""

import math
from pathlib import Path

import numpy as np
import pytest

from lanekeep_env.roads import Road, RoadFile, SineRoad, read_road, road_from

TRACKS = Path(__file__).parents[3] / "shared" / "data" / "tracks"


def write(path, points, widths=None, header="# x_m,y_m"):
    rows = points if widths is None else np.column_stack([points, widths])
    path.write_text(header + "\n" + "\n".join(",".join(f"{v:.6f}" for v in row) for row in rows) + "\n")
    return path


def closure(road):
    turns = (road.headings[-1] - road.headings[0]) / (2 * math.pi)
    return np.hypot(*(road.points[-1] - road.points[0])), turns


def distance_to_line(points, line):
    """Distance of points from a dense polyline, by brute force: independent of the road's own projection."""
    a, b = line[:-1], line[1:]
    along = b - a
    worst = np.empty(len(points))
    for i, p in enumerate(points):
        t = np.clip(((p - a) * along).sum(1) / (along**2).sum(1), 0, 1)
        worst[i] = np.hypot(*(a + t[:, None] * along - p).T).min()
    return worst


@pytest.mark.parametrize("name", ["Hockenheim", "Spielberg"])
def test_real_tracks(name):
    path = TRACKS / f"{name}.csv"
    if not path.exists():
        pytest.skip("the tracks are not part of the project")
    road = read_road(path)
    assert road.closed
    gap, turns = closure(road)
    assert gap < 1e-6 and turns == pytest.approx(-1.0, abs=1e-12)
    given = np.loadtxt(path, delimiter=",")[:, :2]
    apart = distance_to_line(given, road.position(np.arange(0.0, road.length + 0.2, 0.2)))
    assert apart.max() <= 0.1 and road.fit_error == pytest.approx(apart.max(), abs=2e-3)


def test_circle_file(tmp_path):
    angle = np.arange(0, 2 * math.pi, 4 / 80)
    road = read_road(write(tmp_path / "circle.csv", 80 * np.column_stack([np.cos(angle), np.sin(angle)])))
    gap, turns = closure(road)
    assert road.closed and gap < 1e-6 and turns == pytest.approx(1.0, abs=1e-12)
    assert road.fit_error < 0.05
    assert road.length == pytest.approx(2 * math.pi * 80, rel=1e-3)
    np.testing.assert_allclose(road.curvature(np.linspace(0, road.length, 300)), 1 / 80, rtol=0.05)


def test_crossing_figure_eight(tmp_path):
    """A lemniscate crosses itself and turns by nothing in total."""
    t = np.linspace(0, 2 * math.pi, 301)[:-1]
    points = 300 * np.column_stack([np.sin(t), np.sin(t) * np.cos(t)])
    road = read_road(write(tmp_path / "eight.csv", points, np.full((300, 2), 4.0)))
    gap, turns = closure(road)
    assert road.closed and gap < 1e-6 and turns == pytest.approx(0.0, abs=1e-12)
    assert road.fit_error < 0.1
    middle = road.position(road.length / 2)
    assert np.hypot(*(middle - road.position(0.0))) < 0.1


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_open_clothoid_file(tmp_path, noise):
    truth = Road("clothoid", [100.0, 200.0, 150.0], [0.0, 0.0, 0.01], [0.0, 0.01, 0.01], origin=(20.0, 5.0, 2.0))
    points = truth.position(np.arange(0, 450.1, 5.0)) + noise * np.random.default_rng(1).normal(size=(91, 2))
    road = read_road(write(tmp_path / "open.csv", points))
    assert not road.closed and road.fit_error < 0.06
    assert road.length == pytest.approx(450.0, abs=0.1)
    s = np.linspace(10, 440, 200)
    assert np.abs(road.curvature(s) - truth.curvature(s)).max() < (5e-4 if noise == 0 else 1.5e-3)
    assert np.hypot(*(road.position(s) - truth.position(s)).T).max() < 0.15


def test_formats_and_closed_flag(tmp_path):
    (truth,) = SineRoad(0.01, 400.0, 800.0).build()
    points = truth.position(np.arange(0.0, 800.0, 8.0))
    comma = read_road(write(tmp_path / "a.csv", points))
    spaces = tmp_path / "b.csv"
    spaces.write_text("x y\n" + "\n".join(f"  {x:.6f}\t{y:.6f}" for x, y in points))
    semicolon = tmp_path / "c.csv"
    semicolon.write_text("\n".join(f"{x:.6f};{y:.6f};3;3" for x, y in points) + "\n\n# the end\n")
    for other in (spaces, semicolon):
        np.testing.assert_array_equal(read_road(other).lengths, comma.lengths)
    assert not comma.closed
    ring = np.array([[100 * math.cos(a), 60 * math.sin(a)] for a in np.linspace(0, 6.2, 120)])
    assert read_road(write(tmp_path / "d.csv", ring)).closed
    assert not read_road(tmp_path / "d.csv", closed=False).closed


def test_the_fingerprint_is_the_content(tmp_path):
    first, second = tmp_path / "a.csv", tmp_path / "b.csv"
    for path in (first, second):
        path.write_text("1,2\n")
    assert RoadFile(str(first)).fingerprint() == RoadFile(str(second)).fingerprint()
    second.write_text("1,3\n")
    assert RoadFile(str(first)).fingerprint() != RoadFile(str(second)).fingerprint()
    assert road_from(str(first)) == RoadFile(str(first))


LINE = [f"{10 * k}, {k * k}" for k in range(20)]


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([], ["empty"]),
        (["# only a comment"], ["holds no line of numbers"]),
        (LINE[:5], ["5 points", "at least 8"]),
        ([*LINE[:9], "90, abc", *LINE[9:]], ["line 10", "'abc'", "not a number"]),
        ([*LINE[:9], *[LINE[8]] * 30], ["most points are the same", "must differ"]),
        ([*LINE[:9], "1, 2, 3", *LINE[9:]], ["line 10", "3 columns", "2"]),
        ([*LINE[:9], "nan, 2", *LINE[9:]], ["line 10", "not finite"]),
        ([*LINE[:9], "1e6, 2", *LINE[9:]], ["line 10", "200 m"]),
        ([f"{x}, -3, 2" for x in LINE], ["line 1", "width", ">= 0"]),
        ([f"{0.1 * k}, 0" for k in range(20)], ["long", "at least 3 m", "x_km"]),
        ([f"{10 * k}, {30 * (k % 2)}" for k in range(30)], ["misses a point", "0.1 m", "smoothing="]),
        ([f"{10 * k}, {k % 2}" for k in range(30)], ["misses a point", "scatter by about", "smoothing="]),
    ],
)
def test_bad_files_are_named_in_one_line(tmp_path, lines, words):
    path = tmp_path / "road.csv"
    path.write_text("\n".join(lines))
    with pytest.raises(ValueError) as caught:
        read_road(path)
    message = str(caught.value)
    assert "road.csv" in message and "\n" not in message
    for word in words:
        assert word in message, message


def test_missing_and_binary_files(tmp_path):
    with pytest.raises(ValueError, match="No such file"):
        read_road(tmp_path / "nowhere.csv")
    (tmp_path / "b.csv").write_bytes(bytes(range(128, 256)) * 10)
    with pytest.raises(ValueError, match="not a text file"):
        read_road(tmp_path / "b.csv")
