"""The activations of a policy file's hidden layers, by name, in numpy; each works in place."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Layer = NDArray[np.floating]

#: Of SELU (Klambauer et al., "Self-normalizing neural networks", 2017).
_SELU_ALPHA, _SELU_SCALE = 1.6732632423543772, 1.0507009873554805
_ONE = 1.0


def _relu(y: Layer) -> None:
    y.clip(0.0, np.inf, out=y)  # three times as fast as np.maximum with a number


def _tanh(y: Layer) -> None:
    np.tanh(y, out=y)


def _sigmoid(y: Layer) -> None:
    y *= 0.5  # as half a tanh it overflows nowhere
    np.tanh(y, out=y)
    y += _ONE
    y *= 0.5


def _silu(y: Layer) -> None:
    share = y.copy()
    _sigmoid(share)
    y *= share


def _softplus(y: Layer) -> None:
    np.logaddexp(y, 0.0, out=y)


def _mish(y: Layer) -> None:
    share = y.copy()
    _softplus(share)
    np.tanh(share, out=share)
    y *= share


def _elu(y: Layer) -> None:
    below = np.expm1(np.minimum(y, 0.0))
    _relu(y)
    y += below


def _selu(y: Layer) -> None:
    below = np.expm1(np.minimum(y, 0.0))
    below *= _SELU_ALPHA
    _relu(y)
    y += below
    y *= _SELU_SCALE


def _leaky_relu(y: Layer) -> None:
    np.maximum(y, y * 0.01, out=y)


def _softsign(y: Layer) -> None:
    y /= np.abs(y) + _ONE


ACTIVATIONS: dict[str, Callable[[Layer], None]] = {
    "relu": _relu,
    "tanh": _tanh,
    "sigmoid": _sigmoid,
    "silu": _silu,
    "softplus": _softplus,
    "mish": _mish,
    "elu": _elu,
    "selu": _selu,
    "leaky_relu": _leaky_relu,
    "softsign": _softsign,
}
