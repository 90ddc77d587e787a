"""CommonRoad: chains of lanelets, their kinks, and straights given by their ends."""

import itertools

import numpy as np
import pytest

from lanekeep_env.roads import Road, read_road


def _lanelet(number, points, after):
    sides = [points + 1.5 * np.array([0, 1]), points - 1.5 * np.array([0, 1])]
    bounds = "".join(
        f"<{side}Bound>" + "".join(f"<point><x>{x}</x><y>{y}</y></point>" for x, y in line) + f"</{side}Bound>"
        for side, line in zip(("left", "right"), sides, strict=True)
    )
    return f'<lanelet id="{number}">{bounds}' + "".join(f'<successor ref="{one}"/>' for one in after) + "</lanelet>"


def test_commonroad_lanelets_are_chained(tmp_path):
    line = np.c_[np.arange(0.0, 101.0, 5.0), np.zeros(21)]
    text = (
        _lanelet(3, line + np.array([100, 0]), [1])
        + _lanelet(1, line + np.array([200, 0]), [3])
        + _lanelet(2, line, [3])
    )
    path = tmp_path / "scenario.xml"
    path.write_text(f'<commonRoad version="2020a">{text}</commonRoad>')
    road = read_road(path)
    assert road.length == pytest.approx(300.0) and not road.closed
    assert "of 3 lanelets: 2, 3, 1 (track= takes others)" in road.assumed
    assert road.beside[:, 1:3].min() == pytest.approx(1.5)
    assert read_road(path, track="3, 1").length == pytest.approx(200.0)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.filterwarnings("ignore:road .*smoothing= says")
def test_lanelets_that_meet_with_kinks_are_missed_by_no_more_than_a_tenth_of_their_width(tmp_path, seed):
    """Each lanelet is shifted and drawn coarsely; the truth is one smooth road."""
    rng = np.random.default_rng(seed)
    bends = rng.uniform(-0.02, 0.02, 9)
    truth = Road("truth", np.full(8, 40.0), bends[:-1], bends[1:])
    borders = np.sort(np.concatenate([[0.0, truth.length], rng.uniform(5.0, truth.length - 5.0, 6)]))
    text = ""
    for k, (begin, end) in enumerate(itertools.pairwise(borders)):
        along = np.linspace(begin, end, max(2, round((end - begin) / rng.uniform(3.0, 8.0))))
        text += _lanelet(k, truth.position(along, rng.uniform(-0.04, 0.04)).round(2), [k + 1])
    path = tmp_path / "kinks.xml"
    path.write_text(f"<commonRoad>{text}</commonRoad>")
    road = read_road(path)
    along = np.linspace(0.0, road.length, 500)
    off = np.abs(road.position(along)[:, None] - truth.position(np.linspace(0.0, truth.length, 4000))[None])
    assert np.hypot(*off.T).min(axis=0).max() < 0.04 + 0.3 and road.fit_error <= 0.3
    assert road.length == pytest.approx(truth.length, abs=0.5)


def test_lanelets_of_two_points_are_straights_and_corners_are_no_road(tmp_path):
    path = tmp_path / "straight.xml"
    ends = np.array([[0.0, 0.0], [1500.0, 0.0]])
    path.write_text(
        f"<commonRoad>{_lanelet(1, ends, [2])}{_lanelet(2, ends + np.array([1500.0, 0.0]), [])}</commonRoad>"
    )
    road = read_road(path)
    assert road.length == pytest.approx(3000.0) and road.peak_curvature < 1e-9 and road.fit_error < 1e-6
    corner = _lanelet(2, np.array([[1500.0, 0.0], [1500.0, 40.0]]), [])
    path.write_text(f"<commonRoad>{_lanelet(1, ends, [2])}{corner}</commonRoad>")
    with pytest.raises(ValueError, match="points"):
        read_road(path)
