"""What a kernel's key counts: all that is compiled, by name and value, and nothing else."""

import ast
import importlib
import os
import pkgutil
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest
from numba.core.dispatcher import Dispatcher

import lanekeep_env
from lanekeep_env.compile import inline, kernel
from lanekeep_env.engine.effort import by_motor
from lanekeep_env.engine.step import step_kernels
from lanekeep_env.families.road.cars import RoadCars
from lanekeep_env.families.road.disturbed import disturbed
from lanekeep_env.families.road.drive_kernel import DRIVING
from lanekeep_env.families.road.guided import GUIDED
from lanekeep_env.families.road.kernel import ON_ROADS
from lanekeep_env.families.road.support import WITH_DRIVER
from lanekeep_env.families.road.traffic_kernel import AMONG_TRAFFIC
from lanekeep_env.families.wall.course import ON_COURSES
from lanekeep_env.families.wall.kernel import BETWEEN_WALLS
from lanekeep_env.fingerprint import COMPILED_WITH, fingerprint
from lanekeep_env.kernel_cache import KernelCache
from lanekeep_env.physics import models, numeric
from lanekeep_env.physics.integrate import DRIVEN, PACED, PROFILE

PACKAGE = Path(lanekeep_env.__file__).parent
DECORATORS = {"inline", "inline_as_written", "helper", "helper_as_written", "kernel"}


def modules():
    """The modules in which something is compiled."""
    for found in pkgutil.walk_packages([str(PACKAGE)], "lanekeep_env."):
        path = PACKAGE.joinpath(*found.name.split(".")[1:])
        path = path / "__init__.py" if found.ispkg else path.with_suffix(".py")
        if "lanekeep_env.compile import" in path.read_text("utf-8"):
            yield importlib.import_module(found.name)


MODULES = list(modules())
KERNELS = [
    value
    for module in MODULES
    for value in vars(module).values()
    if isinstance(value, Dispatcher)
    and isinstance(value._cache, KernelCache)
    and not value.targetoptions.get("no_cpython_wrapper")  # which Python calls
    and value.__module__ == module.__name__
]
MODELS = [model for model in vars(models).values() if isinstance(model, models.CarModel)]
KERNELS += [made for model in MODELS if model.pace != DRIVEN for made in step_kernels(model, ON_ROADS, 1)]
KERNELS += [
    made
    for model in MODELS
    if model.pace == DRIVEN
    for family in (DRIVING, AMONG_TRAFFIC)
    for made in step_kernels(model, family, 2)
]
KERNELS += [
    made for model in MODELS if model.pace == PACED for n in (1, 2) for made in step_kernels(model, BETWEEN_WALLS, n)
]
KERNELS += [made for model in MODELS if model.pace == PACED for made in step_kernels(model, ON_COURSES, 2)]
KERNELS += [made for model in MODELS if model.pace == PROFILE for made in step_kernels(model, WITH_DRIVER, 2)]
KERNELS += step_kernels(models.FRONT_DRIVEN, GUIDED, 1)
DISTURBED = [disturbed(family, RoadCars.axle_rows, RoadCars.asked_rows) for family in (ON_ROADS, DRIVING)]
for model, family, n in zip((models.LINEAR, models.POWERED), DISTURBED, (1, 2), strict=True):
    KERNELS += step_kernels(models.with_pushes(model), family, n)
KERNELS += step_kernels(models.LINEAR, by_motor(ON_ROADS), 1)


def fingerprints():
    return {f"{kernel.__module__}.{kernel.py_func.__name__}": fingerprint(kernel) for kernel in KERNELS}


BEFORE = fingerprints()


_ORDER = list(zip(KERNELS, BEFORE.values(), strict=True))


def some_kernel_changes():
    for place, (one, before) in enumerate(_ORDER):
        if fingerprint(one) != before:
            _ORDER.insert(0, _ORDER.pop(place))  # the next one is likely to be read there, too
            return True
    return False


def test_kernels_have_keys_of_their_own():
    assert len(KERNELS) >= 15 and len(set(BEFORE.values())) == len(KERNELS)
    assert fingerprints() == BEFORE


def compiled_functions():
    """Every function of the package that is compiled when a kernel is; closures of the factories as well."""
    for module in MODULES:
        for name, value in vars(module).items():
            function = value.py_func if isinstance(value, Dispatcher) else value
            if value in KERNELS or function.__class__.__name__ != "function" or function.__module__ != module.__name__:
                continue
            if isinstance(value, Dispatcher) or hasattr(function, COMPILED_WITH):
                yield f"{module.__name__}.{name}", function


@pytest.mark.parametrize("name, function", list(compiled_functions()))
def test_an_edit_of_a_compiled_function_counts(name, function, monkeypatch):
    code = function.__code__
    monkeypatch.setattr(function, "__code__", code.replace(co_consts=(*code.co_consts, 0.123)))
    assert some_kernel_changes(), name


def constants():
    """Every constant that the source of a compiled function mentions: (module that holds it, its name)."""
    found = set()
    for module in MODULES:
        for definition in ast.walk(ast.parse(Path(module.__file__).read_text("utf-8"))):
            if not isinstance(definition, ast.FunctionDef) or not decorated(definition):
                continue
            for node in ast.walk(definition):
                if isinstance(node, ast.Name) and isinstance(vars(module).get(node.id), int | float | tuple):
                    found.add((module.__name__, node.id))
                if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "at":
                    found.add(("lanekeep_env.layout", node.attr))
    return sorted(found)


def decorated(definition):
    calls = [node.func if isinstance(node, ast.Call) else node for node in definition.decorator_list]
    return any(isinstance(call, ast.Name) and call.id in DECORATORS for call in calls)


def test_a_change_of_any_constant_that_kernels_read_counts(monkeypatch):
    found = constants()
    assert len(found) > 100 and ("lanekeep_env.physics.powertrain", "GRAVITY") in found
    for module, name in found:
        with monkeypatch.context() as patch:
            patch.setattr(sys.modules[module], name, -0.123)
            assert some_kernel_changes(), (module, name)


def test_what_stands_beside_a_stub_counts(monkeypatch):
    """`like` is compiled from what numba was told, not from its own code."""
    code = numeric._lower_like.__code__
    monkeypatch.setattr(numeric._lower_like, "__code__", code.replace(co_consts=(*code.co_consts, 0.123)))
    assert all(fingerprint(kernel) != before for kernel, before in zip(KERNELS, BEFORE.values(), strict=True))


FACTOR = 2.0


@inline
def _scaled(x):
    return FACTOR * x


def made(factor):
    def run(x):
        return _scaled(x) * factor

    return run


def test_options_and_closures_count(monkeypatch):
    plain = fingerprint(kernel()(made(2.0)))
    assert fingerprint(kernel()(made(2.0))) == plain
    others = [kernel()(made(2)), kernel()(made(3.0)), kernel(parallel=True)(made(2.0)), numba.njit(made(2.0))]
    assert len({plain, *map(fingerprint, others)}) == 1 + len(others)
    monkeypatch.setattr(_scaled, COMPILED_WITH, {})
    assert fingerprint(kernel()(made(2.0))) != plain
    monkeypatch.undo()
    monkeypatch.setitem(globals(), "FACTOR", 2)  # which is compiled for another type
    assert fingerprint(kernel()(made(2.0))) != plain


PRINT = """
import sys
import lanekeep_env.walls.raycast
from lanekeep_env.engine.effort import by_motor
from lanekeep_env.engine.step import step_kernels
from lanekeep_env.families.road.cars import RoadCars
from lanekeep_env.families.road.disturbed import disturbed
from lanekeep_env.families.road.drive_kernel import DRIVING
from lanekeep_env.families.road.guided import GUIDED
from lanekeep_env.families.road.kernel import ON_ROADS
from lanekeep_env.families.road.support import WITH_DRIVER
from lanekeep_env.families.road.traffic_kernel import AMONG_TRAFFIC
from lanekeep_env.families.wall.course import ON_COURSES
from lanekeep_env.families.wall.kernel import BETWEEN_WALLS
from lanekeep_env.fingerprint import fingerprint
from lanekeep_env.kernel_cache import KernelCache
from lanekeep_env.physics import models
for name in sorted(sys.modules):
    for value in list(vars(sys.modules[name]).values()) if name.startswith("lanekeep_env.") else ():
        kept = isinstance(getattr(value, "_cache", None), KernelCache) and value.__module__ == name
        if kept and not value.targetoptions.get("no_cpython_wrapper"):
            print(f"{name}.{value.py_func.__name__}", fingerprint(value))
for model in [model for model in vars(models).values() if isinstance(model, models.CarModel)]:
    powered = model.pace == models.DRIVEN
    made = list(step_kernels(model, DRIVING if powered else ON_ROADS, 2 if powered else 1))
    if powered:
        made += step_kernels(model, AMONG_TRAFFIC, 2)
    if model.pace == models.PACED:
        made += [*step_kernels(model, BETWEEN_WALLS, 1), *step_kernels(model, BETWEEN_WALLS, 2)]
        made += step_kernels(model, ON_COURSES, 2)
    if model.pace == models.PROFILE:
        made += step_kernels(model, WITH_DRIVER, 2)
    if model is models.FRONT_DRIVEN:
        made += step_kernels(model, GUIDED, 1)
    for value in made:
        print(f"{value.__module__}.{value.py_func.__name__}", fingerprint(value))
for model, own, n in ((models.LINEAR, ON_ROADS, 1), (models.POWERED, DRIVING, 2)):
    family = disturbed(own, RoadCars.axle_rows, RoadCars.asked_rows)
    for value in step_kernels(models.with_pushes(model), family, n):
        print(f"{value.__module__}.{value.py_func.__name__}", fingerprint(value))
for value in step_kernels(models.LINEAR, by_motor(ON_ROADS), 1):
    print(f"{value.__module__}.{value.py_func.__name__}", fingerprint(value))
"""


class _Reworded(ast.NodeTransformer):
    """Gives every docstring other words."""

    def visit_FunctionDef(self, node):
        self.generic_visit(node)
        if ast.get_docstring(node) is not None:
            node.body[0] = ast.Expr(ast.Constant("Other words."))
        return node

    visit_ClassDef = visit_Module = visit_FunctionDef


def edited(package, edit):
    for path in package.rglob("*.py"):
        path.write_text(edit(path.relative_to(package).as_posix(), path.read_text("utf-8")), "utf-8")


EDITS = {
    "comments, docstrings, formatting": lambda name, text: (
        "# new\n\n" + ast.unparse(_Reworded().visit(ast.parse(text)))
    ),
    "what no kernel reads": lambda name, text: text if name in HASHED else text + "\n_NEW = 1\n",
    "gravity": lambda name, text: text.replace("\nGRAVITY = 9", "\nGRAVITY = 8"),
    "a tyre": lambda name, text: text.replace("like(", "0.5 * like(") if name == "physics/tyres.py" else text,
}
HASHED = {Path(module.__file__).relative_to(PACKAGE).as_posix() for module in MODULES} | {
    f"layout/{part}.py" for part in ("cars", "outcome", "settings", "tables")
}
#: The kernels that an edit changes: an episode starts with a load on the axles; some have saturating tyres.
CHANGED = {
    "comments, docstrings, formatting": lambda name: False,
    "what no kernel reads": lambda name: False,
    "gravity": lambda name: "env.walls." not in name and "env.traffic." not in name,
    "a tyre": lambda name: "magic_formula" in name or "powered" in name or "load_sensitive" in name,
}


@pytest.mark.parametrize("edit", EDITS)
def test_edits_of_files(tmp_path, edit):
    """A process with edited sources has new keys for the kernels that read what was edited, and for no others."""
    package = tmp_path / "lanekeep_env"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    edited(package, EDITS[edit])
    out = subprocess.run(
        [sys.executable, "-B", "-c", PRINT],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    after = dict(line.split() for line in out.stdout.splitlines())
    assert set(after) == set(BEFORE)
    for name, before in BEFORE.items():
        assert (after[name] != before) == CHANGED[edit](name), name
