"""Maps of ROS's map_server: exact walls, every fault by name, nothing executed."""

import json
import math
import sys
import time

import numpy as np
import pytest
import shapely
from PIL import Image

from lanekeep_env.walls import MapFile, read_map, world_from
from lanekeep_env.walls.centre_line import found
from lanekeep_env.walls.region import borders

SETTINGS = {
    "image": "map.pgm",
    "resolution": 0.1,
    "origin": [-1.0, -1.0, 0.0],
    "negate": 0,
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
}


def hall(rows=20, columns=30):
    """A free hall with walls of one cell and a pillar: 0 to 255, rows from the top."""
    grey = np.full((rows, columns), 254, np.uint8)
    grey[[0, -1]] = grey[:, [0, -1]] = 0
    grey[3:5, 20:25] = 0
    return grey


def pgm(grey, kind="P5", largest=255, comment=b"# made by hand\n"):
    header = kind.encode() + b"\n" + comment + f"{grey.shape[1]} {grey.shape[0]}\n{largest}\n".encode()
    if kind == "P2":
        return header + b"\n".join(b" ".join(b"%d" % value for value in row) for row in grey.tolist())
    return header + grey.astype(">u2" if largest > 255 else np.uint8).tobytes()


def write(folder, grey=None, data=None, text=None, **changes):
    """Write a map; return the path of its YAML file."""
    settings = {**SETTINGS, **changes}
    (folder / "map.pgm").write_bytes(pgm(hall() if grey is None else grey) if data is None else data)
    path = folder / "map.yaml"
    lines = [f"{key}: {json.dumps(value)}" for key, value in settings.items() if value is not None]
    path.write_text("\n".join(lines) if text is None else text)
    return path


def area(world):
    """Free area inside the walls, m²."""
    polygons = shapely.polygonize(list(shapely.linestrings(world.segments.reshape(-1, 2, 2))))
    start = shapely.Point(world.start[0, :2])
    return next(p.area for p in polygons.geoms if p.contains(start))


def test_walls_are_the_exact_borders_of_cells(tmp_path):
    world = read_map(write(tmp_path))
    # The inside of the outer walls, and the pillar: four walls each.
    assert world.segments.shape == (8, 4) and world.opaque == 8
    assert world.bounds == pytest.approx((-0.9, -0.9, 1.9, 0.9))
    assert area(world) == pytest.approx(2.8 * 1.8 - 0.5 * 0.2)
    pillar = {tuple(np.round(wall, 9)) for wall in world.segments}
    assert (1.0, 0.5, 1.5, 0.5) in pillar and (1.0, 0.7, 1.5, 0.7) in pillar


@pytest.mark.parametrize("kind, largest", [("P5", 255), ("P2", 255), ("P5", 65535), ("P2", 1000)])
def test_all_kinds_of_pgm_give_the_same_world(tmp_path, kind, largest):
    grey = (hall().astype(np.int64) * largest) // 255
    world = read_map(write(tmp_path, data=pgm(grey, kind, largest)))
    assert np.array_equal(world.segments, read_map(write(tmp_path)).segments)


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "P", "1", "I;16"])
def test_png_gives_the_same_world(tmp_path, mode):
    expected = read_map(write(tmp_path)).segments
    picture = Image.fromarray(hall())
    if mode == "I;16":
        picture = Image.fromarray(hall().astype(np.uint16) * 257)
    else:
        picture = picture.convert(mode, dither=Image.Dither.NONE)
    picture.save(tmp_path / "map.png")
    assert np.array_equal(read_map(write(tmp_path, image="map.png")).segments, expected)


def test_negate_yaw_and_absolute_paths(tmp_path):
    upright = read_map(write(tmp_path))
    path = write(tmp_path, data=pgm(255 - hall()), negate=1, image=str(tmp_path / "map.pgm"))
    assert np.array_equal(read_map(path).segments, upright.segments)
    turned = read_map(write(tmp_path, origin=[1.0, -1.0, np.pi / 2]))
    x0, y0, x1, y1 = upright.segments.T
    assert np.allclose(turned.segments, np.column_stack([-y0, x0, -y1, x1]))


def test_unknown_cells_are_open_unless_they_are_said_to_be_walls(tmp_path):
    grey = hall()
    grey[0, 5] = 205
    with pytest.raises(ValueError, match=r"the walls are open: .* at cell 5, 19 from the lower left"):
        read_map(write(tmp_path, grey))
    assert len(read_map(write(tmp_path, grey), unknown_is_wall=True).segments) == 8


def test_walls_out_of_reach_are_left_out(tmp_path):
    grey = hall(20, 60)
    grey[:, 30] = 0
    grey[10, 40] = 0
    world = read_map(write(tmp_path, grey))
    assert world.bounds[2] == pytest.approx(2.0) and len(world.segments) == 8


def test_borders_of_random_maps_are_those_of_the_cells():
    rng = np.random.default_rng(0)
    for _ in range(30):
        free = np.zeros((9, 12), bool)
        free[1:-1, 1:-1] = rng.random((7, 10)) < 0.6
        walls = borders(free)
        cells = shapely.union_all([shapely.box(c, r, c + 1, r + 1) for r, c in np.argwhere(free)])
        lines = shapely.union_all(shapely.linestrings(walls.reshape(-1, 2, 2).astype(float)))
        assert lines.equals(cells.boundary) and lines.length == np.abs(walls[:, 2:] - walls[:, :2]).sum()
        ends = {(w[0] == w[2], *w[:2]) for w in walls.tolist()} & {(w[0] == w[2], *w[2:]) for w in walls.tolist()}
        assert not ends, "two walls in one line that touch were not merged"


FAULTS = [
    ({"image": None}, "lacks image; expected image, resolution"),
    ({"image": "no.pgm"}, r"image '.*no.pgm' cannot be read: No such file"),
    ({"image": 3}, "image=3 must be the path"),
    ({"resolution": 0}, "resolution=0 is not allowed: it must be a finite number >= 0.0001 .* m a cell"),
    ({"resolution": -0.05}, "resolution=-0.05 is not allowed"),
    ({"resolution": "fine"}, "resolution='fine' is not allowed"),
    ({"origin": [0, 0]}, r"origin=\[0, 0\] is not allowed: it must be \[x in m, y in m, yaw in rad\]"),
    ({"origin": [0, "a", 0]}, "origin y='a' is not allowed"),
    ({"negate": 2}, "negate=2 is not allowed: it must be 0 or 1"),
    ({"negate": [1]}, r"negate=\[1\] is not allowed"),
    ({"occupied_thresh": 1.5}, "occupied_thresh=1.5 is not allowed"),
    ({"free_thresh": -1}, "free_thresh=-1 is not allowed"),
    ({"free_thresh": 0.7}, "free_thresh=0.7 must be below occupied_thresh=0.65"),
    ({"mode": "raw"}, "the start lies in unknown cells .cell 10, 10; mode raw: above 100"),
    ({"mode": "scaled"}, "mode='scaled' is unknown .did you mean 'scale'.*; allowed: trinary, scale, raw"),
    ({"mode": 3}, "mode=3 is unknown; allowed: trinary, scale, raw"),
    ({"data": pgm(hall())[:-1]}, "is cut off: 599 bytes of data, 30 x 20 cells need 600 bytes"),
    ({"data": pgm(hall(), "P2")[:-2]}, "is cut off: 599 values, 30 x 20 cells need 600"),
    ({"data": pgm(hall(), "P2")[:-1] + b"x"}, "'x' is not a whole number from 0 to 255"),
    ({"data": pgm(hall(), "P2", 200)}, "a value of 254 is above the largest value 200"),
    ({"data": b"P5\n0 20\n255\n"}, "is 0 x 20 cells; allowed are 1 to"),
    ({"data": b"P5\n99999 99999\n255\n"}, "is 99999 x 99999 cells; allowed are"),
    ({"data": b"P5\n30 20\n70000\n"}, "the largest value 70000 is not allowed"),
    ({"data": b"P5\nwide high\n"}, "the PGM header is not 'P2' or 'P5', width"),
    ({"data": b"GIF89a"}, "is neither PGM"),
    ({"data": b""}, "is neither PGM"),
    ({"data": b"\x89PNG\r\n\x1a\n and so on"}, "is not a whole PNG picture"),
    ({"text": "image: [unclosed"}, "is not YAML: "),
    ({"text": "just words"}, "holds no fields"),
    ({"text": ""}, "holds no fields"),
    ({"text": "a: &a [1]\n"}, "line 1: anchors, aliases, merge keys and tags are not allowed"),
    ({"text": "image: x\nresolution: *a\n"}, "line 2: anchors, aliases, merge keys and tags are not allowed"),
    ({"text": "image: x\n<<: {negate: 0}\n"}, "line 2: anchors, aliases, merge keys and tags are not allowed"),
    ({"text": "image: !!int ''\n"}, "line 1: anchors, aliases, merge keys and tags are not allowed"),
    ({"text": "image: !!bool foo\n"}, "line 1: anchors, aliases, merge keys and tags are not allowed"),
    ({"text": "image: !!timestamp foo\n"}, "line 1: anchors, aliases, merge keys and tags are not allowed"),
    ({"text": "image: 2001-13-45\n"}, "it lacks resolution"),  # no date, no number: a text
    ({"text": "image: 0x_\n"}, "it lacks resolution"),  # no date, no number: a text
    ({"text": "image: " + "1:" * 2000 + "1.5\n"}, "it lacks resolution"),  # no date, no number: a text
    ({"text": "image: " + "9" * 4000 + "\n"}, "lacks resolution"),
    ({"text": "image: " + "9" * 4097 + "\n"}, "line 1: it holds more than a map's settings"),
    ({"text": "".join(f"f{k}: 1\n" for k in range(1000))}, "it holds more than a map's settings"),
    ({"image": "\ud800"}, "cannot be read"),
    ({"image": "x" * 4000}, "image '.*xxx.* cannot be read: File name too long"),
    ({"image": "/dev/zero"}, "image '/dev/zero' cannot be read: it is not an ordinary file"),
    ({"image": "."}, "cannot be read: it is not an ordinary file"),
    ({"resolution": 1e-9}, "resolution='?1e-09'? is not allowed"),
    ({"resolution": 10**400}, "resolution=<an integer of 400 digits> is not allowed"),
    ({"data": b"P2 30 20 255 " + b"9" * 400}, "a value of 9223372036854775807 is above the largest value 255"),
    ({"data": b"P2 30 20 255 " + b" " * 100}, "is cut off: 0 values"),
    ({"data": b"P2 30 20 255 12 -3"}, "'-3' is not a whole number from 0 to 255"),
    ({"data": b"P2 30 20 255 12 " + b"x" * 400}, r"'xxx.*\.\.\.xxx.* is not a whole number from 0 to 255"),
    ({"data": b"P5" + b" " * 100_000 + b"30 20 255 "}, "the PGM header is not"),
    ({"text": "#" * 200_000}, "has 200000 bytes, allowed are 100000"),
    ({"text": "[" * 50_000}, "line 1: it holds more than a map's settings"),
    ({"grey": np.full((20, 30), 254, np.uint8)}, "the walls are open"),
    ({"grey": np.zeros((20, 30), np.uint8)}, r"the start lies inside a wall \(cell 10, 10 .*; give another start"),
    (
        {"origin": [5.0, 0.0, 0.0]},
        r"the start \(0, 0\) m is outside the map of 30 x 20 cells of 0.1 m at origin \(5, 0",
    ),
    ({"origin": [-0.2, -1.0, 0.0]}, "0.100 m from a wall; allowed are >= 0.2 m"),
]


@pytest.mark.parametrize("changes, words", FAULTS, ids=range(len(FAULTS)))
def test_faults_are_named(tmp_path, changes, words):
    path = write(tmp_path, **changes)
    with pytest.raises(ValueError, match=words) as error:
        read_map(path)
    message = str(error.value)
    assert message.startswith(f"map {str(path)!r}") and message.isprintable() and len(message) < 600


def test_a_png_is_refused_by_its_size_before_it_is_unpacked(tmp_path):
    """A picture of 10,000 x 10,000 cells fits in 100 KB; unpacked it has 100 MB."""
    Image.new("L", (10_000, 10_000)).save(tmp_path / "map.png")
    begin = time.process_time()
    with pytest.raises(ValueError, match=r"map.png' is 10000 x 10000 cells; allowed are 1 to"):
        read_map(write(tmp_path, image="map.png"))
    assert time.process_time() - begin < 0.2
    Image.fromarray(hall()).save(tmp_path / "map.png")
    whole = (tmp_path / "map.png").read_bytes()
    for end in range(8, len(whole) // 2, 3):
        (tmp_path / "map.png").write_bytes(whole[:end])
        with pytest.raises(ValueError, match=r"map.png' is not a whole PNG picture"):
            read_map(write(tmp_path, image="map.png"))


def test_plain_pgm_is_read_whatever_its_blanks_and_blocks(tmp_path):
    """A file of several blocks, with all kinds of blanks, comments, leading zeros and something behind the numbers."""
    expected = read_map(write(tmp_path)).segments
    blanks = [b" ", b"\n", b"\r\n", b"\t", b" \x0b", b"\x0c ", b"\n# 1 2 3 x\n", b" " * 30_000]
    rng = np.random.default_rng(0)
    words = [b"%0*d" % (int(rng.integers(1, 6)), value) + blanks[rng.integers(8)] for value in hall().ravel()]
    data = b"P2\n30 20\n255\n" + b"".join(words) + b" what -1 follows"
    assert len(data) > 2 << 20
    assert np.array_equal(read_map(write(tmp_path, data=data)).segments, expected)


def test_missing_binary_and_starts_that_are_no_numbers(tmp_path):
    with pytest.raises(ValueError, match="cannot be read: No such file"):
        read_map(tmp_path / "none.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="is not a text file"):
        read_map(tmp_path / "binary.yaml")
    with pytest.raises(ValueError, match="start heading=nan is not allowed"):
        read_map(write(tmp_path), (0.0, 0.0, float("nan")))


def test_nothing_in_the_file_is_executed(tmp_path):
    text = f"image: !!python/object/apply:os.mkdir ['{tmp_path / 'made'}']\n"
    with pytest.raises(ValueError, match="line 1: anchors, aliases, merge keys and tags are not allowed"):
        read_map(write(tmp_path, text=text))
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("module, image, words", [("yaml", "map.pgm", "PyYAML"), ("PIL", "map.png", "Pillow")])
def test_missing_packages_name_the_extra(tmp_path, monkeypatch, module, image, words):
    Image.fromarray(hall()).save(tmp_path / "map.png")
    path = write(tmp_path, image=image)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ValueError, match=rf"{words}: pip install 'lanekeep\[maps\]'"):
        read_map(path)


def test_map_records_stand_for_the_files_content(tmp_path):
    path = write(tmp_path)
    record = MapFile(str(path))
    assert record == world_from(str(path)) == world_from(path) == world_from(json.loads(json.dumps(record.to_dict())))
    assert np.array_equal(record.build()[0].segments, read_map(path).segments)
    assert MapFile(str(path), heading=1.0).fingerprint() != record.fingerprint()
    grey = hall()
    grey[5, 5] = 0
    write(tmp_path, grey)
    with pytest.raises(ValueError, match="has changed since this scenario was made"):
        record.build()
    assert MapFile(str(path)).fingerprint() != record.fingerprint()
    (tmp_path / "map.pgm").unlink()
    with pytest.raises(ValueError, match=r"map.pgm' cannot be read"):
        MapFile(str(path))


@pytest.mark.parametrize(("radius", "half"), [(11.5, 10.0), (16.0, 10.0), (40.0, 12.0)])
def test_the_line_found_is_the_middle_also_round_hairpins(radius, half):
    """A long stadium, drawn in cells; where its ends are as tight as the corridor is wide, few points swing about."""
    length = 3000.0
    x, y = np.meshgrid(np.arange(length + 2.0 * (radius + half) + 6.0), np.arange(2.0 * (radius + half) + 6.0))
    x, y = x - radius - half - 2.5, y - radius - half - 2.5
    off = np.hypot(x - np.clip(x, 0.0, length), y) - radius
    line = found(borders(np.abs(off) < half))
    a, b = line.T
    middle = np.hypot(a - radius - half - 3.0 - np.clip(a - radius - half - 3.0, 0.0, length), b - radius - half - 3.0)
    assert np.abs(middle - radius).max() < 1.0
    assert np.hypot(*(np.roll(line, -1, axis=0) - line).T).sum() == pytest.approx(2 * (length + math.pi * radius), 3e-3)
