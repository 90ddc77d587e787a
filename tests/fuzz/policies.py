"""Policy files of others, damaged: `python tests/fuzz/policies.py --count 3000 --seed 0`.

Each damaged pair is loaded without and with a scenario, and drives one step where it loads. Nothing but the pair may be
opened, nothing be written; prints a line for the weights, one for the record and one for what is no file, and exits 1
on any violation, each with its seed.
"""

from __future__ import annotations

import argparse
import copy
import hashlib
import json
import re
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import safetensors.numpy
from harness import Watch, drive, mutated, special_files

import lanekeep_agents
import lanekeep_baselines
from lanekeep_agents.binding import trained_scenario
from lanekeep_agents.policy_file import read_record
from lanekeep_env import ENVIRONMENTS

ZOO = Path(lanekeep_agents.__path__[0], "zoo")
Rng = np.random.Generator


class Original(NamedTuple):
    """A policy that is shipped, with the scenario that it drives."""

    record: bytes
    weights: bytes
    scenario: Any


def originals() -> list[Original]:
    """One policy of each kind that is shipped, and for each that corrects no classical one another that does.

    Policies with the same name but for the seed are of a kind. All classical policies are made once, so that nothing
    is left to import while somebody watches.
    """
    found = []
    for name in {name.rpartition("-seed")[0]: name for name in lanekeep_agents.names()}.values():
        file = ZOO / f"{name}.json"
        scenario = trained_scenario(read_record(file))
        found.append(Original(file.read_bytes(), file.with_suffix(".safetensors").read_bytes(), scenario))
        able = lanekeep_baselines.names(scenario)
        if json.loads(found[-1].record)["base"] is None:
            found.append(_corrected(found[-1], able[-1]))
    return found


def _corrected(original: Original, base: str) -> Original:
    """The policy with a base, whose actions it does not look at."""
    values, tensors = json.loads(original.record), safetensors.numpy.load(original.weights)
    before = len(tensors["mean"])
    for name in ("mean", "variance", "layers.0.weight"):
        tensor = tensors[name]
        tensors[name] = np.concatenate([tensor, np.ones_like(tensor[..., : values["actions"]])], axis=-1)
    tensors["layers.0.weight"][:, before:] = 0.0
    weights = safetensors.numpy.save(tensors)
    values |= {"base": base, "bound": 0.2, "sha256": hashlib.sha256(weights).hexdigest()}
    return Original(json.dumps(values).encode(), weights, original.scenario)


def files_of_others(folder: Path) -> list[Any]:
    """Values that name files; ``folder`` has some that nobody may open."""
    files = [str(folder / name) for name in ("secret.csv", "secret.yaml", "pipe", "sparse", "secret")]
    files += ["/dev/zero", "../secret.csv", "secret.csv", "~/secret", "file:///etc/hostname", "\\\\host\\share"]
    return [*files, *({"kind": kind, "path": file} for kind in ("file", "map") for file in files)]


def nasty_values() -> list[Any]:
    """What takes the place of a record's values."""
    deep: Any = 1.0
    for _ in range(200):
        deep = [deep] if len(str(deep)) % 2 else {"base": deep}
    words = [
        "",
        " ",
        "x" * 100_000,
        "a\nb",
        "\ud800",
        "\x1b[2J",
        "\0",
        "__class__",
        "{0}",
        "%s",
        "é" * 300,
        "NaN",
        "../x",
    ]
    numbers = [0, 1, -1, 2, 3, 0.0, -0.0, 0.05, 1e-9, 5e-324, 1e30, 1e308, -1e308, 2**31, 2**63, 10**18, 10**400]
    others = [True, False, None, [], {}, [[]], [None], [1, 2], [2, 1], {"": ""}, {"kind": "sine"}, {"kind": None}, deep]
    large = [list(range(30_000)), {str(k): k for k in range(20_000)}, [[0.0] * 100] * 100, ["x" * 1000] * 500]
    special = [
        float("nan"),
        float("inf"),
        *(f"<{text}>" for text in ("1e999", "-1e999", "9" * 400, "9" * 5000, "1e-999")),
    ]
    return [*words, *numbers, *others, *large, *special]


def places(values: Any) -> list[tuple[Any, Any]]:
    """Every container with every key of it, from the outside inwards."""
    keys = list(values) if isinstance(values, dict) else list(range(len(values))) if isinstance(values, list) else []
    return [pair for key in keys for pair in [(values, key), *places(values[key])]]


class Damage:
    """Draws damaged pairs of a record and weights; ``folder`` has files that nobody may open."""

    def __init__(self, folder: Path) -> None:
        self.originals = originals()
        self._nasty, self._files = nasty_values(), files_of_others(folder)
        self._records = [json.loads(original.record) for original in self.originals]

    def record(self, original: Original, rng: Rng) -> tuple[bytes, bytes]:
        """Damage to the bytes of a record, or to its values, or one value that names a file."""
        draw = rng.random()
        if draw < 0.25:
            return mutated(original.record, rng), original.weights
        values = json.loads(original.record)
        if draw < 0.5:
            inside, key = _draw(places(values["scenario"]), rng)
            if rng.random() < 0.6:
                inside, key = values["scenario"], "road" if "road" in values["scenario"] else "world"
            inside[key] = _draw(self._files, rng)
            return _json(values, rng), original.weights
        for _ in range(_draw([1, 1, 1, 2, 3], rng)):
            # Half of the changes are to the scenario, which most code stands behind, and half to the outermost values.
            part = values.get("scenario") if rng.random() < 0.5 else values
            part = part if isinstance(part, dict) else values
            found = [(part, key) for key in part] if rng.random() < 0.5 else places(part)
            if found:
                self._change(*found[rng.integers(len(found))], rng)
        return _json(values, rng), original.weights

    def _change(self, inside: Any, key: Any, rng: Rng) -> None:
        draw, value = rng.random(), inside[key]
        if draw < 0.1:
            del inside[key]
        elif draw < 0.2 and isinstance(inside, dict):
            inside[_draw(["kind", "base", "path", "road", "world", "x" * 5000, "\ud800"], rng)] = value
        elif draw < 0.4 and isinstance(value, int | float):
            inside[key] = value * float(10.0 ** rng.integers(-9, 10)) * _draw([1, -1], rng)
        elif draw < 0.5:
            others = [(one, k) for record in self._records for one, k in places(record) if k == key]
            one, k = others[rng.integers(len(others))] if others else (inside, key)
            inside[key] = copy.deepcopy(one[k])
        elif draw < 0.6 and isinstance(value, str):
            inside[key] = _draw([*lanekeep_agents.names(), *ENVIRONMENTS, *_BASES, *_WORDS], rng)
        else:
            inside[key] = copy.deepcopy(_draw(self._nasty, rng))

    def weights(self, original: Original, rng: Rng) -> tuple[bytes, bytes]:
        """Damage to the weights; in half of them the record is made to ask for it."""
        change: Callable[[bytes, Rng], bytes] = _draw([mutated, _header, _header, _numbers], rng)
        weights = change(original.weights, rng)
        if rng.random() < 0.5:
            return original.record, weights
        values = json.loads(original.record)
        values["sha256"] = hashlib.sha256(weights).hexdigest()
        return json.dumps(values).encode(), weights


_BASES = lanekeep_baselines.names()
_WORDS = ("random", "sine", "circle", "file", "map", "corridor", "steering_rate", "dynamic", "full", "poor", "stress")


def _draw(pool: Any, rng: Rng) -> Any:
    return pool[rng.integers(len(pool))]


def _json(values: Any, rng: Rng) -> bytes:
    """What is written between <> stands there as it is: numbers that nothing but text can hold."""
    return re.sub(r'"<(\S+?)>"', r"\1", json.dumps(values, indent=_draw([None, 1], rng))).encode()


def _header(weights: bytes, rng: Rng) -> bytes:
    """Another list of tensors: shapes, types, places, names; or another length of it than it has."""
    length = int.from_bytes(weights[:8], "little")
    header, data = json.loads(weights[8 : 8 + length]), weights[8 + length :]
    for _ in range(rng.integers(1, 3)):
        name = _draw(list(header), rng)
        sizes = [0, 1, -1, 2**31, 2**32, 2**62, 2**63, 2**64 - 1, 2**64, 10**30, 1.5, None, "8", [], 4096]
        draw = rng.random()
        if draw < 0.3:
            header[name]["shape"] = [_draw(sizes, rng) for _ in range(rng.integers(0, 4))]
        elif draw < 0.4:
            header[name]["shape"] = [1] * int(_draw([33, 65, 1000], rng)) + header[name]["shape"]
        elif draw < 0.6:
            header[name]["dtype"] = _draw(
                ["F64", "F16", "BF16", "I64", "U8", "BOOL", "F8_E4M3", "C64", "O", "", 1], rng
            )
        elif draw < 0.8:
            header[name]["data_offsets"] = [_draw(sizes + header[name]["data_offsets"], rng) for _ in range(2)]
        elif draw < 0.9:
            header[_draw(["", "x" * 5000, "\ud800", "a\nb", "__metadata__", "layers.9.bias"], rng)] = header.pop(name)
        else:
            empty = {"dtype": "F32", "shape": [0], "data_offsets": [len(data), len(data)]}
            header |= {f"empty{k}": dict(empty) for k in range(_draw([1, 500, 50_000], rng))}
    text = json.dumps(header).encode()
    claimed = len(text) if rng.random() < 0.8 else _draw([0, 1, 2**20, 2**32, 2**63, 2**64 - 1, len(text) - 1], rng)
    return int(claimed).to_bytes(8, "little") + text + data


def _numbers(weights: bytes, rng: Rng) -> bytes:
    """Other numbers in the tensors, and numbers that are none."""
    begin = 8 + int.from_bytes(weights[:8], "little")
    numbers = np.frombuffer(weights[begin:], dtype=np.float32).copy()
    some = rng.integers(len(numbers), size=rng.integers(1, 2000))
    numbers[some] = _draw([np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-45, -1.0, 0.0, 1e20], rng)
    return weights[:begin] + numbers.tobytes()


def use(path: Path, scenario: Any) -> None:
    """Load a policy and drive one step, for its own scenario where none is given."""
    files = path.with_suffix(".json"), path.with_suffix(".safetensors")
    with Watch() as watch, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", module="lanekeep_agents")
        try:
            policy = lanekeep_agents.load(path, scenario)
            bounds = (scenario or trained_scenario(policy.record)).channel_bounds()
            action, _ = policy.predict(bounds.mean(axis=1))
        finally:
            watch.require_only(*files)
    assert action.shape == (policy.record.actions,) and (np.abs(action) <= 1.0).all(), f"action {action}"


def violations(count: int, seed: int, folder: Path) -> list[str]:
    """Drive ``count`` damaged weights and as many damaged records from ``seed`` on; return the violations."""
    (folder / "secret.csv").write_text("".join(f"{10 * k},0\n" for k in range(50)))
    (folder / "secret.yaml").write_text("image: secret.pgm\n")
    (folder / "secret").write_text("nobody's\n")
    specials = list(special_files(folder))
    damage, pair = Damage(folder), folder / "policy.json"
    found = []
    for number, change in enumerate((damage.weights, damage.record)):

        def check(case: tuple[int, bool], number: int = number, change: Any = change) -> None:
            rng = np.random.default_rng([case[0], number])
            original = _draw(damage.originals, rng)
            for file, content in zip((pair, pair.with_suffix(".safetensors")), change(original, rng), strict=True):
                file.write_bytes(content)
            use(pair, original.scenario if case[1] else None)

        cases = [
            (f"{change.__name__}, seed {one}, with{'' if given else 'out'} a scenario", (one, given))
            for one in range(seed, seed + count)
            for given in (False, True)
        ]
        found += drive(check, cases, name=f"{change.__name__} of policies")
    cases = [(f"{end} is {label}", (end, path)) for label, path in specials for end in (".json", ".safetensors")]
    return found + drive(lambda case: _special(folder, *case), cases, name="policies that are no files")


def _special(folder: Path, end: str, path: Path) -> None:
    """One file of a good pair is a link to something that is no file, or has its name; it must be refused."""
    name = lanekeep_agents.names()[0]
    pair = {one: folder / f"linked{one}" for one in (".json", ".safetensors")}
    for one, file in pair.items():
        file.unlink(missing_ok=True)
        shutil.copy(ZOO / f"{name}{one}", file)
    pair[end].unlink()
    try:
        pair[end].symlink_to(path)
    except OSError:  # there can be no such link
        pair[end] = path.with_name(path.name + end)
    use(pair[end], None)
    raise AssertionError("it was read")


def main() -> None:
    """Print a line for each kind of damage; exit 1 where anything was violated."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=3000, help="of damaged weights, and of damaged records")
    parser.add_argument("--seed", type=int, default=0, help="of the first")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        sys.exit(bool(violations(arguments.count, arguments.seed, Path(folder))))


if __name__ == "__main__":
    main()
