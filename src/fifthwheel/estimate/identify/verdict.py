"""The verdict on an estimate, and all rules that decide it."""

import math
from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import quantity_of


class Verdict(StrEnum):
    """How far an estimate can be trusted.

    Example:
        >>> import fifthwheel as fw
        >>> [verdict.value for verdict in fw.Verdict][:3]
        ['converged', 'doubtful', 'not_converged']
    """

    CONVERGED = "converged"
    DOUBTFUL = "doubtful"
    NOT_CONVERGED = "not_converged"
    NOT_EXCITED = "not_excited"
    NOT_IDENTIFIABLE = "not_identifiable"
    AT_BOUND = "at_bound"
    FIXED = "fixed"
    STATED = "stated"


CONFOUNDED = 0.5
"""A parameter is NOT_IDENTIFIABLE if less than this fraction of its prior standard deviation would remain with all
other estimated parameters known: a quarter of the variance."""

STRAIGHT = 0.5
"""m/s²; up to this lateral acceleration a run counts as straight: camber, side wind and the play of the steering move a
truck as much as its driver does, so that no parameter of its lateral motion is EXCITED."""

STILL_MOVING = 0.5
"""An estimate that the next step would move by more than this number of its standard deviations has not converged."""


def still_moving(names: Sequence[str], step: Array, sigma: Array) -> set[str]:
    """The names of estimates that have not converged, by the next step (k,) and the standard deviations (k,)."""
    return {name for name, s in zip(names, np.abs(step) / sigma, strict=True) if s > STILL_MOVING}


def straight_running(estimated: Iterable[str], accelerations: Iterable[float]) -> dict[str, Verdict]:
    """NOT_EXCITED for all parameters if no log reaches STRAIGHT, by the largest lateral accelerations of the logs,
    m/s²; NaN where a log does not show it."""
    largest = max((each for each in accelerations if not math.isnan(each)), default=math.nan)
    return dict.fromkeys(estimated, Verdict.NOT_EXCITED) if largest < STRAIGHT else {}


def uninformed_parameters(
    posterior: ScaledPosterior, remaining: Mapping[str, float], without_roll_rate: Iterable[str], limit: float
) -> dict[str, Verdict]:
    """The estimated parameters that the logs do not determine, each with NOT_EXCITED or NOT_IDENTIFIABLE.

    These are the parameters of whose prior standard deviation no less than the limit remains, and those
    `without_roll_rate`. NOT_IDENTIFIABLE: the others act alike, or no channel depends on it. NOT_EXCITED: the logs
    would hardly determine it even if all others were known.

    `remaining` are fractions of the prior standard deviation by parameter (`remaining_fraction`), `limit` is one.
    """
    verdicts = {}
    for name in (name for name, fraction in remaining.items() if not fraction < limit):
        confounded = posterior.conditional_sigma(name) < CONFOUNDED
        verdicts[name] = Verdict.NOT_IDENTIFIABLE if confounded else Verdict.NOT_EXCITED
    return verdicts | dict.fromkeys(without_roll_rate, Verdict.NOT_IDENTIFIABLE)


def remaining_fraction(unknown: Unknown, value: float, sigma_z: float) -> float:
    """Sigma of an estimate as a fraction of that of its prior: of the value or of its logarithm, the larger one.

    sigma_z is that of z, in units of the prior. The value is in SI.
    """
    return sigma_z * max(1.0, unknown.slope(value) / unknown.prior_sigma)


def is_stated(vehicle: Vehicle, name: str) -> bool:
    """Whether a user has said how well a payload height or a position is known: it is STATED where the logs do not
    determine it."""
    return name in vehicle.stated and name not in vehicle.assumed and not quantity_of(name).is_relative


def estimate_verdict(
    unknown: Unknown,
    value: float,
    sigma_z: float,
    *,
    excited: float = math.inf,
    converged: bool = True,
    doubtful: bool = False,
) -> Verdict:
    """NOT_EXCITED, AT_BOUND, NOT_CONVERGED, DOUBTFUL or CONVERGED: the first that applies.

    A parameter is excited if less than the fraction `excited` of its prior standard deviation remains. At a bound means
    closer to it than a tenth of sigma: the prior keeps an estimate from lying exactly on its bound. `converged`: the
    estimate moves no more; `doubtful`: a doubt (`doubts`) concerns the parameter.
    """
    if not remaining_fraction(unknown, value, sigma_z) < excited:
        return Verdict.NOT_EXCITED
    if min(value - unknown.lower, unknown.upper - value) < 0.1 * unknown.sigma(value, sigma_z):
        return Verdict.AT_BOUND
    if not converged:
        return Verdict.NOT_CONVERGED
    return Verdict.DOUBTFUL if doubtful else Verdict.CONVERGED


def uncertain_verdict(sigma_z: float, excited: float) -> Verdict:
    """CONVERGED or NOT_EXCITED for an uncertain number, by `excited`, the limit of sigma_z, in units of the prior."""
    return Verdict.CONVERGED if sigma_z < excited else Verdict.NOT_EXCITED
