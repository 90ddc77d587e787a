"""Which of an OpenDRIVE file's roads are driven one after the other, and which way."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree.ElementTree import Element

from lanekeep_env.checks import shown
from lanekeep_env.roads.readers.markup import number

#: A road and whether it is driven in the direction of its reference line.
Link = tuple[str, bool]
_MOST_ROADS = 10_000


def chain(root: Element, roads: Mapping[str, Element], track: str | None, name: str) -> tuple[list[Link], str]:
    """Return the roads in the order they are driven, and how they were chosen.

    ``track`` names them, "3, 7, 4"; without, it is the longest road with what follows it, through junctions along the
    first of their connections, until a road comes again.

    Raises:
        ValueError: a road is not there, or does not follow the one before it.
    """
    if track is not None:
        wanted = [one.strip() for one in track.split(",")]
        for one in wanted:
            if one not in roads:
                raise ValueError(f"{name}: track: road {shown(one)} is not there; allowed: {_some(list(roads))}")
        return _following(root, roads, wanted, name), "roads " + ", ".join(map(_short, wanted))
    lengths = {one: number(road, "length", name, 0.0) for one, road in roads.items()}
    # Not inside a junction: there several roads lie on each other.
    outside = [one for one, road in roads.items() if road.get("junction", "-1") == "-1"] or list(roads)
    first = max(outside, key=lambda one: lengths[one])
    links, seen = [(first, True)], {first}
    while len(links) < _MOST_ROADS:
        after = [link for link in _successors(root, roads, links[-1]) if link[0] not in seen]
        if not after:
            break
        links.append(after[0])
        seen.add(after[0][0])
    listed = ", ".join(_short(one) for one, _ in links[:8]) + (" ..." if len(links) > 8 else "")
    return links, f"of {len(roads)} roads: {listed} (track= takes others)"


def _following(root: Element, roads: Mapping[str, Element], wanted: list[str], name: str) -> list[Link]:
    """The directions in which the wanted roads follow one another."""
    for onward in (True, False):
        links = [(wanted[0], onward)]
        for one in wanted[1:]:
            after = next((link for link in _successors(root, roads, links[-1]) if link[0] == one), None)
            if after is None:
                break
            links.append(after)
        if len(links) == len(wanted):
            return links
    at = links[-1][0]
    raise ValueError(f"{name}: track: road {shown(wanted[len(links)])} does not follow road {shown(at)}")


def _successors(root: Element, roads: Mapping[str, Element], link: Link) -> list[Link]:
    """Roads that follow one, with the direction in which they are driven."""
    one, onward = link
    found = roads[one].find(f"link/{'successor' if onward else 'predecessor'}")
    if found is None:
        return []
    other = found.get("elementId", "")
    if found.get("elementType", "road") == "road":
        return [(other, found.get("contactPoint", "start") == "start")] if other in roads else []
    after = []
    for junction in root.findall("junction"):
        if junction.get("id") == other:
            for connection in junction.findall("connection"):
                way = connection.get("connectingRoad", "")
                if connection.get("incomingRoad") == one and way in roads:
                    after.append((way, connection.get("contactPoint", "start") == "start"))
    return after


def _some(names: list[str]) -> str:
    return ", ".join(map(_short, names[:10])) + (f" and {len(names) - 10} more" if len(names) > 10 else "")


def _short(text: str) -> str:
    return text if text.isprintable() and len(text) <= 20 else shown(text)[:20]
