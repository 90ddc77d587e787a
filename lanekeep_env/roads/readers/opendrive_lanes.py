"""Where a lane of an OpenDRIVE road lies beside its reference line, and how wide it is."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element

import numpy as np

from lanekeep_env.checks import shown
from lanekeep_env.roads.readers.markup import number
from lanekeep_env.roads.road import Floats


def lane_offset(road: Element, along: Floats, lane: int, name: str) -> tuple[Floats, Floats]:
    """Return a lane's centre left of the reference line and its width at arc lengths ``along``, all in m.

    Raises:
        ValueError: somewhere there is no such lane.
    """
    centre = _cubics(road.findall("lanes/laneOffset"), "s", along, name)
    width = np.zeros_like(along)
    sections = road.findall("lanes/laneSection")
    begins = [number(section, "s", name) for section in sections]
    if not sections or begins != sorted(begins):
        raise ValueError(f"{name} has no lane sections in order; lane=0 takes the reference line")
    owner = np.clip(np.searchsorted(begins, along, side="right") - 1, 0, len(sections) - 1)
    side, sign = ("left", 1) if lane > 0 else ("right", -1)
    for k, section in enumerate(sections):
        here = owner == k
        if not here.any():
            continue
        lanes = {one.get("id"): one for one in section.findall(f"{side}/lane")}
        for number_of in range(1, abs(lane) + 1):
            one = lanes.get(str(sign * number_of))
            if one is None:
                found = ", ".join(str(key)[:8] for key in list(lanes)[:10]) or "none"
                raise ValueError(f"{name}: lane={shown(lane)} is not there at s={begins[k]:g} m; on that side: {found}")
            wide = _cubics(one.findall("width"), "sOffset", along[here] - begins[k], name)
            if number_of == abs(lane):
                centre[here] += sign * 0.5 * wide
                width[here] = wide
            else:
                centre[here] += sign * wide
    return centre, width


def _cubics(records: Sequence[Element], key: str, at: Floats, name: str) -> Floats:
    """Value of piecewise cubics a + b d + c d² + d d³, d from the last record's beginning on; 0 without records."""
    if not records:
        return np.zeros_like(at)
    begins = np.array([number(record, key, name) for record in records])
    table = np.array([[number(record, letter, name, 0.0) for letter in "abcd"] for record in records])
    order = np.argsort(begins, kind="stable")
    begins, table = begins[order], table[order]
    k = np.clip(np.searchsorted(begins, at, side="right") - 1, 0, len(begins) - 1)
    d = at - begins[k]
    a, b, c, e = table[k].T
    return a + d * (b + d * (c + d * e))
