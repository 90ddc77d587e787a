"""YAML of others as plain values: nothing executed, everything said once, numbers as YAML 1.2 has them; all bounded."""

from __future__ import annotations

import re
from typing import Any

from lanekeep_env.checks import shown

_DEEPEST = 10
_LONGEST_VALUE = 4096
_NUMBERS = {
    "int": r"[-+]?(?:0|[1-9]\d*)$",
    "float": r"[-+]?(?:(?:\d+\.\d*|\.\d+)(?:[eE][-+]?\d+)?|\d+[eE][-+]?\d+|\.(?:inf|Inf|INF))$|\.(?:nan|NaN|NAN)$",
}


def parse_yaml(content: bytes, most: int, holds: str, extra: str) -> Any:
    """Read YAML that says everything once: aliases and merge keys grow beyond bounds, tags ask for any type.

    Args:
        content: of the file.
        most: events (values, begins and ends of lists and mappings) that it may have.
        holds: what is expected, for errors.
        extra: of the package that brings PyYAML.

    Raises:
        ValueError: one line without the file's name, for the caller to put it in front.
    """
    try:
        import yaml
    except ImportError:
        raise ValueError(f"YAML needs PyYAML: pip install 'lanekeep[{extra}]'") from None
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        raise ValueError(f"it is not a text file; expected YAML with {holds}") from None

    class Loader(yaml.SafeLoader):  # type: ignore[misc]
        """YAML 1.2's numbers (PyYAML takes 5e-2 for a word and 1:20 for eighty), no dates, and no name twice."""

        yaml_implicit_resolvers = {  # noqa: RUF012
            key: [pair for pair in pairs if pair[0].rpartition(":")[2] not in ("int", "float", "timestamp")]
            for key, pairs in yaml.SafeLoader.yaml_implicit_resolvers.items()
        }

        def construct_mapping(self, node: Any, deep: bool = False) -> Any:
            names: set[str] = set()
            for name, _ in node.value:
                if str(name.value) in names:
                    raise ValueError(f"line {name.start_mark.line + 1}: {shown(name.value)} appears twice")
                names.add(str(name.value))
            return super().construct_mapping(node, deep)

    for tag, form in _NUMBERS.items():
        Loader.add_implicit_resolver(f"tag:yaml.org,2002:{tag}", re.compile(form), list("-+.0123456789"))
    depth = 0
    try:
        for count, event in enumerate(yaml.parse(text, Loader=Loader)):
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
            line = f"line {event.start_mark.line + 1}"
            value = getattr(event, "value", "")
            if getattr(event, "anchor", None) is not None or getattr(event, "tag", None) is not None or value == "<<":
                raise ValueError(f"{line}: anchors, aliases, merge keys and tags are not allowed")
            if count > most or depth > _DEEPEST or len(value) > _LONGEST_VALUE:
                raise ValueError(f"{line}: it holds more than {holds}")
        return yaml.load(text, Loader=Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = "" if mark is None else f"line {mark.line + 1}: "
        problem = getattr(error, "problem", None) or getattr(error, "reason", None) or "it cannot be read"
        raise ValueError(f"it is not YAML: {place}{' '.join(ascii(problem)[1:-1].split())[:200]}") from None
    except (ArithmeticError, LookupError) as error:  # of values that look like numbers or dates and are none
        raise ValueError(f"a value cannot be read: {error}") from None
