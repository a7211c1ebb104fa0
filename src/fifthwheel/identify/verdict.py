"""The verdict on an estimate, and all rules that decide it."""

import math
from collections.abc import Iterable, Sequence
from enum import StrEnum

from fifthwheel.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.identify.settings import OneStage
from fifthwheel.identify.unknowns.unknown import Unknown
from fifthwheel.names import ParameterPath
from fifthwheel.vehicle import Vehicle


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


def information_verdicts(posterior: ScaledPosterior, indices: Sequence[int], limit: float) -> dict[int, Verdict]:
    """Verdict on some unknowns by the information in the logs: CONVERGED, NOT_EXCITED or NOT_IDENTIFIABLE.

    An unknown whose sigma is below the limit is CONVERGED. The others are NOT_EXCITED if the conditional sigma of every
    unknown is above the limit: the vehicle was not excited. Otherwise they are NOT_IDENTIFIABLE: the logs contain
    information on the vehicle, but not on this unknown alone.

    Args:
        indices: of the estimated parameters among the unknowns.
        limit: fraction of the prior sigma.
    """
    excited = any(posterior.conditional_sigma(i) < limit for i in indices)
    uninformed = Verdict.NOT_IDENTIFIABLE if excited else Verdict.NOT_EXCITED
    return {i: Verdict.CONVERGED if posterior.sigma[i] < limit else uninformed for i in indices}


def uninformed_parameters(
    posterior: ScaledPosterior, names: Sequence[str], without_roll_rate: Iterable[str], limit: float
) -> dict[str, Verdict]:
    """The estimated parameters that the logs do not determine, each with NOT_EXCITED or NOT_IDENTIFIABLE.

    These are the parameters that `information_verdicts` does not call CONVERGED, and those `without_roll_rate`. The
    limit is a fraction of the prior sigma.
    """
    verdicts = information_verdicts(posterior, [posterior.names.index(name) for name in names], limit)
    uninformed: dict[str, Verdict] = {posterior.names[i]: v for i, v in verdicts.items() if v is not Verdict.CONVERGED}
    excited = len(uninformed) < len(names) or Verdict.NOT_IDENTIFIABLE in uninformed.values()
    return uninformed | dict.fromkeys(without_roll_rate, Verdict.NOT_IDENTIFIABLE if excited else Verdict.NOT_EXCITED)


def is_stated(vehicle: Vehicle, settings: OneStage, name: str) -> bool:
    """Whether a user has said how well a parameter is known: by a statement, or a payload height in the file.

    It is STATED where the logs do not determine it.
    """
    in_file = name in vehicle.stated and name not in vehicle.assumed and ParameterPath.of(name).is_payload_height
    return name in settings.stated_priors or in_file


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

    A parameter is excited if sigma_z, in units of the prior, is below the limit `excited`. At a bound means closer to
    it than a tenth of sigma: the prior keeps an estimate from lying exactly on its bound. `converged`: the estimation
    has converged and the model explains the logs; `doubtful`: a doubt (`doubts`) concerns the parameter.
    """
    if not sigma_z < excited:
        return Verdict.NOT_EXCITED
    if min(value - unknown.lower, unknown.upper - value) < 0.1 * unknown.sigma(value, sigma_z):
        return Verdict.AT_BOUND
    if not converged:
        return Verdict.NOT_CONVERGED
    return Verdict.DOUBTFUL if doubtful else Verdict.CONVERGED


def uncertain_verdict(sigma_z: float, excited: float) -> Verdict:
    """CONVERGED or NOT_EXCITED for an uncertain number, by `excited`, the limit of sigma_z, in units of the prior."""
    return Verdict.CONVERGED if sigma_z < excited else Verdict.NOT_EXCITED
