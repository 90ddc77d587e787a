"""Output-error identification of Yin's single track and its steering actuator from a driven run.

Source: Yin 2010 ("Identifikation"): the parameters minimise J = mean of (z - y)' R⁻¹ (z - y), with y simulated from the
steering command and the measured speed, and z measured: steering angle, yaw rate, heading, position. Nothing measured
but the speed drives the simulation, so that noise in z biases nothing. R is diagonal, taken from the residuals and
iterated until it stands: maximum likelihood for white noise of unknown size (Jategaonkar, "Flight vehicle system
identification", 2006). Fitted as well: the start values of steering angle, sideslip and yaw rate, biases of sensors
where asked for, and heading and position at the start of each of the run's `stretches`.

Standard errors are those of the Gauss-Newton covariance s² (J' J)⁻¹ of the weighted residuals; they hold for white
residuals (see `Identification.residual_correlation`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lanekeep_baselines.identification.problem import Problem
from lanekeep_baselines.identification.result import Identification
from lanekeep_baselines.identification.run import DrivenRun, UnusableRun
from lanekeep_baselines.policy import Floats
from lanekeep_baselines.yin_design import STEERING_RATIO, YinModel
from lanekeep_env.checks import choose, require

#: Where the search starts if nothing better is known: an ordinary car (b1, b2 for the road wheel) ...
_ORDINARY = np.array([-120.0, 20.0, 15.0, -120.0, 45.0, 35.0, 0.1])
#: ... and with stiffer and softer tyres.
_TYRES = (1.0, 2.0, 0.5)
#: Neighbouring residuals more alike than this say that the search got stuck, or that the model is wrong;
#: logarithms of the likelihood nearer than this say that two searches ended in the same place.
_ALIKE, _SAME = 0.5, 1e-4
_BIASED = ("steering", "yaw_rate")


def identify(
    run: DrivenRun,
    *,
    lag: float | None = None,
    guess: YinModel | None = None,
    biases: Sequence[str] = (),
    stretch: float | None = 10.0,
) -> Identification:
    """Fit a11, a12, a21, a22, b1, b2 and the actuator's lag to a run.

    Args:
        run: a drive with lively steering; a12 asks for different speeds as well. Without a command, the measured
            steering angle drives the simulation, and there is no actuator to identify (lag 0).
        lag: of the actuator, s, where it is known (0: the road wheel follows at once); None fits it.
        guess: where the search starts, b1 and b2 for Yin's 16:1 wheel; None for an ordinary passenger car.
        biases: measurements with a constant offset to be fitted: "steering", "yaw_rate".
        stretch: s after which heading and position start anew; None for never.

    Raises:
        UnusableRun: the run does not determine a parameter, which is named.
    """
    require("lag", lag, "s", at_least=0.0, optional=True)
    require("stretch", stretch, "s", at_least=1.0, optional=True)
    for name in biases:
        choose("biases", name, _BIASED)
    fit = Problem(run, 0.0 if run.command is None else lag, tuple(biases), stretch)
    best = None
    with np.errstate(over="ignore", invalid="ignore"):  # a car that skids off on the way is a step too far, no more
        for start in (*([] if guess is None else [_of(guess)]), *(_ORDINARY * [t, t, t, t, t, t, 1.0] for t in _TYRES)):
            if not fit.search(start):
                continue
            again = best is not None and abs(fit.unlikelihood - best[0]) < _SAME
            if best is None or fit.unlikelihood < best[0]:
                best = fit.unlikelihood, fit.point, fit.stretches.deviations
            if again or fit.correlation.max() < _ALIKE:
                break
    if best is None:
        raise UnusableRun("the search failed from every start: check signs and units of the run, or give a guess")
    fit.point = best[1]
    fit.stretches.weigh(best[2])
    return fit.result()


def _of(guess: YinModel) -> Floats:
    """Return the parameters of a model, with b1 and b2 for the road wheel."""
    wheel = [STEERING_RATIO * guess.b1, STEERING_RATIO * guess.b2]
    return np.array([guess.a11, guess.a12, guess.a21, guess.a22, *wheel, 1.0 / guess.actuator_rate])
