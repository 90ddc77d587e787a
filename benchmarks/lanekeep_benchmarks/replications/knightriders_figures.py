"""Team KnightRiders 2017: Figures 3.8 to 3.40, simulated as the authors did, with metres and degrees mixed.

Distances are the side sensor's. The report says of Figures 3.33 to 3.38 that theirs is the rear axle's, which cannot be
meant in their mixed units: from a start of (0.8, 20) it would be -2.7.
"""

from __future__ import annotations

import numpy as np

from lanekeep_baselines.wall_cascade import DISTANCE_GAIN_DEGREES, DISTANCE_GAIN_SPEED, RATE_POLE, RATE_ZERO
from lanekeep_baselines.wall_design import PD_SPEED
from lanekeep_benchmarks.replications import knightriders_plots as plots
from lanekeep_benchmarks.replications.knightriders_plots import Column
from lanekeep_benchmarks.replications.record import Replication, Row, Table
from lanekeep_benchmarks.replications.wall_simulation import CAR, FIGURES, Run, at_limit, figure, lowest_after_peak

#: A picture's file and title, and for each column the figures of distance and steering, what is driven, and whether the
#: steering is limited.
PICTURES: tuple[tuple[str, str, tuple[tuple[str, str, str, bool], ...]], ...] = (
    (
        "figures_3_08_to_3_10.png",
        "First approach, PI, and the second for comparison",
        (
            ("3.8", "", "PI, from 0 m, 0°, 0.4 m/s", True),
            ("3.9", "", "PI, from 0.8 m, 20°, 0.4 m/s", True),
            ("3.10", "", "PI state feedback, from 0.8 m, 20°, 0.4 m/s", True),
        ),
    ),
    (
        "figures_3_12_to_3_19.png",
        "Second approach, PI state feedback, without and with a limited steering",
        (
            ("3.12", "3.14", "from 0 m, 0°, 0.4 m/s, no limit", False),
            ("3.13", "3.15", "from 0 m, 0°, 0.4 m/s, limited", True),
            ("3.16", "3.18", "from 0.5 m, −20°, 1 m/s, no limit", False),
            ("3.17", "3.19", "from 0.5 m, −20°, 1 m/s, limited", True),
        ),
    ),
    (
        "figures_3_33_to_3_40.png",
        f"Third approach, cascade (k₂ v = {DISTANCE_GAIN_SPEED * DISTANCE_GAIN_DEGREES:g}/s, not printed), and the PD",
        (
            ("3.33", "3.34", "cascade, from 0 m, 0°, 0.4 m/s", True),
            ("3.35", "3.36", "cascade, from 0.8 m, 20°, 0.4 m/s", True),
            ("3.37", "3.38", "cascade, from 0.5 m, −20°, 1 m/s", True),
            ("3.40", "", f"PD as misprinted, step, {PD_SPEED} m/s", False),
        ),
    ),
)


def responses(found: Replication) -> None:
    """Figures 3.8 to 3.40 as the authors simulated them, in their mixed units."""
    runs = {number: figure(number) for number in FIGURES}
    for name, title, columns in PICTURES:
        found.pictures[name] = plots.responses(
            f"{title} (metres and degrees mixed, as the authors simulated)",
            [
                Column(
                    f"Figure {above}: {what}",
                    {"": runs[above]},
                    limited,
                    f"Figure {below}" if below else "not shown in the report",
                    20.0 if above == "3.40" else 3.0,
                )
                for above, below, what, limited in columns
            ],
        )
    for quantity, number, checked, reproduced in (
        ("peak of the PI", "3.9", 2.11, runs["3.9"].distance.max()),
        ("peak of the PI state feedback", "3.10", 1.44, runs["3.10"].distance.max()),
        ("lowest after it", "3.10", 0.62, lowest_after_peak(runs["3.10"])),
        ("peak of the cascade, k2 = 4", "3.35", 1.44, runs["3.35"].distance.max()),
        ("lowest after it", "3.35", 0.92, lowest_after_peak(runs["3.35"])),
    ):
        source = f"Figure {number}, checked"
        found.rows.append(Row(f"{quantity}, mixed units", source, checked, float(reproduced), "m", 2))
    statements(found, runs)


def statements(found: Replication, runs: dict[str, Run]) -> None:
    """What the report says of its figures without a number."""

    def peaks(*numbers: str) -> str:
        return " / ".join(f"{runs[number].distance.max():.2f}" for number in numbers)

    def steering(*numbers: str) -> str:
        return " / ".join(f"{np.abs(runs[number].steering).max():.0f}°" for number in numbers)

    def seconds(*numbers: str) -> str:
        return " / ".join(f"{at_limit(runs[n]) / 100.0 * len(runs[n].time) * CAR.step:.2f} s" for n in numbers)

    def back(*numbers: str) -> str:
        return " / ".join(f"{runs[number].steering.min():.1f}°" for number in numbers).replace("-", "−")

    # Where the two poles of the heading's loop meet: (1 + p - k)² = 4 (p - n k).
    meet = min(np.roots([1.0, 4.0 * RATE_ZERO - 2.0 * (1.0 + RATE_POLE), (1.0 - RATE_POLE) ** 2]).real)
    found.tables.append(
        Table(
            "What the report says without a number, mixed units as the authors simulated",
            ("statement", "figures", "here"),
            (
                ("PI swings far over, state feedback less", "3.9 / 3.10", f"peaks {peaks('3.9', '3.10')} m"),
                ("cascade hardly", "3.35", f"peak {peaks('3.35')} m with k2 = 4 (not printed)"),
                ("state feedback asks for more than there is", "3.14 / 3.18", f"{steering('3.12', '3.16')} of 22°"),
                ("limited, it swings over", "3.13 / 3.17", f"peaks {peaks('3.13', '3.17')} m"),
                ("... more than without a limit", "3.12 / 3.16", f"peaks {peaks('3.12', '3.16')} m"),
                ("cascade does not swing over", "3.33 / 3.37", f"peaks {peaks('3.33', '3.37')} m"),
                ("its steering is soon within the limit", "3.34", f"{seconds('3.33')} at the limit"),
                (
                    "... and much smaller than the state feedback's",
                    "3.38 / 3.19",
                    f"{seconds('3.37', '3.17')} at the limit, back to {back('3.37', '3.17')}",
                ),
                ("PD with complex poles swings", "3.40", f"peak {peaks('3.40')} m"),
                (
                    "heading's poles are on the real axis beside the breakaway point",
                    "3.24",
                    f"they meet at a loop gain of {meet:.3f}; at 0.556 they have left the axis by 0.079",
                ),
            ),
        )
    )
