"""Maps as map_server and nav2 write them: numbers, modes, alpha; and circuits on maps."""

import gymnasium as gym
import numpy as np
import pytest
import shapely
from PIL import Image

from lanekeep_env.walls import MapFile, read_map, world_from

LINES = {"image": "map.png", "resolution": "5e-2", "origin": "[-1.0, -1e+00, 0.0]", "negate": "0"}
LINES |= {"occupied_thresh": "0.65", "free_thresh": "1.96e-1"}


def hall():
    grey = np.full((60, 80), 254, np.uint8)
    grey[[0, -1]] = grey[:, [0, -1]] = 0
    grey[50:55, 10:15] = 0
    return grey


def write(folder, picture, **changes):
    picture.save(folder / "map.png")
    path = folder / "map.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in {**LINES, **changes}.items()))
    return path


def test_numbers_with_exponents(tmp_path):
    """YAML 1.2 takes 5e-2 and 1e+03 for numbers, and so do map_server and nav2."""
    world = read_map(write(tmp_path, Image.fromarray(hall())))
    assert world.bounds == pytest.approx((-0.95, -0.95, 2.95, 1.95))
    with pytest.raises(ValueError, match=r"origin x=1000000000.0 is not allowed"):
        read_map(write(tmp_path, Image.fromarray(hall()), origin="[1e+09, 0, 0]"))


@pytest.mark.parametrize("mode", ["trinary", "Trinary", "scale", "SCALE"])
def test_modes_in_any_case_give_the_same_walls(tmp_path, mode):
    expected = read_map(write(tmp_path, Image.fromarray(hall()))).segments
    assert np.array_equal(read_map(write(tmp_path, Image.fromarray(hall()), mode=mode)).segments, expected)


def test_raw_is_occupancy_in_percent(tmp_path):
    grey = np.where(hall() > 100, 0, 100).astype(np.uint8)
    grey[5:9, 50:60] = 255  # unknown
    grey[20:24, 50:60] = 60  # occupied, but not above 65 %
    path = write(tmp_path, Image.fromarray(grey), mode="raw")
    assert np.array_equal(read_map(path).segments, read_map(write(tmp_path, Image.fromarray(hall()))).segments)
    path = write(tmp_path, Image.fromarray(grey), mode="raw")
    assert len(read_map(path, unknown_is_wall=True).segments) == len(read_map(path).segments) + 4
    path = write(tmp_path, Image.fromarray(grey), mode="raw", occupied_thresh="0.5")
    assert len(read_map(path).segments) == len(read_map(path, unknown_is_wall=True).segments) - 4
    with pytest.raises(ValueError, match="the start lies in unknown cells"):
        read_map(path, start=(-1 + 0.05 * 55, -1 + 0.05 * 53, 0.0))


@pytest.mark.parametrize("alpha, free", [(255, False), (0, False)])
def test_alpha_is_a_fourth_colour_in_trinary_alone(tmp_path, alpha, free):
    """A grey of 128 is (255 - 128) / 255 = 0.5 occupied; with alpha 255 averaged in 0.37, with alpha 0 0.62."""
    grey = np.stack([hall()] * 3 + [np.full(hall().shape, 255, np.uint8)], axis=2)
    grey[20:24, 50:60] = (128, 128, 128, alpha)
    picture = Image.fromarray(grey, "RGBA")
    plain = len(read_map(write(tmp_path, Image.fromarray(hall()))).segments)
    share = (3 * 127 + (255 - alpha)) / 4 / 255
    for mode, occupancy in (("trinary", share), ("scale", 127 / 255)):
        for threshold, wall in ((occupancy - 0.01, 4), (occupancy + 0.01, 0)):
            path = write(tmp_path, picture, mode=mode, occupied_thresh=f"{threshold:.4f}")
            assert len(read_map(path).segments) == plain + wall, (mode, threshold)


def ring(scale=20):
    """A circuit around a block, 8 x 6 m with 1 m of corridor, and its origin in the middle of the lower side."""
    grey = np.zeros((6 * scale + 4, 8 * scale + 4), np.uint8)
    grey[2:-2, 2:-2] = 254
    grey[2 + scale : -2 - scale, 2 + scale : -2 - scale] = 0
    return grey


def test_the_middle_of_a_circuit_is_found(tmp_path):
    path = write(tmp_path, Image.fromarray(ring()), origin="[-4.0, -0.6, 0]")
    (world,) = MapFile(str(path), centre_line="found").build()
    assert world.closed and world.length == pytest.approx(2 * (7 + 5), rel=0.06)  # it cuts corners a little
    side = world.centre_line[(np.abs(world.centre_line[:, 0]) < 2.0) & (world.centre_line[:, 1] < 1.0)]
    assert np.abs(side[:, 1]).max() < 0.05  # in the middle of the lower side, whose walls are at -0.5 and 0.5
    x, y, heading = world.start[0]
    assert abs(x) < 0.05 and abs(y) < 0.05 and abs(heading) < 0.05  # anticlockwise
    with pytest.raises(ValueError, match="the map is no circuit"):
        MapFile(str(write(tmp_path, Image.fromarray(hall()))), centre_line="found").build()


def test_centre_lines_from_files_and_lists(tmp_path):
    path = write(tmp_path, Image.fromarray(ring()), origin="[-4.0, -0.6, 0]")
    middle = shapely.box(-2.4, 1.0, 2.6, 4.0).buffer(1.0, quad_segs=100).exterior  # its corners are round
    line = shapely.get_coordinates(middle.interpolate(np.linspace(0.0, 1.0, 200, endpoint=False), normalized=True))
    line = line if middle.is_ccw else line[::-1]
    np.savetxt(tmp_path / "line.csv", line[::-1], delimiter=",")
    (clockwise,) = world_from({"map": str(path), "centre_line": str(tmp_path / "line.csv")}).build()
    assert abs(clockwise.start[0, 2]) == pytest.approx(np.pi, abs=0.05)
    record = world_from({"map": path, "centre_line": line.tolist()})
    assert record.build()[0].length == pytest.approx(clockwise.length, rel=1e-3)
    assert world_from(record.to_dict()) == record
    prints = {
        record.fingerprint(),
        MapFile(str(path)).fingerprint(),
        MapFile(str(path), centre_line="found").fingerprint(),
    }
    assert len(prints) == 3 and "centre_line" not in MapFile(str(path)).to_dict()
    with pytest.raises(ValueError, match=r"world.centre_line=\[\[0, 0\]\] is not allowed"):
        world_from({"map": path, "centre_line": [[0, 0]]})


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_a_centre_line_behind_walls_is_refused(tmp_path, turn):
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    path = write(tmp_path, Image.fromarray(ring()), origin=f"[1.0, 2.0, {turn}]")
    # The corridor's middle is 0.6 m from the edges of the picture, which is 8.2 x 6.2 m; the map's frame is turned.
    corners = np.array([[0.6, 0.6], [7.6, 0.6], [7.6, 5.6], [0.6, 5.6]])
    line = np.array([a + (b - a) * t for a, b in zip(corners, np.roll(corners, -1, 0), strict=True) for t in (0, 0.5)])

    def build(points):
        points = points @ rotation.T + (1.0, 2.0)
        x, y = points[0]
        return MapFile(str(path), x, y, centre_line=points.tolist()).build()[0]

    assert build(line).length == pytest.approx(24.0)
    # From corner to corner and back, the block's sides are met at 0.5 m of 5 m before and after it.
    across = np.linspace(corners[0], corners[2], 9)
    half = np.vstack([np.linspace(*pair, 5) for pair in (corners[:2], corners[1:3])])  # 7 m, 5 m, the diagonal back
    back = float(np.hypot(7.0, 5.0))
    for wrong, share in ((across, 0.8), (half, 0.8 * back / (12.0 + back)), (line * (3.0, 1.0), None)):
        with pytest.raises(ValueError, match="of the centre line lies in or behind walls, first at") as caught:
            build(wrong)
        told = float(str(caught.value).partition("% of")[0].rpartition(" ")[2])
        assert share is None or told == pytest.approx(100.0 * share, abs=1.0)


def test_circuit_drives_a_map(tmp_path):
    path = write(tmp_path, Image.fromarray(ring()), origin="[-4.0, -0.6, 0]")
    env = gym.make("lanekeep/Circuit-v0", world=str(path), episode_steps="lap", observation="full")
    scenario = env.unwrapped.scenario
    (world,) = scenario.world.build()
    assert scenario.episode_steps == pytest.approx(world.length / (0.25 * 2.0) / 0.045, abs=1.0)
    env.reset(seed=0)
    for _ in range(20):
        observation, *_ = env.step(np.array([0.0, 0.5], np.float32))
    assert np.isfinite(observation).all()
    assert type(scenario).from_keywords(**scenario.to_dict()).hash == scenario.hash
