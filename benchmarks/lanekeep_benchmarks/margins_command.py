"""`lanekeep margins`: how far the loops of policies and cars are from instability, over the speed."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from lanekeep_baselines.margins import Margins, check_speed, margins
from lanekeep_benchmarks.console import console, progress
from lanekeep_benchmarks.endings import check_picture, input_errors, interruptible
from lanekeep_benchmarks.policies import default_policies, entry_of
from lanekeep_env.files import write_atomic
from lanekeep_env.physics.vehicles import vehicle_from
from lanekeep_env.scenario import LaneKeepScenario

#: Samples of the road ahead that every policy is shown; a loop around straight driving does not depend on them.
PREVIEW = 20
SPEEDS = "1,5,10,15,20,30,40,50"


@dataclass(frozen=True)
class Row:
    """The margins of a policy on a car; ``why`` tells why there are none."""

    policy: str
    vehicle: str
    speed: float
    found: Margins | None
    why: str = ""

    @property
    def loop(self) -> str:
        """What to call it."""
        return f"{self.policy}, {self.vehicle}"


def margins_command(
    policies: Annotated[
        str | None, typer.Argument(help="Comma-separated; default: all classical ones.", metavar="[POLICIES]")
    ] = None,
    vehicle: Annotated[str, typer.Option(help="Names or files, comma-separated.")] = "yin",
    speeds: Annotated[str, typer.Option(help="m/s, comma-separated, from 1 on.")] = SPEEDS,
    delay: Annotated[float, typer.Option(help="Of the steering, s, which the policies know.")] = 0.0,
    kinematic: Annotated[bool, typer.Option("--kinematic", help="Cars without slip.")] = False,
    out: Annotated[Path | None, typer.Option(help="A .png file for the picture.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Write over an existing picture.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for scripts: m/s, s, rad.")] = False,
) -> None:
    """Say how far loops are from instability around straight driving: what a control engineer asks first.

    GM: factor of the actuator's gain that is borne. PM: phase. Delay and camera: how much later, beyond what is known,
    the steering may turn and the camera may measure. Ms: largest sensitivity; 2 is the usual bound.

    Example: lanekeep margins yin-lqr-observer,lq-preview --speeds 5,15,30 --out margins.png

    Example: lanekeep margins my_controller.py:make --vehicle my_car.yaml --delay 0.05
    """
    with interruptible(""), input_errors():
        check_picture(out, overwrite)
        cars = _listed(vehicle)
        if not cars:
            raise ValueError(f"--vehicle {vehicle!r} is not allowed: it must be names or files of cars")
        rows = tabulated(_listed(policies), cars, _numbers(speeds), delay, kinematic)
        if out is not None:
            from lanekeep_benchmarks.margins_plot import plot_margins

            write_atomic(out, plot_margins(rows))
    if as_json:
        print(json.dumps([_plain(row) for row in rows]))
        return
    _print(rows)
    if out is not None:
        console().print(Text(f"Picture: {out}"), soft_wrap=True)


def tabulated(
    policies: Sequence[str] = (),
    vehicles: Sequence[str] = ("yin",),
    speeds: Sequence[float] = (5.0, 15.0, 30.0),
    delay: float = 0.0,
    kinematic: bool = False,
) -> list[Row]:
    """Return the margins of every policy (default: all classical ones) on every car at every speed (m/s).

    Raises:
        ValueError: an unknown policy or car, one that does not keep lanes, a speed that is not allowed.
    """
    for speed in speeds:
        check_speed(speed)
    cars = [(name, _scenario(name, delay, kinematic)) for name in vehicles]
    named = list(policies) or default_policies([scenario for _, scenario in cars])
    entries = [entry_of(name) for name in named]
    work = [(entry, name, scenario) for entry in entries for name, scenario in cars]
    rows = []
    with progress("loops") as bar:
        task = bar.add_task("", total=len(work))
        for entry, name, scenario in work:
            bar.update(task, description=f"{entry.name}, {name}")
            policy = entry.make(scenario)
            for speed in speeds:
                try:
                    rows.append(Row(entry.name, name, speed, margins(policy, scenario, speed)))
                except ValueError as error:
                    rows.append(Row(entry.name, name, speed, None, str(error)))
            bar.advance(task)
    return rows


def _scenario(vehicle: str, delay: float, kinematic: bool) -> LaneKeepScenario:
    car = vehicle_from({"base": vehicle, "steering": {"delay": delay}} if delay else vehicle)
    return LaneKeepScenario(vehicle=car, preview=PREVIEW, dynamics="kinematic" if kinematic else "dynamic")


def _listed(text: str | None) -> list[str]:
    return [part.strip() for part in (text or "").split(",") if part.strip()]


def _numbers(text: str) -> list[float]:
    try:
        found = [float(part) for part in _listed(text)]
    except ValueError:
        found = []
    if not found:
        raise ValueError(f"--speeds {text!r} is not allowed: it must be numbers in m/s, such as {SPEEDS}")
    return found


def _plain(row: Row) -> dict[str, Any]:
    """As JSON has it, which knows nothing infinite."""
    found = {} if row.found is None else asdict(row.found)
    finite = {key: value if math.isfinite(value) else None for key, value in found.items()}
    return {"policy": row.policy, "vehicle": row.vehicle, "speed": row.speed, **finite, "why": row.why}


def _print(rows: Sequence[Row]) -> None:
    """A table a car, so that it fits the terminal, a narrow one without spaces around its cells."""
    padding = (0, 1) if console().width >= 80 else (0, 0)
    for car in dict.fromkeys(row.vehicle for row in rows):
        table = Table(title=Text(f"Margins of {car} around straight driving"), title_justify="left", padding=padding)
        table.add_column("policy", overflow="fold")
        for name in ("m/s", "damping", "GM", "PM\n°", "delay\nms", "camera\nms", "Ms"):
            table.add_column(name, justify="right", no_wrap=True)
        before = ""
        for row in (row for row in rows if row.vehicle == car):
            if before not in ("", row.policy):
                table.add_section()
            name = "" if row.policy == before else row.policy
            before = row.policy
            bad = row.found is not None and not row.found.stable
            cells = (name, f"{row.speed:g}", *_cells(row.found))
            table.add_row(*map(Text, cells), style="bold red" if bad else None)
        console().print(table)
    for why in dict.fromkeys(row.why for row in rows if row.found is None):
        console().print(Text(why), soft_wrap=True)


def _cells(found: Margins | None) -> list[str]:
    if found is None:
        return ["-"] * 6
    if not found.stable:
        return [f"{found.damping:.2f}", "unstable", "", "", "", ""]
    return [
        f"{found.damping:.2f}",
        f"{found.gain:.2f}" if found.gain < 100.0 else "> 100",
        f"{math.degrees(found.phase):.0f}",
        f"{1e3 * found.delay:.0f}",
        f"{1e3 * found.camera_delay:.0f}",
        f"{found.sensitivity:.2f}",
    ]
