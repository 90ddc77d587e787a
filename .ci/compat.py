"""The version of everything that lanekeep asks for; exits with an error where ``lowest`` is not what is declared."""

import sys
from importlib.metadata import metadata, requires, version

from packaging.requirements import Requirement
from packaging.version import Version

PINNED = {"torch"}  # to the build without CUDA, see constraints-newest.txt
LEFT_OUT = {"docs", "jax", "ray"}  # too large to be installed for a few tests

extras = {"", *(metadata("lanekeep").get_all("Provides-Extra") or [])} - LEFT_OUT
asked = [Requirement(line) for line in requires("lanekeep") or []]
asked = [
    requirement
    for requirement in asked
    if requirement.name != "lanekeep"
    and (requirement.marker is None or any(requirement.marker.evaluate({"extra": one}) for one in extras))
]
found = {requirement.name: Version(version(requirement.name)) for requirement in asked}
print(f"{sys.argv[1]}: {', '.join(f'{name} {found[name]}' for name in sorted(found))}")

if sys.argv[1] == "lowest":
    bounds = {(r.name, Version(s.version)) for r in asked for s in r.specifier if s.operator == ">="}
    wrong = [
        f"{name}>={bound} declared, {found[name]} installed"
        for name, bound in sorted(bounds)
        if found[name] != bound and name not in PINNED
    ]
    if wrong:
        sys.exit(f"compat: constraints-lowest.txt and pyproject.toml differ ({'; '.join(wrong)}); run make lowest")
