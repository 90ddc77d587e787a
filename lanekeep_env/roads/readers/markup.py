"""XML of others as a tree: no entities, no document types, bounded depth and size."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from lanekeep_env.checks import shown

DEEPEST = 100
#: Some 200 bytes each.
MOST_ELEMENTS = 1_000_000


def parse_xml(content: bytes, name: str) -> Element:
    """Return the root of an XML document, its tags without namespaces; ``name`` is what errors call the file.

    Raises:
        ValueError: it is no XML, declares a document type (entities grow beyond bounds, or fetch files), or is larger
            or deeper than any map of roads.
    """
    builder, depth, count = TreeBuilder(), 0, 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > DEEPEST or count > MOST_ELEMENTS:
            raise ValueError(f"{name} holds more than {MOST_ELEMENTS} elements, or {DEEPEST} in each other")
        builder.start(tag.rpartition(" ")[2], attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag.rpartition(" ")[2])

    def doctype(*_: object) -> None:
        raise ValueError(f"{name} declares a document type (DOCTYPE), which is not allowed; take that line out")

    parser = expat.ParserCreate(namespace_separator=" ")
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = builder.data, doctype
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        problem = expat.ErrorString(error.code) or "it cannot be read"
        raise ValueError(f"{name} is not XML: line {error.lineno}: {problem}") from None
    except (LookupError, UnicodeError):
        raise ValueError(f"{name} is not XML in an encoding that is known; write it in UTF-8") from None
    return builder.close()


def number(element: Element, key: str, name: str, default: float | None = None) -> float:
    """Return a number from an attribute; ValueError where it is missing or none that is finite."""
    text = element.get(key)
    if text is None:
        if default is not None:
            return default
        raise ValueError(f"{name}: <{element.tag}> lacks {key}")
    return as_number(text, f"{name}: <{element.tag}> {key}")


def as_number(text: str | None, what: str) -> float:
    """Return a finite number in ASCII digits; ``what`` is what errors call it."""
    try:
        value = float(text or "") if (text or "").isascii() and "_" not in (text or "") else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{what}={shown(text)} is not a finite number")
    return value
