"""Team KnightRiders 2017, 4.2 and 4.3: what the published and the improved perception make of random scenes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lanekeep_baselines.scan_classes import IMPROVED, KINDS, PUBLISHED, Perception, Seen, classify
from lanekeep_baselines.scan_glass import echo_of_side, is_glass, shown_ahead, with_glass
from lanekeep_benchmarks.replications import knightriders_perception_plots as plots
from lanekeep_benchmarks.replications.knightriders_scenes import CAMERA, CASES, FIRST, Scenes, draw
from lanekeep_benchmarks.replications.record import Replication, Table
from lanekeep_env.sensing.ultrasonic import HALF_CONE

#: The scenes that are judged; no limit was chosen on them.
COUNT, SEED = 2000, 20170314
RULES = {"published": PUBLISHED, "improved": IMPROVED}


def judged(scenes: Scenes, rule: Perception) -> Seen:
    """Return what a rule makes of the scenes; only the improved one listens to the ultrasonic sensor for glass."""
    seen = classify(rule.points(scenes.ranges, CAMERA), CAMERA, rule)
    if rule is PUBLISHED:
        return seen
    angles = FIRST + CAMERA.step * np.arange(CAMERA.beams)
    beside = echo_of_side(scenes.beside, HALF_CONE).min(axis=0)
    glass = is_glass(scenes.heard, np.minimum(shown_ahead(scenes.ranges, angles, HALF_CONE), beside))
    return with_glass(seen, glass, scenes.heard, rule)


def confusion(truth: NDArray[np.int64], kind: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how often each kind (rows: the truth) was taken for each, (3, 3)."""
    counts = np.zeros((len(KINDS), len(KINDS)), dtype=np.int64)
    np.add.at(counts, (truth, kind), 1)
    return counts


def share_right(scenes: Scenes, kind: NDArray[np.int64], among: NDArray[np.bool_] | bool = True) -> float:
    """Return the share of scenes, of those ``among`` them, whose kind is right, %."""
    chosen = np.broadcast_to(among, kind.shape)
    return 100.0 * float((kind == scenes.truth)[chosen].mean())


def perception(found: Replication) -> None:
    """The confusion table, what makes scenes hard, and a picture of each step."""
    scenes = draw(COUNT, SEED)
    kinds = {name: judged(scenes, rule).kind for name, rule in RULES.items()}
    tables = {name: confusion(scenes.truth, kind) for name, kind in kinds.items()}
    headings = tuple(f"{name}: {kind}" for name in RULES for kind in KINDS)
    counted = tuple(
        (truth, *(str(count) for table in tables.values() for count in table[row])) for row, truth in enumerate(KINDS)
    )
    found.tables.append(Table(f"Perception of {COUNT} random scenes (scenes)", ("truth", *headings), counted))
    rows = []
    for truth, kind in enumerate(KINDS):
        for case, name in enumerate(CASES):
            among = (scenes.truth == truth) & (scenes.case == case)
            if among.any():
                shares = (f"{share_right(scenes, kinds[rule], among):.1f}" for rule in RULES)
                rows.append((f"{kind}, {name}", str(among.sum()), *shares))
    rows.append(("all", str(COUNT), *(f"{share_right(scenes, kinds[rule]):.1f}" for rule in RULES)))
    found.tables.append(
        Table("Perception, right by case", ("case", "scenes", *(f"{r} [%]" for r in RULES)), tuple(rows))
    )
    found.pictures["perception_confusion.png"] = plots.confusions(tables)
    found.pictures.update(plots.steps())
