"""Stretches: heading and position of a run, which only integrate, compared over some seconds at a time.

Over a minute, noise of the measured speed (or wind, or a sloping road) moves heading and position by more than the
sensors' noise; a fit over the whole run would bend the parameters to explain that (2 cm/s of speed noise: errors six
times their standard errors). So each stretch of the simulation starts at the measured heading and position. What the
noise of these does to the rest of the stretch is known: an offset of the start in x or y shifts all its positions, one
in heading turns them about the start. These three directions are projected out of the weighted residuals, which is the
same as fitting the three start values (to first order in them), at no cost.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lanekeep_baselines.identification.run import DrivenRun
from lanekeep_baselines.policy import Floats


class Stretches:
    """A run cut into stretches.

    Attributes:
        length: samples in a stretch.
        names: of the residuals: as measured, but "along" and "across" the measured heading for "x" and "y", so that R
            can tell apart what the speed's noise blurs and what it does not.
        anchor: measured heading, x and y, (samples, 3); 0 where not measured.
    """

    def __init__(self, run: DrivenRun, measured: Sequence[str], seconds: float | None) -> None:
        count = len(run.speed)
        pieces = 1 if seconds is None else max(1, round(run.seconds / seconds))
        self.length = -(-count // pieces)
        self.names = list(measured)
        zero = np.zeros(count)
        self.anchor = np.stack([zero if a is None else a for a in (run.heading, run.x, run.y)], axis=1)
        self._sine, self._cosine = np.sin(self.anchor[:, 0]), np.cos(self.anchor[:, 0])
        self._turns = "x" in measured and "y" in measured
        if self._turns:
            self.names[-2:] = "along", "across"
        velocity = run.speed[:, None] * np.stack([self._cosine, self._sine], axis=1)
        way = np.cumsum(velocity, axis=0) * run.step
        way -= way[np.arange(count) // self.length * self.length]
        one = np.ones(count)
        moves = np.zeros((3, count, len(measured)))
        effects = ({"heading": one, "x": -way[:, 1], "y": way[:, 0]}, {"x": one}, {"y": one})
        for move, effect in zip(moves, effects, strict=True):
            for name in set(effect) & set(measured):
                move[:, measured.index(name)] = effect[name]
        self._moves = self.turned(moves)[moves.any(axis=(1, 2))]
        self._bases: list[Floats] = []
        self.deviations = np.ones(len(measured))
        self.weigh(self.deviations)

    def turned(self, errors: Floats) -> Floats:
        """Turn errors (..., samples, measurements) in x and y into along and across, in place; return them."""
        if self._turns:
            x, y = errors[..., -2].copy(), errors[..., -1].copy()
            errors[..., -2] = self._cosine * x + self._sine * y
            errors[..., -1] = self._cosine * y - self._sine * x
        return errors

    def weigh(self, deviations: Floats) -> None:
        """Set the standard deviations (measurements,) that `weighted` divides by."""
        self.deviations = deviations
        moves = self._moves / deviations
        starts = range(0, moves.shape[1], self.length) if len(moves) else ()
        pieces = [moves[:, k : k + self.length].reshape(len(moves), -1) for k in starts]
        self._bases = [np.linalg.qr(piece.T)[0] for piece in pieces]

    @property
    def fitted(self) -> int:
        """Number of start values that the projection fits."""
        return sum(basis.shape[1] for basis in self._bases)

    def weighted(self, errors: Floats) -> Floats:
        """Return errors (points, samples, measurements) over the deviations, less what the starts explain."""
        errors = errors / self.deviations
        for k, basis in enumerate(self._bases):
            piece = errors[:, k * self.length : (k + 1) * self.length]
            flat = piece.reshape(len(errors), -1)
            piece -= (flat @ basis @ basis.T).reshape(piece.shape)
        return errors
