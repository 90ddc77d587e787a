"""`lanekeep road check`, `map check`, `vehicle check`: figures against closed forms, pictures, one-line errors."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from two_track_oracle import TwoTrack

from lanekeep_benchmarks.check.bends import bends_of
from lanekeep_benchmarks.check.vehicles import eigenvalues, understeer_gradient
from lanekeep_benchmarks.cli import run
from lanekeep_env.physics.vehicles import VEHICLES


def told(capsys, *arguments):
    assert run([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_road(tmp_path, capsys):
    angle = np.arange(0.0, 2 * math.pi, 0.05)
    table = np.column_stack([80 * np.cos(angle), 80 * np.sin(angle), np.full((len(angle), 2), [3.0, 4.0])])
    path, picture = tmp_path / "circle.csv", tmp_path / "circle.png"
    np.savetxt(path, table, delimiter=",", fmt="%.9f", header="x_m,y_m,w_tr_right_m,w_tr_left_m")
    found = told(capsys, "road", "check", str(path), "--out", str(picture))
    assert found["length [m]"] == pytest.approx(2 * math.pi * 80, rel=1e-6) and found["closed"]
    assert found["there the radius is [m]"] == pytest.approx(80.0, rel=1e-4)
    assert (found["narrowest to the left [m]"], found["narrowest to the right [m]"]) == (4.0, 3.0)
    speed = math.sqrt(0.4 * 9.81 * 80.0)
    assert found["lap time at 0.4 g [s]"] == pytest.approx(2 * math.pi * 80 / speed, rel=1e-4)
    assert picture.read_bytes()[:4] == b"\x89PNG" and any("x_m as x in m" in note for note in found["notes"])
    assert run(["road", "check", str(path), "--out", str(picture)]) == 2
    assert "exists" in capsys.readouterr().err
    assert run(["road", "check", str(tmp_path / "nowhere.csv")]) == 2
    assert "No such file" in capsys.readouterr().err
    assert run(["road", "check", str(path)]) == 0 and "502.65" in capsys.readouterr().out


def test_map(tmp_path, capsys):
    grey = np.zeros((124, 164), np.uint8)
    grey[2:-2, 2:-2] = 254
    grey[22:-22, 22:-22] = 0
    (tmp_path / "map.pgm").write_bytes(b"P5 164 124 255\n" + grey.tobytes())
    text = "image: map.pgm\nresolution: 5e-2\norigin: [-4.0, -0.6, 0]\nnegate: 0\n"
    (tmp_path / "map.yaml").write_text(text + "occupied_thresh: 0.65\nfree_thresh: 0.196\n")
    found = told(capsys, "map", "check", str(tmp_path / "map.yaml"), "--out", str(tmp_path / "map.png"))
    assert found["lap [m]"] == pytest.approx(24.0, rel=0.06)
    assert found["mean width [m]"] == pytest.approx(1.0, abs=0.1) and found["walls"] == 8
    assert (tmp_path / "map.png").read_bytes()[:4] == b"\x89PNG"


def test_vehicle(tmp_path, capsys):
    found = told(capsys, "vehicle", "check", "passat")
    car = VEHICLES["passat"]
    # Steady turning: delta = l / R + K a at R = 100 m and 20 m/s, against both equations solved for beta and delta.
    v, radius = 20.0, 100.0
    front, rear, cf, cr = (
        car.cg_to_front_axle,
        car.cg_to_rear_axle,
        *(
            car.front_cornering_stiffness,
            car.rear_cornering_stiffness,
        ),
    )
    matrix = np.array([[-(cf + cr), cf], [cr * rear - cf * front, cf * front]])
    r = v / radius
    right = np.array([car.mass * v * r - (cr * rear - cf * front) * r / v, (cf * front**2 + cr * rear**2) * r / v])
    _, delta = np.linalg.solve(matrix, right)
    assert delta == pytest.approx(car.wheelbase / radius + understeer_gradient(car) * v**2 / radius, rel=1e-9)
    assert found["understeer gradient [rad/(m/s²)]"] == pytest.approx(understeer_gradient(car))
    # The sum of the eigenvalues is the trace, and a car that oversteers gets unstable at its critical speed.
    assert eigenvalues(car, 20.0).sum().real == pytest.approx(
        -(cf + cr) / (car.mass * 20.0) - (cf * front**2 + cr * rear**2) / (car.yaw_inertia * 20.0)
    )
    path = tmp_path / "tail.yaml"
    path.write_text("base: passat\nfront_cornering_stiffness: 120 kN/rad\nrear_cornering_stiffness: 80 kN/rad\n")
    found = told(capsys, "vehicle", "check", str(path))
    from lanekeep_env.physics.vehicles import vehicle_from

    tail, critical = vehicle_from(path), found["critical speed [m/s]"]
    assert eigenvalues(tail, critical - 0.1).real.max() < 0.0 < eigenvalues(tail, critical + 0.1).real.max()
    path.write_text("base: passat\nyaw_inertia: 3.2\n")
    assert any("yaw inertia" in note for note in told(capsys, "vehicle", "check", str(path))["notes"])
    assert run(["vehicle", "check", "pasat"]) == 2 and "did you mean 'passat'" in capsys.readouterr().err


def test_vehicle_in_steady_bends(tmp_path, capsys):
    """The honest bends against a two-track car that has been turned for long enough, the linear ones in closed form."""
    car, speed = VEHICLES["passat"], 25.0
    bends = bends_of(car, speed)
    for reached in (3.0, 6.0, 8.0):
        steer = float(np.interp(reached, bends.honest.across, bends.honest.steer))
        sideslip, _, across = TwoTrack(car, 1.0).drive(
            speed, lambda t, a=steer: a * min(t, 1.0), np.arange(0.0, 8.1, 0.5)
        )
        assert reached == pytest.approx(across[-1], rel=0.01)
        assert float(np.interp(reached, bends.honest.across, bends.honest.sideslip)) == pytest.approx(
            sideslip[-1], rel=0.03
        )
    expected = bends.linear.steer * speed**2 / (car.wheelbase + understeer_gradient(car) * speed**2)
    few = bends.linear.steer < 0.02  # beyond, the path's tangent is not the angle
    np.testing.assert_allclose(bends.linear.across[few], expected[few], rtol=2e-3)
    picture = tmp_path / "bends.png"
    found = told(capsys, "vehicle", "check", "passat", "--speed", "25", "--out", str(picture))
    assert picture.read_bytes()[:4] == b"\x89PNG"
    names = [name for name in found if "single track" in name]
    assert len(names) == 4 and [found[name] for name in names] == sorted(found[name] for name in names)
    tail = tmp_path / "tail.yaml"
    tail.write_text("base: passat\nfront_cornering_stiffness: 120 kN/rad\nrear_cornering_stiffness: 80 kN/rad\n")
    assert run(["vehicle", "check", str(tail), "--speed", "60"]) == 2
    assert "no steady bend" in capsys.readouterr().err


def test_the_page_of_the_single_track_s_error_is_what_the_command_says():
    page = (Path(__file__).parents[2] / "docs" / "single-track-error.md").read_text("utf-8")
    rows = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith("| `")]
    assert {row[0].strip("`") for row in rows} == {*VEHICLES} - {"knightriders", "pses"}
    for name, speed, *errors, largest in rows:
        bends = bends_of(VEHICLES[name.strip("`")])
        told = [f"{100.0 * error:.1f}" for _, error in bends.errors()]
        assert (speed, errors, largest) == (f"{bends.speed:.1f}", told, f"{bends.honest.across.max():.2f}")
