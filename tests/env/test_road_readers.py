"""Road files as others write them: every form of a known line is that line, or refused with a way out."""

import json
import math
import time
from pathlib import Path

import numpy as np
import pytest

from lanekeep_env.roads import Road, RoadFile, read_road, road_from
from lanekeep_env.roads.readers.geodetic import projected

TRUTH = Road(
    "truth", [60.0, 80.0, 100.0, 60.0], [0, 0, 0.01, -0.005], [0, 0.01, 0.01, -0.005], origin=(300.0, 50.0, 0.5)
)
POINTS = TRUTH.position(np.arange(0.0, 300.1, 4.0))


def lines(columns, delimiter=",", decimal=".", header=(), digits=6):
    rows = [delimiter.join(f"{value:.{digits}f}".replace(".", decimal) for value in row) for row in columns]
    return "\n".join([*header, *rows]) + "\n"


X, Y = POINTS.T
S = np.arange(len(X)) * 4.0
Z = np.zeros(len(X))
HEADING, BEND = TRUTH.heading(S), TRUTH.curvature(S)
KM = POINTS / 1000
TABLES = {
    "plain": lines(POINTS),
    "semicolons": lines(POINTS, ";"),
    "decimal commas": lines(POINTS, ";", ","),
    "decimal commas, tabs": lines(POINTS, "\t", ","),
    "decimal commas, blanks": lines(POINTS, "  ", ","),
    "decimal commas in quotes": "\n".join(f'"{x:.5f}","{y:.5f}"'.replace(".", ",") for x, y in POINTS),
    "names": lines(POINTS, header=["x,y"]),
    "names in a comment": lines(POINTS, header=["# made by hand", "# x_m, y_m"]),
    "slashes": lines(POINTS, header=["// track", "x,y"]),
    "units below": lines(POINTS, header=["x,y", "m,m"]),
    "units in brackets": lines(np.c_[Y, X], ";", header=["y [m]; x [m]"]),
    "y first": lines(np.c_[Y, X], header=["y,x"]),
    "kilometres": lines(KM, header=["x_km,y_km"], digits=9),
    "millimetres": lines(1000 * POINTS, header=["x (mm),y (mm)"]),
    "heights": lines(np.c_[X, Y, Z], header=["x,y,z"]),
    "heights between": lines(np.c_[X, Z, Y], header=["x_m,height,y_m"]),
    "arc length first": lines(np.c_[S, X, Y], header=["s,x,y"]),
    "TUM raceline": lines(
        np.c_[S, X, Y, HEADING, BEND, Z + 8, Z], "; ", header=["# s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2"]
    ),
    "trailing delimiters": lines(np.c_[X, Y]).replace("\n", ",\n"),
    "carriage returns": lines(POINTS).replace("\n", "\r\n"),
}


def same_line(road, atol=2e-3):
    s = np.linspace(2.0, 298.0, 150)
    for _ in range(5):
        heading, offset = road.heading(s), TRUTH.position(np.linspace(2.0, 298.0, 150)) - road.position(s)
        s = s + np.cos(heading) * offset[:, 0] + np.sin(heading) * offset[:, 1]
    np.testing.assert_allclose(road.position(s), TRUTH.position(np.linspace(2.0, 298.0, 150)), atol=atol)


@pytest.mark.parametrize("kind", TABLES)
def test_tables(tmp_path, kind):
    path = tmp_path / "road.csv"
    path.write_text(TABLES[kind])
    road = read_road(path)
    same_line(road)
    assert any("columns" in phrase for phrase in road.assumed)


@pytest.mark.parametrize(
    ("names", "psi", "kappa", "told", "warned"),
    [
        ("psi_rad,kappa_radpm", HEADING, BEND, "", ""),
        ("psi_rad,kappa_radpm", (HEADING + 9.0) % 6.283185307 - 9.0, BEND, "", ""),
        ("heading_deg,kappa", np.degrees(HEADING), BEND, "", ""),
        ("psi_rad,kappa", HEADING - np.pi / 2, BEND, "heading psi is to the left of the y axis", ""),
        ("psi,kappa", np.pi / 2 - HEADING, BEND, "", "psi is to the right of the y axis"),
        ("psi_rad,kappa", np.degrees(HEADING), BEND, "", "psi is degrees, to the left of the x axis"),
        ("psi,kappa", HEADING + 0.5, BEND, "", "left of -29 deg from the x axis"),
        ("psi,kappa", S, BEND, "", "psi does not follow x, y"),
        ("psi,kappa", HEADING, Z + 0.1, "", "kappa does not follow x, y"),
    ],
)
def test_heading_and_curvature_beside_points_are_compared_with_them(tmp_path, recwarn, names, psi, kappa, told, warned):
    """They are not needed, but where they say something else a unit or an axis may be another one."""
    path = tmp_path / "road.csv"
    path.write_text(lines(np.c_[X, Y, psi, kappa], header=[f"x_m,y_m,{names}"], digits=9))
    road = read_road(path)
    same_line(road)
    found = [phrase for phrase in road.assumed if phrase.startswith(("the heading", "the curvature"))]
    assert len(found) == bool(told or warned) and all((told or warned) in phrase for phrase in found)
    messages = [str(warning.message) for warning in recwarn]
    assert len(messages) == bool(warned) and all(warned in message for message in messages)


@pytest.mark.parametrize("factor", [-1.0, 57.3, 0.001])
def test_a_curvature_in_other_units_is_told_with_its_factor(tmp_path, factor):
    path = tmp_path / "road.csv"
    path.write_text(lines(np.c_[X, Y, factor * BEND], header=["x_m,y_m,kappa"], digits=9))
    with pytest.warns(UserWarning, match="kappa turns .* times as far as x, y") as caught:
        same_line(read_road(path))
    told = str(caught[0].message).split("turns ")[1].split()[0]
    assert float(told) == pytest.approx(factor, rel=0.03)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_encodings(tmp_path, encoding):
    path = tmp_path / "road.csv"
    path.write_bytes(TABLES["names"].encode(encoding))
    same_line(read_road(path))


def test_widths_and_speeds_stay_with_their_points(tmp_path):
    path = tmp_path / "road.csv"
    table = np.c_[X, Y, 3 + 0.01 * S, 2 + Z, 36 + Z]
    path.write_text(lines(table, header=["x_m,y_m,width_left,w_tr_right_m,v_kmh"]))
    road = read_road(path)
    np.testing.assert_allclose(road.beside, np.c_[S, 3 + 0.01 * S, 2 + Z, 10 + Z], atol=1e-3)


def test_curvature_profiles_and_clothoids_are_exact(tmp_path):
    path = tmp_path / "road.csv"
    table = np.c_[TRUTH.lengths, TRUTH.curvature_start, TRUTH.curvature_end]
    path.write_text(lines(table, header=["length_m,kappa_start,kappa_end"], digits=9))
    road = read_road(path)
    assert np.array_equal(road.curvature_start, TRUTH.curvature_start) and road.length == TRUTH.length
    s = np.arange(0.0, 300.1, 2.0)
    path.write_text(lines(np.c_[s, 0.01 * np.sin(s / 30)], ";", ",", header=["s_m;kappa_radpm"], digits=12))
    road = read_road(path)
    np.testing.assert_allclose(road.curvature(s), 0.01 * np.sin(s / 30), atol=1e-9)
    circle = np.c_[np.linspace(0, 40 * math.pi, 50), np.full(50, 0.05)]
    path.write_text(lines(circle, header=["s,kappa"], digits=12))
    assert read_road(path).closed


def degrees(points, lat=48.7, lon=9.1):
    """Latitude and longitude of points by the radii of curvature of the ellipsoid: good to centimetres over 300 m."""
    a, e2 = 6378137.0, 0.0066943799901413165
    w = math.sqrt(1 - e2 * math.sin(math.radians(lat)) ** 2)
    north, east = a * (1 - e2) / w**3, a / w * math.cos(math.radians(lat))
    return np.c_[lat + np.degrees(points[:, 1] / north), lon + np.degrees(points[:, 0] / east)]


def _gpx(latlon):
    inner = "".join(f'<trkpt lat="{lat:.9f}" lon="{lon:.9f}"><ele>5</ele></trkpt>' for lat, lon in latlon)
    return (
        f'<?xml version="1.0"?><gpx xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>{inner}</trkseg></trk></gpx>'
    )


def _kml(latlon):
    inner = " ".join(f"{lon:.9f},{lat:.9f},0" for lat, lon in latlon)
    return f"<kml><Placemark><LineString><coordinates>{inner}</coordinates></LineString></Placemark></kml>"


def _geojson(latlon):
    line = {"type": "LineString", "coordinates": [[lon, lat] for lat, lon in latlon.tolist()]}
    short = {"type": "LineString", "coordinates": [[0, 0], [1, 1]]}
    features = [{"type": "Feature", "geometry": g, "properties": {}} for g in (short, line)]
    return json.dumps({"type": "FeatureCollection", "features": features})


def _latlon(latlon):
    return lines(latlon[:, ::-1], header=["lon,lat"], digits=9)


@pytest.mark.filterwarnings("ignore:road 'road'. points scatter")
@pytest.mark.parametrize("digits", [6, 7])
@pytest.mark.parametrize("spacing", [0.5, 2.0, 5.0])
def test_rounded_degrees_are_smoothed(tmp_path, spacing, digits):
    """To 11 and to 1 cm, also where most straights go along the grid of what was rounded, which hides it."""
    bend = [[60.0, 0.0, 0.02], [60.0, 0.02, 0.02], [60.0, 0.02, 0.0]]
    truth = Road("truth", *np.array([[200, 0, 0], *bend, [200, 0, 0], [60, 0, -0.01], [80, -0.01, -0.01]]).T)
    given = np.arange(0.0, truth.length, spacing)
    path = tmp_path / "road.csv"
    path.write_text(lines(degrees(truth.position(given)), header=["lat,lon"], digits=digits))
    road, s = read_road(path), np.linspace(10.0, truth.length - 20.0, 4000)
    error = road.curvature(s * road.length / given[-1]) - truth.curvature(s)
    assert np.sqrt(np.mean(error**2)) < 5e-4


@pytest.mark.parametrize("ending, write", [("gpx", _gpx), ("kml", _kml), ("geojson", _geojson), ("csv", _latlon)])
def test_degrees_are_projected_locally(tmp_path, ending, write):
    path = tmp_path / f"road.{ending}"
    path.write_text(write(degrees(POINTS)))
    road = read_road(path)
    assert road.length == pytest.approx(300.0, abs=0.02)
    np.testing.assert_allclose(
        road.curvature(np.linspace(20, 280, 9)), TRUTH.curvature(np.linspace(20, 280, 9)), atol=2e-4
    )
    assert any("projected around 48.7" in phrase for phrase in road.assumed)


def test_projection_against_a_meridian_arc():
    """One degree of latitude at the equator is 110,574.4 m (WGS 84), at the pole 111,694; at 45 deg of longitude..."""
    points, _, _ = projected(np.array([-0.25, 0.25]), np.zeros(2), "it")
    assert np.hypot(*np.diff(points, axis=0)[0]) == pytest.approx(110574.4 / 2, rel=2e-5)
    points, _, _ = projected(np.zeros(2), np.array([179.9, -179.9]), "it")  # across the date line, R 2 pi / 1800
    assert np.hypot(*np.diff(points, axis=0)[0]) == pytest.approx(2 * math.pi * 6378137 / 1800, rel=1e-5)


def _xodr(geometry, lanes=""):
    return (
        f'<OpenDRIVE><road id="1" length="1" junction="-1"><planView>{geometry}</planView>{lanes}'
        '<link><successor elementType="road" elementId="2" contactPoint="end"/></link></road>'
        '<road id="2" length="0.5" junction="-1"><planView><geometry s="0" x="0" y="0" hdg="3.1" length="50">'
        f'<arc curvature="-0.01"/></geometry></planView>{lanes}</road></OpenDRIVE>'
    )


def _pieces(shape="spiral"):
    out, kinds = "", ("line", "spiral", "arc", "arc")
    for k, (kind, length) in enumerate(zip(kinds, TRUTH.lengths, strict=True)):
        x, y = TRUTH.points[k]
        start, end = TRUTH.curvature_start[k], TRUTH.curvature_end[k]
        inner = {
            "line": "<line/>",
            "arc": f'<arc curvature="{start}"/>',
            "spiral": f'<spiral curvStart="{start}" curvEnd="{end}"/>',
        }[kind]
        place = f'x="{x}" y="{y}" hdg="{TRUTH.headings[k]}"'
        out += f'<geometry s="{TRUTH.stations[k]}" {place} length="{length}">{inner}</geometry>'
    return out


LANES = (
    '<lanes><laneSection s="0"><left><lane id="1"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane></left><right>'
    '<lane id="-1"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
    '<lane id="-2"><width sOffset="0" a="2" b="0" c="0" d="0"/></lane></right></laneSection></lanes>'
)


def test_opendrive_lines_arcs_and_spirals_are_exact(tmp_path):
    path = tmp_path / "road.xodr"
    path.write_text(_xodr(_pieces()))
    road = read_road(path, track="1")
    np.testing.assert_array_equal(road.curvature_end, TRUTH.curvature_end)
    same_line(road, atol=1e-9)
    chained = read_road(path)  # onto the end of road 2, which is driven backwards: its right bend is a left one
    assert chained.length == 350.0 and chained.curvature_start[-1] == 0.01
    far = np.hypot(*(read_road(path, track="2").points[-1] - TRUTH.points[-1]))
    assert any(f"roads do not meet by up to {far:.3g} m" in phrase for phrase in chained.assumed)
    with pytest.raises(ValueError, match="road '7' is not there; allowed: 1, 2"):
        read_road(path, track="7")
    assert road_from({"kind": "file", "path": str(path), "track": "1"}).build()[0].length == 300.0


def test_opendrive_lanes(tmp_path):
    path = tmp_path / "road.xodr"
    path.write_text(_xodr(_pieces(), LANES))
    for lane, offset, width in ((-1, -1.75, 3.5), (-2, -4.5, 2.0), (1, 1.5, 3.0)):
        road = read_road(path, track="1", lane=lane)
        s = np.linspace(3.0, 297.0, 100)
        line = TRUTH.position(s, offset)
        apart = np.abs(road.position(np.linspace(0, road.length, 20_000))[:, None] - line).sum(axis=2).min(axis=0)
        assert apart.max() < 0.05 and road.beside[:, 1:3].sum(axis=1) == pytest.approx(width)
    with pytest.raises(ValueError, match=r"lane=-3 is not there at s=0 m; on that side: -1, -2"):
        read_road(path, lane=-3)


def test_opendrive_cubics(tmp_path):
    """v = c u² + d u³ over 100 m, against the curve's own points."""
    c, d = 0.002, -2e-5
    u = np.linspace(0, 100, 200_001)
    v = c * u**2 + d * u**3
    length = np.hypot(np.diff(u), np.diff(v)).sum()
    for inner in (
        f'<poly3 a="0" b="0" c="{c}" d="{d}"/>',
        f'<paramPoly3 pRange="normalized" aU="0" bU="100" cU="0" dU="0" aV="0" bV="0" cV="{c * 1e4}" dV="{d * 1e6}"/>',
    ):
        path = tmp_path / "road.xodr"
        path.write_text(_xodr(f'<geometry s="0" x="0" y="0" hdg="0" length="{length}">{inner}</geometry>'))
        road = read_road(path, track="1")
        assert road.length == pytest.approx(length, abs=1e-3)
        at = np.interp(np.linspace(0, length, 50), np.r_[0, np.cumsum(np.hypot(np.diff(u), np.diff(v)))], u)
        np.testing.assert_allclose(
            road.position(np.linspace(0, road.length, 50)), np.c_[at, c * at**2 + d * at**3], atol=2e-3
        )


WAYS_OUT = [
    ("road.csv", lines(KM), ["m long; at least 3 m", "x_km"]),
    ("road.csv", lines(1000 * POINTS), ["from the point before", "x_mm"]),
    ("road.csv", lines(degrees(POINTS), digits=9), ["m long", "lat,lon"]),
    ("road.csv", "# of a track\nhello world\n", ["holds no line of numbers", "'of a track'", "named columns"]),
    ("road.csv", lines(np.c_[X, Y, Z]), ["3 columns without names", "x_m,y_m"]),
    ("road.txt", lines(np.c_[X, Z, Y]), ["column 2 never changes", "begin with the line x_m,height,y_m"]),
    ("road.csv", lines(np.c_[S, Z], header=["s,phi"]), ["known are s", "kappa_radpm"]),
    ("road.csv", lines(POINTS, header=["x_rad,y_rad"]), ["'x_rad' is in 'rad'", "allowed: m, km"]),
    ("road.csv", lines(POINTS, header=["x_pixel,y_pixel"]), ["known are none"]),
    ("road.csv", lines(POINTS, header=["x_kmh,y_m"]), ["'x_kmh' is in 'kmh'", "allowed: m, km"]),
    ("road.csv", lines(np.c_[POINTS, Z], header=["x_m,y_m,x_m"]), ["two columns are named 'x_m'", "otherwise"]),
    ("road.csv", lines(np.abs(POINTS).round(1), ",", ",", digits=1), ["decimal comma"]),
    ("road.gpx", "<kml></kml>", ["root <kml>", "expected <gpx>"]),
    ("road.gpx", "<gpx></gpx>", ["holds no track segments"]),
    ("road.xml", "<osm></osm>", ["not <commonRoad>", ".xodr"]),
    ("road.osm", "<osm></osm>", ["ending '.osm' is unknown; export it as .geojson;"]),
    ("road.xodr", '<!DOCTYPE a [<!ENTITY b "c">]><OpenDRIVE/>', ["DOCTYPE", "not allowed"]),
    ("road.xodr", "<OpenDRIVE>", ["not XML", "line 1"]),
    ("road.geojson", "[1, 2", ["not JSON"]),
    ("road.kml", "<a>" * 500, ["100 in each other"]),
    ("road.csv", "s,kappa\n0,0\n5,0\n5,0\n", ["line 4", "must rise"]),
]


@pytest.mark.parametrize(("name", "content", "words"), WAYS_OUT, ids=range(len(WAYS_OUT)))
def test_refusals_tell_the_way_out(tmp_path, name, content, words):
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(ValueError) as caught:
        read_road(path)
    message = str(caught.value)
    assert name in message and message.isprintable() and len(message) < 600
    for word in words:
        assert word in message, message


def test_what_has_no_effect_is_refused(tmp_path):
    path = tmp_path / "road.csv"
    path.write_text(TABLES["plain"])
    for keywords in ({"track": "1"}, {"lane": -1}):
        with pytest.raises(ValueError, match="has no effect"):
            RoadFile(str(path), **keywords).build()
    plain, smoothed = RoadFile(str(path)), RoadFile(str(path), smoothing=0.01)
    assert plain.fingerprint() != smoothed.fingerprint()
    assert road_from(smoothed.to_dict()) == smoothed and plain.to_dict().keys() == {"kind", "path", "closed"}


FILES = Path(__file__).parents[3] / "shared" / "data" / "csv"
#: Length (m) of those that are not the 1057.5 m loop, and words of the refusals of those that are not read.
OTHERS = {"g_R120": 754.0, "g_R50": 314.2, "german_diag": 533.1, "german_straight": 495.0, "latlon": 1058.4}
REFUSED = {
    "km": "x_km",
    "mm": "x_mm",
    "lonlat_noheader": "lat,lon",
    "noisy": "smoothing=",
    "german_1dec": "smoothing=",
    "decimalcomma_int": "smoothing=",
}


@pytest.mark.parametrize("path", sorted(FILES.glob("*.csv")), ids=lambda path: path.stem)
def test_files_that_nobody_here_wrote(path):
    begin = time.process_time()
    if path.stem in REFUSED:
        with pytest.raises(ValueError, match=REFUSED[path.stem]):
            read_road(path)
        if REFUSED[path.stem] == "smoothing=":
            assert read_road(path, smoothing=0.5).length == pytest.approx(1057.5, rel=0.05)
    else:
        road = read_road(path)
        assert road.length == pytest.approx(OTHERS.get(path.stem, 1057.5), abs=0.2) and road.fit_error < 0.03
    assert time.process_time() - begin < 5.0
