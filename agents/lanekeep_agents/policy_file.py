"""Files of learned policies: `NAME.json`, what the policy is, and `NAME.safetensors`, its weights.

Nothing in them is ever executed or unpickled, and all of it is checked before it is used.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from lanekeep_agents.foreign import named, one_line
from lanekeep_agents.policy_record import PolicyRecord
from lanekeep_env.checks import shown
from lanekeep_env.files import read_bounded, write_atomic

#: Sizes beyond which files are not read, bytes.
LARGEST_RECORD = 1 << 20
LARGEST_WEIGHTS = 1 << 26
#: And that of the list of tensors at the start of the weights; no policy's is a twentieth of that.
LARGEST_HEADER = 1 << 16

#: Size of observations for which a network must stay in range, far beyond that of any channel; and that range.
LARGEST_INPUT = 1e6
LARGEST_NUMBER = 1e38

Tensors = dict[str, NDArray[np.float32]]


def read_record(path: str | Path) -> PolicyRecord:
    """Read `NAME.json` alone; ``path`` as for `read_policy`."""
    file, _ = _files(path)
    content = _content(file, LARGEST_RECORD)
    try:
        values = json.loads(content, parse_constant=_no_constant, object_pairs_hook=_no_twins)
        return PolicyRecord.from_dict(values)
    except RecursionError:
        raise ValueError(f"{named(file)}: nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"{named(file)}: {one_line(error)}") from None


def read_policy(path: str | Path) -> tuple[PolicyRecord, Tensors]:
    """Read a policy from its pair of files.

    Args:
        path: of either file.

    Returns:
        The record, and the tensors that it asks for: float32, finite.

    Raises:
        ValueError: a file is missing, or anything in it is wrong; names the file, the field, the value and what is
            allowed.
        ImportError: safetensors is not installed; names the extra that brings it.
    """
    record = read_record(path)
    file = _files(path)[1]
    content = _content(file, LARGEST_WEIGHTS)
    sha256 = hashlib.sha256(content).hexdigest()
    if sha256 != record.sha256:
        raise ValueError(f"{named(file)}: sha256={sha256!r} is not allowed: its record asks for {record.sha256!r}")
    numpy_safetensors = _safetensors()
    try:
        header = int.from_bytes(content[:8], "little")
        if header > LARGEST_HEADER:
            raise ValueError(f"its header has {header} bytes, allowed are {LARGEST_HEADER}")
        tensors = dict(numpy_safetensors.load(content))
    except Exception as error:  # safetensors raises errors of its own, KeyError and more
        raise ValueError(f"{named(file)}: not a safetensors file ({one_line(error)})") from None
    try:
        check_tensors(record, tensors)
    except ValueError as error:
        raise ValueError(f"{named(file)}: {one_line(error)}") from None
    return record, tensors


def write_policy(
    path: str | Path, record: PolicyRecord, tensors: Mapping[str, NDArray[np.float32]], overwrite: bool = False
) -> PolicyRecord:
    """Write a policy's pair of files, each atomically; return the record with the sum of the weights' file.

    Args:
        path: of either file.
        record: its ``sha256`` is filled in.
        tensors: those that the record asks for, float32.
        overwrite: replace what is there.

    Raises:
        ValueError: one of the files exists and ``overwrite`` is not set, the tensors are not those that the record asks
            for, or a file would be larger than what is read.
        ImportError: safetensors is not installed; names the extra that brings it.
    """
    files = _files(path)
    for file in files:
        if file.exists() and not overwrite:
            raise ValueError(f"{named(file)} exists; name another file, or pass overwrite=True to replace it")
    check_tensors(record, tensors)
    weights = _safetensors().save({name: np.ascontiguousarray(tensor) for name, tensor in tensors.items()})
    record = record.with_sha256(hashlib.sha256(weights).hexdigest())
    content = (json.dumps(record.to_dict(), indent=1, allow_nan=False) + "\n").encode()
    for file, data, largest in zip(files, (content, weights), (LARGEST_RECORD, LARGEST_WEIGHTS), strict=True):
        if len(data) > largest:
            raise ValueError(f"{named(file)}: it would have {len(data)} bytes, allowed are {largest}")
    # A writer that is killed in between leaves a record that does not fit, or none: never another policy.
    write_atomic(files[1], weights)
    write_atomic(files[0], content)
    return record


def check_tensors(record: PolicyRecord, tensors: Mapping[str, Any]) -> None:
    """Raise ValueError unless the tensors are those that the record asks for: names, shapes, float32, and finite, they
    as well as all that the network makes of them."""
    shapes = record.shapes
    if set(tensors) != set(shapes):
        raise ValueError(
            f"tensors {one_line(', '.join(sorted(tensors)))} are not allowed: they must be {', '.join(sorted(shapes))}"
        )
    for name, shape in shapes.items():
        tensor = tensors[name]
        if tensor.shape != shape:
            raise ValueError(f"{name} has shape {shown(tensor.shape)}, allowed: {shape}")
        if tensor.dtype != np.float32:
            raise ValueError(f"{name} has dtype {tensor.dtype}, allowed: float32")
        if not np.isfinite(tensor).all():
            raise ValueError(f"{name} holds {tensor[~np.isfinite(tensor)][0]}, allowed: finite numbers")
    if record.student is not None:  # which sums in float64, far from its range
        return
    if (tensors["variance"] < 0.0).any():
        raise ValueError(f"variance holds {tensors['variance'].min()}, allowed: numbers >= 0")
    _check_sizes(record, tensors)


def _check_sizes(record: PolicyRecord, tensors: Mapping[str, Any]) -> None:
    """Raise ValueError where numbers of the network could leave float32's range: NaN would come of that."""
    scale = np.sqrt(tensors["variance"].astype(np.float64) + record.normalisation.epsilon)
    sizes = (LARGEST_INPUT + np.abs(tensors["mean"].astype(np.float64))) / scale
    _require_size("mean and variance", sizes)
    sizes = np.minimum(sizes, record.normalisation.clip)
    for i in range(len(record.network.hidden) + 1):
        weight, bias = (np.abs(tensors[f"layers.{i}.{part}"].astype(np.float64)) for part in ("weight", "bias"))
        # No partial sum is larger, in whatever order.
        sizes = weight @ sizes + bias
        _require_size(f"layers.{i}", sizes)
        if record.network.activation == "tanh":
            sizes = np.ones_like(sizes)


def _require_size(name: str, sizes: NDArray[np.float64]) -> None:
    if sizes.max() > LARGEST_NUMBER:
        raise ValueError(
            f"{name} can lead to numbers of {sizes.max():.3g}, allowed are {LARGEST_NUMBER:.3g} at the most"
        )


def _files(path: str | Path) -> tuple[Path, Path]:
    """Both files of a policy by the path of either."""
    path = Path(path)
    if path.suffix not in (".json", ".safetensors"):
        raise ValueError(f"path {shown(str(path))} is not allowed: it must end in .json or .safetensors")
    return path.with_suffix(".json"), path.with_suffix(".safetensors")


def _content(file: Path, largest: int) -> bytes:
    """The content of an ordinary file that is not larger than a policy's can be."""
    try:
        return read_bounded(file, largest)
    except FileNotFoundError:
        raise ValueError(
            f"{named(file)} is missing; a learned policy is a pair of files, .json and .safetensors"
        ) from None
    except OSError as error:
        raise ValueError(f"{named(file)} cannot be read: {error.strerror}") from None
    except ValueError as error:
        raise ValueError(f"{named(file)}: {error}") from None


def _no_constant(text: str) -> NoReturn:
    raise ValueError(f"{text} is not allowed: numbers must be finite")


def _no_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name, value in pairs:
        if name in values:
            raise ValueError(f"{shown(name)} appears twice")
        values[name] = value
    return values


def _safetensors() -> Any:
    try:
        import safetensors.numpy
    except ModuleNotFoundError as error:
        raise ImportError(f'{error.name} is missing: pip install "lanekeep[agents]"') from error
    return safetensors.numpy
