"""The tested set pins what every extra names."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: Large, and installed by hand where they are tried.
UNPINNED = {"jax", "ray"}


def name(requirement):
    return re.split(r"[\[<>=;! ]", requirement)[0].lower().replace("_", "-")


def test_every_package_of_every_extra_is_pinned():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    named = {name(one) for extra in project["optional-dependencies"].values() for one in extra}
    named |= {name(one) for one in project["dependencies"]}
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    pinned = {name(line) for line in lines if re.fullmatch(r"[\w.-]+==[\w.]+", line)}
    assert named - pinned == UNPINNED | {"lanekeep"}
    assert all(line.startswith("#") or name(line) in pinned for line in lines)
