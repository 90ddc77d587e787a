"""What numbers were computed with: the processor and the versions of the packages."""

from __future__ import annotations

import platform
from importlib.metadata import version

#: Packages whose versions may change a result's last digits.
PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "gymnasium")


def this_machine() -> dict[str, str]:
    """Return processor (as its kernels are compiled for), system and versions, by name."""
    from llvmlite.binding import get_host_cpu_name

    return {
        "processor": f"{platform.machine()}, {get_host_cpu_name()}",
        "system": platform.system(),
        "python": platform.python_version(),
        **{package: version(package) for package in PACKAGES},
    }
