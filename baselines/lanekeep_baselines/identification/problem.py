"""The least-squares problem behind `identify`: residuals, their derivatives, R, and what the minimum tells."""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from lanekeep_baselines.identification.result import PARAMETERS, Identification
from lanekeep_baselines.identification.run import DrivenRun, UnusableRun
from lanekeep_baselines.identification.simulate import OUTPUTS, Inputs, simulate
from lanekeep_baselines.identification.stretches import Stretches
from lanekeep_baselines.policy import Floats

#: Natural size of each parameter (b1, b2 for the road wheel) and of each start value: of a passenger car.
_SIZE = np.array([100.0, 50.0, 30.0, 100.0, 40.0, 30.0, 0.1, 0.1, 0.05, 0.1])
#: A parameter is not identifiable if its standard error exceeds this share of its natural size.
_LARGEST_ERROR = 0.5
#: R stands when no standard deviation in it changes by more than this share; rounds it gets for that.
_SETTLED, _ROUNDS = 0.01, 12
_DIFFERENCE = 1e-5  # step of the central differences, in natural sizes
_LEAST_DEVIATION = 1e-9  # of a noiseless measurement, SI


class Problem:
    """One run as a least-squares problem in scaled unknowns: parameters, start values, biases.

    Attributes:
        point: where the search stands: the free unknowns in natural sizes.
    """

    def __init__(self, run: DrivenRun, lag: float | None, biases: tuple[str, ...], stretch: float | None) -> None:
        self.input = run.input
        if np.ptp(self.input) < 1e-6:
            raise UnusableRun(
                f"the steering never changes, so that none of {', '.join(PARAMETERS)} can be identified: "
                "add an excitation, such as multi_sine"
            )
        self.run, self.evaluations = run, 0
        # A road wheel that follows the command at once tells nothing new.
        measured = [name for name in OUTPUTS if getattr(run, name) is not None and (name != "steering" or lag != 0.0)]
        self.columns = [OUTPUTS.index(name) for name in measured]
        for name in set(biases) - set(measured):
            raise UnusableRun(f"a bias of {name!r} cannot be fitted: it is not measured, or it is the input")
        self.biased = [measured.index(name) for name in biases]
        self.measured = np.stack([getattr(run, name) for name in measured], axis=1)
        self.stretches = Stretches(run, measured, stretch)
        states = [self.input[0] if run.steering is None else run.steering[0], 0.0, run.yaw_rate[0]]
        self.base = np.concatenate([np.zeros(len(PARAMETERS)), states, np.zeros(len(self.biased))])
        self.size = np.concatenate([_SIZE, np.full(len(self.biased), 0.01)])
        self.size[4:6] /= run.steering_ratio
        self.size[len(PARAMETERS)] *= run.steering_ratio
        self.lag = lag
        free = np.ones(len(self.base), dtype=bool)
        free[PARAMETERS.index("lag")] = lag is None
        free[len(PARAMETERS)] = lag != 0.0
        self.free = np.flatnonzero(free)
        self.point = np.zeros(len(self.free))

    def search(self, parameters: Floats) -> bool:
        """Fit, from parameters with b1 and b2 for the road wheel, until R stands; return whether it ended well."""
        self.base[: len(PARAMETERS)] = parameters
        self.base[4:6] /= self.run.steering_ratio
        if self.lag is not None:
            self.base[PARAMETERS.index("lag")] = self.lag
        self.point = (self.base / self.size)[self.free]
        self._weigh()
        for _ in range(_ROUNDS):
            before = self.stretches.deviations
            if not np.isfinite(before).all():
                return False
            try:
                self.point = least_squares(
                    self._residuals, self.point, self._jacobian, ftol=1e-9, xtol=1e-9, max_nfev=40
                ).x
            except ValueError:  # derivatives that overflow
                return False
            self._weigh()
            if np.abs(self.stretches.deviations / before - 1.0).max() < _SETTLED:
                break
        return bool(np.isfinite(self.stretches.deviations).all())

    @property
    def unlikelihood(self) -> float:
        """Minus the logarithm of the likelihood a sample, but for constants."""
        return float(np.sum(np.log(self.stretches.deviations)))

    @property
    def correlation(self) -> Floats:
        """Of neighbouring residuals, (measurements,)."""
        errors = self._residuals(self.point).reshape(self.measured.shape)
        return np.sum(errors[1:] * errors[:-1], axis=0) / np.sum(errors**2, axis=0)

    def _weigh(self) -> None:
        """Take R, as standard deviations, from the residuals where the search stands."""
        self.stretches.weigh(np.ones(len(self.columns)))
        left = self.stretches.weighted(self._errors(self.point[None]))[0]
        self.stretches.weigh(np.maximum(np.sqrt(np.mean(left**2, axis=0)), _LEAST_DEVIATION))

    def _errors(self, points: Floats) -> Floats:
        """Return measured minus simulated for many points, (points, samples, measurements)."""
        unknowns = np.tile(self.base, (len(points), 1))
        unknowns[:, self.free] = points * self.size[self.free]
        parameters, states, biases = np.split(unknowns, [len(PARAMETERS), len(_SIZE)], axis=1)
        run, stretches = self.run, self.stretches
        inputs = Inputs(run.speed, self.input, run.step, run.command is not None, run.delay)
        out = simulate(parameters, states, inputs, anchor=stretches.anchor, stretch=stretches.length)
        out = out[:, :, self.columns]
        self.evaluations += len(points)
        out[:, :, self.biased] += biases[:, None]
        return stretches.turned(np.subtract(self.measured, out, out=out))

    def _residuals(self, point: Floats) -> Floats:
        return self.stretches.weighted(self._errors(point[None])).ravel()

    def _jacobian(self, point: Floats) -> Floats:
        """Central differences, all of them in one simulation; (samples times measurements, unknowns)."""
        n, shift = len(point), _DIFFERENCE * np.eye(len(point))
        errors = self._errors(np.concatenate([point + shift, point - shift]))
        return self.stretches.weighted((errors[:n] - errors[n:]) / (2.0 * _DIFFERENCE)).reshape(n, -1).T

    def result(self) -> Identification:
        """Return the record where the search stands; raises UnusableRun for what is not identifiable."""
        residuals = self._residuals(self.point)
        freedom = residuals.size - len(self.point) - self.stretches.fitted
        variance = float(residuals @ residuals) / freedom
        _, singular, rows = np.linalg.svd(self._jacobian(self.point), full_matrices=False)
        # A direction that nothing depends on gets an enormous variance instead of a division by zero.
        singular = np.maximum(singular, 1e-12 * singular[0])
        scaled = (rows.T / singular**2) @ rows * variance
        found = self.free[self.free < len(PARAMETERS)]
        scaled = scaled[: len(found), : len(found)]
        self._check_identified([PARAMETERS[i] for i in found], np.sqrt(np.diag(scaled)))
        values = self.base[: len(PARAMETERS)].copy()
        values[found] = self.point[: len(found)] * self.size[found]
        covariance = np.zeros((len(PARAMETERS), len(PARAMETERS)))
        covariance[np.ix_(found, found)] = scaled * np.outer(self.size[found], self.size[found])
        errors = residuals.reshape(self.measured.shape) * self.stretches.deviations
        names = self.stretches.names
        return Identification(
            values=dict(zip(PARAMETERS, values.tolist(), strict=True)),
            standard_errors=dict(zip(PARAMETERS, np.sqrt(np.diag(covariance)).tolist(), strict=True)),
            covariance=tuple(map(tuple, covariance.tolist())),
            degrees_of_freedom=freedom,
            residual_rms=dict(zip(names, np.sqrt(np.mean(errors**2, axis=0)).tolist(), strict=True)),
            residual_correlation=dict(zip(names, self.correlation.tolist(), strict=True)),
            evaluations=self.evaluations,
            steering_ratio=self.run.steering_ratio,
        )

    def _check_identified(self, names: list[str], errors: Floats) -> None:
        """``errors``: standard errors in natural sizes, NaN where the search ended in nonsense."""
        poor = [name for name, error in zip(names, errors, strict=True) if not error < _LARGEST_ERROR]
        if not poor:
            return
        if self.run.y is None:
            advice = "sideslip, and with it a11, a12 and b1, shows best in the position: log it"
        elif poor == ["lag"]:
            advice = "an actuator much quicker than the samples leaves no trace: give lag=0.0, or what is known of it"
        else:
            advice = "steer more, at frequencies from 0.3 to 2 Hz, at different speeds, or for longer"
        raise UnusableRun(f"not identifiable from this run: {', '.join(poor)}; {advice}")
