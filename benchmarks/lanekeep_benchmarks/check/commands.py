"""`lanekeep road check`, `lanekeep map check` and `lanekeep vehicle check`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from lanekeep_benchmarks.check import Report, check_map, check_road, check_vehicle, draw_map, draw_road
from lanekeep_benchmarks.check.bends import bends_of
from lanekeep_benchmarks.check.report import shown_number
from lanekeep_benchmarks.console import console
from lanekeep_benchmarks.endings import check_picture, input_errors, interruptible
from lanekeep_env.files import write_atomic
from lanekeep_env.physics.vehicles import vehicle_from
from lanekeep_env.roads import read_road
from lanekeep_env.walls import MapFile

road = typer.Typer(help="Roads of one's own.", no_args_is_help=True)
map_ = typer.Typer(help="Maps of one's own.", no_args_is_help=True)
vehicle = typer.Typer(help="Vehicles of one's own.", no_args_is_help=True)

Json = Annotated[bool, typer.Option("--json", help="Print JSON, for scripts.")]
Out = Annotated[Path | None, typer.Option(help="A .png file for the picture.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Write over an existing picture.")]


@road.callback()
@map_.callback()
@vehicle.callback()
def _group() -> None:
    """Say what a file holds."""


@road.command("check")
def road_check(
    file: Annotated[Path, typer.Argument(help="CSV, GPX, KML, GeoJSON, OpenDRIVE or CommonRoad file.")],
    closed: Annotated[bool | None, typer.Option("--closed/--open", help="Default: found out.")] = None,
    smoothing: Annotated[float | None, typer.Option(help="How far points scatter, m; default: estimated.")] = None,
    track: Annotated[str | None, typer.Option(help="Which of several lines: road or lanelet ids, a number.")] = None,
    lane: Annotated[int | None, typer.Option(help="Lane of an OpenDRIVE road, negative on the right.")] = None,
    out: Out = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Say how long, how curved and how wide a road is, what was assumed, and how fast it can be driven.

    Example: lanekeep road check my_track.csv --out my_track.png
    """
    with interruptible(""), input_errors():
        check_picture(out, overwrite)
        report = check_road(file, closed, smoothing, track, lane)
        if out is not None:
            write_atomic(out, draw_road(read_road(file, closed, smoothing, track, lane)))
    _print(report, out, as_json)


@map_.command("check")
def map_check(
    file: Annotated[Path, typer.Argument(help="YAML file as map_server and nav2 write it.")],
    centre_line: Annotated[str | None, typer.Option(help="Road file with the circuit's middle.")] = None,
    x: Annotated[float, typer.Option(help="Of the start, m.")] = 0.0,
    y: Annotated[float, typer.Option(help="Of the start, m.")] = 0.0,
    heading: Annotated[float, typer.Option(help="Of the start, rad.")] = 0.0,
    unknown_is_wall: Annotated[bool, typer.Option("--unknown-is-wall", help="Unknown cells stop a car.")] = False,
    out: Out = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Say what walls a map has, whether it is a circuit, how long and how wide.

    Example: lanekeep map check my_map.yaml --out my_map.png
    """
    with interruptible(""), input_errors():
        check_picture(out, overwrite)
        report, world = check_map(file, MapFile(str(file), x, y, heading, unknown_is_wall, centre_line))
        if out is not None:
            write_atomic(out, draw_map(world))
    _print(report, out, as_json)


@vehicle.command("check")
def vehicle_check(
    file: Annotated[str, typer.Argument(help="YAML or JSON file, or the name of a car.")],
    speed: Annotated[
        float | None, typer.Option(help="Of steady bends, m/s; default: 25 for 2.8 m of wheelbase.")
    ] = None,
    friction: Annotated[float, typer.Option(help="Of the road.")] = 1.0,
    out: Out = None,
    overwrite: Overwrite = False,
    as_json: Json = False,
) -> None:
    """Say how a car steers and oscillates, how tightly it turns, and what does not go together in its numbers.

    With --speed or --out it says by how much a single track without load transfer corners too fast.

    Example: lanekeep vehicle check my_car.yaml --out my_car.png
    """
    with interruptible(""), input_errors():
        check_picture(out, overwrite)
        car = vehicle_from(file)
        bends = None if out is None and speed is None else bends_of(car, speed, friction)
        report = check_vehicle(car, bends)
        if out is not None and bends is not None:
            from lanekeep_benchmarks.check.bends_plot import draw_bends  # Matplotlib: a third of a command's start

            write_atomic(out, draw_bends(bends))
    _print(report, out, as_json)


def _print(report: Report, out: Path | None, as_json: bool) -> None:
    if as_json:
        print(json.dumps({**report.to_dict(), **({} if out is None else {"picture": str(out)})}))
        return
    there = console()
    table = Table(title=Text(report.title), title_justify="left", show_header=False)
    table.add_column()
    table.add_column(justify="right")
    table.add_column()
    for name, value, unit in report.rows:
        table.add_row(Text(name), Text(shown_number(value)), Text(unit))
    there.print(table)
    for note in report.notes:
        there.print(Text(note), soft_wrap=True)
    if out is not None:
        there.print(Text(f"Picture: {out}"), soft_wrap=True)
