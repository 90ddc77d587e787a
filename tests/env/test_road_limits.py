"""Roads within bounds: every absurd number is told in one line, and nothing takes long first."""

import math
import time

import numpy as np
import pytest

from lanekeep_env.roads import Road, RoadFile, read_road
from lanekeep_env.roads.file import FARTHEST, LARGEST_FILE
from lanekeep_env.roads.readers.drawing import MOST_POINTS
from lanekeep_env.roads.readers.table import LONGEST_LINE, MOST_LINES
from lanekeep_env.roads.readers.tracks import MOST_PARTS
from lanekeep_env.roads.road import MOST_SEGMENTS, MOST_TURN

LINE = [f"{10 * k}, {k * k}" for k in range(20)]


def write(path, points):
    np.savetxt(path, points, fmt="%.3f", delimiter=",")
    return path


FAULTS = [
    ([*LINE, "1_000, 2"], ["line 21", "'1_000' is not a number"]),
    ([*LINE, "\u0661\u0662, 2"], ["line 21", "is not a number"]),
    ([*LINE, "200, \uff11"], ["line 21", "is not a number"]),
    ([*LINE, "infinity, 2"], ["line 21", "not finite"]),
    ([*LINE, "9" * 400 + ", 2"], ["line 21", "not finite"]),
    ([*LINE, "9" * 5000 + "x, 2"], ["line 21", "'9999", "...", "is not a number"]),
    ([*LINE, "1e300, 2"], ["line 21", "(1e+300, 2) m", f"{FARTHEST:g}", "are they in m?"]),
    ([f"{10**17 + 16 * k}, 0" for k in range(20)], ["line 20", f"{FARTHEST:g}"]),
    ([*LINE, "1, " * LONGEST_LINE], ["line 21", f"{3 * LONGEST_LINE} characters", f"{LONGEST_LINE}"]),
    ([*LINE, *[""] * (MOST_LINES + 1)], [f"{MOST_LINES + 20} lines", f"allowed are {MOST_LINES}"]),
    ([f"{k}, 0" for k in range(MOST_POINTS + 1)], [f"line {MOST_POINTS + 1}", f"more than {MOST_POINTS} points"]),
    ([f"{200 * k}, 0" for k in range(3000)], ["599800 m long", "allowed are 300000 m", "200 m apart"]),
    ([f"{199 * (k // 2) + 2e-6 * (k % 2):.7f}, 0" for k in range(3000)], ["long", "fewer points"]),
]


@pytest.mark.parametrize(("lines", "words"), FAULTS, ids=range(len(FAULTS)))
def test_absurd_files_are_told_in_one_line(tmp_path, lines, words):
    path = tmp_path / "road.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    begin = time.process_time()
    with pytest.raises(ValueError) as caught:
        read_road(path)
    message = str(caught.value)
    assert time.process_time() - begin < 5.0
    assert "road.csv" in message and message.isprintable() and len(message) < 500
    for word in words:
        assert word in message, message


@pytest.mark.parametrize(
    ("points", "words"),
    [
        ("[]," * MOST_PARTS, [f"allowed are {MOST_PARTS}", "line alone"]),
        ("1," * (MOST_PARTS - 10), ["are not a list of [longitude, latitude]"]),
        (f"[{'9' * 400}, 48],", ["no number of degrees"]),
    ],
)
def test_json_that_would_fill_the_memory_is_told_before(tmp_path, points, words):
    path = tmp_path / "road.geojson"
    path.write_text(f'{{"type": "LineString", "coordinates": [{points.rstrip(",")}]}}')
    begin = time.process_time()
    with pytest.raises(ValueError) as caught:
        read_road(path)
    assert time.process_time() - begin < 5.0
    for word in words:
        assert word in str(caught.value)


def test_large_and_no_files(tmp_path):
    path = tmp_path / "large.csv"
    with path.open("wb") as file:
        file.truncate(LARGEST_FILE + 1)
    with pytest.raises(ValueError, match=f"cannot be read: it has {LARGEST_FILE + 1} bytes, allowed are"):
        RoadFile(str(path))
    with pytest.raises(ValueError, match="cannot be read: it is not an ordinary file"):
        RoadFile(str(tmp_path))


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize(("count", "size"), [(2000, 100.0), (20_000, 10.0), (300, 0.5)])
def test_points_without_order_are_refused_at_once(tmp_path, closed, count, size):
    path = write(tmp_path / "cloud.csv", np.random.default_rng(0).uniform(0.0, size, (count, 2)))
    begin = time.process_time()
    with pytest.raises(ValueError, match="turns by"):
        read_road(path, closed)
    assert time.process_time() - begin < 5.0


@pytest.mark.parametrize("smoothing", [-3.0, math.nan, 1e9])
def test_smoothing_out_of_bounds_is_named(tmp_path, smoothing):
    with pytest.raises(ValueError, match=r"smoothing=.* is not allowed"):
        read_road(write(tmp_path / "road.csv", np.c_[np.arange(0.0, 100.0, 5.0), np.zeros(20)]), smoothing=smoothing)


def test_a_file_that_changes_or_vanishes_is_refused(tmp_path):
    path = tmp_path / "road.csv"
    path.write_text("\n".join(LINE))
    record = RoadFile(str(path))
    assert len(record.build()) == 1
    path.write_text("\n".join(LINE[1:]))
    with pytest.raises(ValueError, match="has changed since this scenario was made"):
        record.build()
    path.unlink()
    with pytest.raises(ValueError, match="No such file"):
        record.build()


def test_segments_that_turn_absurdly_are_named():
    Road("spiral", [10.0, MOST_TURN], [0.0, 1.0], [0.0, 1.0])
    with pytest.raises(ValueError, match=r"'spiral', segment 1: a curvature of 30 1/m on a length of 50 m turns by"):
        Road("spiral", [10.0, 50.0], [0.0, 0.0], [0.0, -30.0])
    with pytest.raises(ValueError, match="curvature that is not a finite number"):
        Road("spiral", [1.0], [1.0], [np.inf])
    circle = Road("circle", [10.0], [0.1], [0.1])
    with pytest.raises(ValueError, match=r"turns by 1e\+11 rad cannot be found"):
        circle.position(1e12)


@pytest.mark.parametrize("longest", [0.0, -1.0, np.nan, 1e-6, 1e-300])
def test_roads_are_not_cut_into_more_pieces_than_fit(longest):
    with pytest.raises(ValueError, match=f"max_length=|allowed are {MOST_SEGMENTS}"):
        Road("straight", [100.0], [0.0], [0.0]).refined(longest)


def test_hidden_is_what_lies_inside_any_stretch():
    """Against the definition, stretch by stretch; stretches overlap, touch and lie in any order."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        road = Road("straight", rng.uniform(1.0, 9.0, 12), np.zeros(12), np.zeros(12))
        ends = np.sort(rng.uniform(-10.0, road.length + 10.0, (rng.integers(1, 9), 2)), axis=1)
        ends[rng.random(ends.shape) < 0.2] = road.stations[5]
        s = rng.uniform(0.0, road.length, 300)
        expected = ~np.array([any(begin < at < end for begin, end in ends) for at in s])
        assert np.array_equal(road.without_marking(ends).is_marked(s), expected)


def test_many_stretches_without_marking_take_moments():
    begins = np.arange(0.0, 1e5, 5.0)
    road = Road("straight", np.full(100_000, 1.0), np.zeros(100_000), np.zeros(100_000))
    begin = time.process_time()
    hidden = road.without_marking(np.column_stack([begins, begins + 2.5]))
    assert time.process_time() - begin < 5.0
    assert hidden.lengths[~hidden.marked].sum() == pytest.approx(2.5 * len(begins))
    with pytest.raises(ValueError, match="not a number"):
        road.without_marking([[np.nan, 1.0]])
