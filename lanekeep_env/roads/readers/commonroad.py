"""CommonRoad scenarios: the middle between the bounds of lanelets that follow one another."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from lanekeep_env.checks import shown
from lanekeep_env.roads.readers.drawing import MOST_POINTS, Choice, Drawing
from lanekeep_env.roads.readers.markup import as_number, parse_xml
from lanekeep_env.roads.road import Floats

_MOST_LANELETS = 100_000
#: By which share of its width the middle of a lane may be missed: lanelets meet with kinks.
_TOLERANCE = 0.1
#: A chord that is longer is a straight, m: in a bend of 5 km it would leave the lane's middle by 1 m.
_STRAIGHT = 200.0
#: Of fewer points all chords are straights.
_FEW = 8


def read_commonroad(content: bytes, name: str, choice: Choice) -> Drawing:
    """Read a chain of lanelets of a CommonRoad scenario.

    Raises:
        ValueError: it is no such file, or has not what is asked for.
    """
    root = parse_xml(content, name)
    if root.tag == "OpenDRIVE":
        raise ValueError(f"{name} holds OpenDRIVE; name it with the ending .xodr")
    if root.tag != "commonRoad":
        raise ValueError(f"{name} is XML, but its root is not <commonRoad>; roads in XML are .xodr, .gpx and .kml, too")
    lanelets = {one.get("id", ""): one for one in root.findall("lanelet")}
    if not 1 <= len(lanelets) <= _MOST_LANELETS:
        raise ValueError(f"{name} has {len(lanelets)} lanelets; allowed are 1 to {_MOST_LANELETS}")
    if choice.track is not None:
        ids = [one.strip() for one in choice.track.split(",")]
        for one in ids:
            if one not in lanelets:
                some = ", ".join(shown(key) for key in list(lanelets)[:8])
                raise ValueError(f"{name}: track: lanelet {shown(one)} is not there; allowed: {some} ...")
        told = f"{len(ids)} lanelets as given"
    else:
        ids = _longest(lanelets, name)
        listed = ", ".join(one[:12] for one in ids[:8]) + (" ..." if len(ids) > 8 else "")
        told = f"of {len(lanelets)} lanelets: {listed} (track= takes others)"
    bounds = [[_bound(lanelets[one], side, name) for one in ids] for side in ("left", "right")]
    ends = np.cumsum([len(one) for one in bounds[0]])
    left, right = _divided(*_met(np.concatenate(bounds[0]), np.concatenate(bounds[1]), ends))
    if len(left) > MOST_POINTS:
        raise ValueError(f"{name} has {len(left)} points; allowed are {MOST_POINTS}")
    half = 0.5 * np.hypot(*(left - right).T)
    return Drawing(
        0.5 * (left + right),
        widths=np.column_stack([half, half]),
        assumed=(told,),
        tolerance=2.0 * _TOLERANCE * float(half.min()),
    )


def _bound(lanelet: Element, side: str, name: str) -> Floats:
    points = lanelet.findall(f"{side}Bound/point")
    what = f"{name}: lanelet {shown(lanelet.get('id'))}"
    other = len(lanelet.findall(f"{'right' if side == 'left' else 'left'}Bound/point"))
    if len(points) < 2 or len(points) != other:
        raise ValueError(
            f"{what} has {len(points)} and {other} points on its bounds; allowed are two or more, equally many"
        )
    return np.array([[as_number(point.findtext(axis), f"{what} {axis}") for axis in ("x", "y")] for point in points])


def _met(left: Floats, right: Floats, ends: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Both bounds, (n, 2), with one point half-way where a lanelet ends, before a given index, and the next begins."""
    middle = 0.5 * (left + right)
    last, first = ends[:-1] - 1, ends[:-1]
    near = np.hypot(*(middle[first] - middle[last]).T) < _TOLERANCE * np.hypot(*(left[last] - right[last]).T)
    last, first = last[near], first[near]
    kept = np.delete(np.arange(len(left)), first)
    for bound in (left, right):
        bound[last] = 0.5 * (bound[last] + bound[first])
    return left[kept], right[kept]


def _divided(left: Floats, right: Floats) -> tuple[Floats, Floats]:
    """Both bounds, (n, 2), with more points on what can be nothing but straight: chords too long for any bend, and all
    where hardly any are given.
    """
    chord = np.hypot(*np.diff(0.5 * (left + right), axis=0).T)
    pieces = np.ceil(np.minimum(chord / _STRAIGHT, MOST_POINTS))
    if len(left) < _FEW:
        pieces = np.full(len(chord), float(_FEW))
    at = np.concatenate([[0.0], np.cumsum(np.maximum(pieces, 1.0))])
    if at[-1] == len(chord) or at[-1] > MOST_POINTS:
        return left, right
    every = np.arange(at[-1] + 1.0)
    first, second = (np.column_stack([np.interp(every, at, bound[:, k]) for k in (0, 1)]) for bound in (left, right))
    return first, second


def _longest(lanelets: Mapping[str, Element], name: str) -> list[str]:
    """The longest chain of lanelets, each followed by one of its successors; none twice."""
    after = {
        one: [ref.get("ref", "") for ref in lanelet.findall("successor") if ref.get("ref", "") in lanelets]
        for one, lanelet in lanelets.items()
    }
    length = {one: _length(lanelet, name) for one, lanelet in lanelets.items()}
    best: list[str] = []
    reach: dict[str, float] = {}
    # From the ends backwards: what follows is known first. What leads into itself counts once.
    for one in _finished(after):
        reach[one] = length[one] + max((reach.get(other, 0.0) for other in after[one]), default=0.0)
    first = max(lanelets, key=lambda one: reach[one])
    seen: set[str] = set()
    step: str | None = first
    while step is not None and step not in seen:
        best.append(step)
        seen.add(step)
        open_ones = [other for other in after[step] if other not in seen]
        step = max(open_ones, key=lambda one: reach[one], default=None)
    return best


def _finished(after: Mapping[str, list[str]]) -> list[str]:
    """All lanelets, each behind those that follow it but for what runs in circles (depth first)."""
    order: list[str] = []
    state: dict[str, int] = {}
    for start in after:
        stack = [start]
        while stack:
            one = stack[-1]
            if state.get(one, 0) == 0:
                state[one] = 1
                stack += [other for other in after[one] if state.get(other, 0) == 0]
            else:
                stack.pop()
                if state[one] == 1:
                    state[one] = 2
                    order.append(one)
    return order


def _length(lanelet: Element, name: str) -> float:
    return float(np.hypot(*np.diff(_bound(lanelet, "left", name), axis=0).T).sum())
