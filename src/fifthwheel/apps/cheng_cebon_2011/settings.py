"""Settings of the identification in two stages, and those of the article."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

from pydantic import AfterValidator

from fifthwheel.base.errors import SignalError
from fifthwheel.base.names import PAYLOAD_HEIGHT
from fifthwheel.base.settings import Count, Cure, FiniteNonNegative, Limits
from fifthwheel.data.channels import STEER, SensorErrorName, is_of
from fifthwheel.estimate.filters.variances import Variances
from fifthwheel.estimate.identify.settings import CommonSettings
from fifthwheel.estimate.identify.statement import stated, statement
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.truck.quantities import unit_of


def _checked(diagonal: Mapping[str, str | float]) -> Mapping[str, str | float]:
    for name, entry in diagonal.items():
        if isinstance(entry, str):
            found = statement(name, entry)
            if found.kind != "sigma" or found.value:
                raise SignalError(f"{found}: expected '+- SIGMA', such as '+- 0.1 %'; or give a variance in SI")
        elif not 0 <= entry < math.inf:
            raise SignalError(f"{name}: expected a finite variance of 0 or more, got {entry}; correct it")
    return diagonal


Diagonal = Annotated[
    Mapping[str, str | float],
    Cure("give a variance in SI, such as 475**2, or a standard deviation as a text, such as '+- 0.1 %'"),
    AfterValidator(_checked),
]
"""Diagonal of a covariance of parameters, by path or the end of it: variances, or texts with standard deviations."""


def deviation(diagonal: Diagonal, unknown: Unknown) -> float | None:
    """Standard deviation of a parameter, SI, by the most specific name in a diagonal; None if it is in none."""
    unit = unit_of(unknown.name)
    texts = {n: v if isinstance(v, str) else f"+- {math.sqrt(v)!r} {unit}" for n, v in diagonal.items()}
    return stated(texts, unknown.name, unit, unknown.centre).sigma


@dataclass(frozen=True, kw_only=True)
class TwoStage(CommonSettings):
    """Settings of the identification in two stages. `TwoStage()` is our default, `article()` the published method.

    `given` states priors of the parameters; by default they are 30 % of a stiffness or inertia, and 0.1 m +- 1 m of a
    payload height. `R`, `Q_x`, `Q_p` and `P_p` are diagonals of the article's covariances, by name: equations (10) to
    (15).

    Example:
        >>> import fifthwheel as fw
        >>> fw.TwoStage(given={"tractor.front.cornering_stiffness": "exact"}).preset
        'default'
    """

    method = "two-stage"
    implementation = "fifthwheel.apps.cheng_cebon_2011.estimator:identify_two_stage"

    preset: str = "default"
    """Name of these settings in the result."""
    R: Variances = field(default_factory=dict)
    """Noise variance by signal, SI squared, equations (10) and (12). A signal that is not listed has the article's."""
    Q_x: Mapping[str, FiniteNonNegative] = field(default_factory=dict)
    """Variance that a state gains per sample, SI squared, by its name, such as "yaw_rate.tractor", with * for any
    words: equation (14) is {"*": 1e-8}. A state that is not listed has the default,
    `estimate.filters.variances.PROCESS_VARIANCE` per second."""
    Q_p: Diagonal = field(default_factory=dict)
    """Variance that a parameter gains per sample, in its SI unit squared, by its path or the end of it: equation (11)
    begins {"tractor.front.cornering_stiffness": 475**2}. A text is a standard deviation: "+- 0.1 %", "+- 5 mm". A
    parameter that is not listed gains none."""
    P_p: Diagonal = field(default_factory=dict)
    """Variance of a parameter at the start of the filter, P_p(0), as `Q_p`; of one that is not listed, the prior."""
    logarithmic: bool = True
    """Estimate the logarithm of a stiffness or inertia, so that it stays positive."""
    passes: Count = 40
    """Largest number of passes through the logs in each stage."""
    rounds: Count = 10
    """Largest number of rounds through both stages. From the second round on stage 1 uses the yaw-roll model."""
    average: bool = False
    """Take as estimate the average since the parameter has settled (the article's rule) and not the last value. The
    last value uses all data."""
    consistent: bool = True
    """Include the uncertainty of the state in the innovation variance of the parameter filter."""
    coupled: bool = True
    """Correct the state when a parameter is corrected."""
    restart: bool = True
    """Start every pass with the prior covariance, so that no sample counts twice; the article continues with the
    covariance of the last pass."""
    forgetting: Annotated[float, Limits(gt=0, le=1)] = 1.0
    """The article's lambda: factor of Q_p at every sample."""

    @property
    def stated_noise(self) -> Mapping[str, float]:
        """Noise variance by signal, SI squared, as far as it is stated."""
        return self.R

    def uses(self, name: str) -> bool:
        """Whether it is a sensor error that two stages estimate."""
        error = SensorErrorName.of(name)
        kinds = ("offset", "gain", "delay") if error and is_of(error.signal, STEER) else ("offset",)
        return error is not None and error.kind in kinds


_Q_P = {"cornering_stiffness": "+- 0.1 %", "yaw_inertia": "+- 0.1 %", PAYLOAD_HEIGHT: "+- 5 mm"}
"""Equations (11) and (13), for any truck."""


def article(**changes: Any) -> TwoStage:
    """The settings of the article, sections 3.1 to 3.3, with `changes`, those of `given` and `Q_p` by name.

    Noise `R`: equations (10) and (12). Random walk `Q_p`: (11) and (13).

    Published: Q_x = 0; Q_p of 0.1 % of the nominal value (0.005 m for the height), shrunk by lambda at every step; the
    average once within 1 %. Not published: P_p(0), here Q_p after its name "initial parameter covariance", and bounds.

    Example:
        >>> import fifthwheel as fw
        >>> fw.article().forgetting
        0.999

        The test vehicle, section 4.2 with equation (15):

        >>> Q_p = {"tractor.drive.cornering_stiffness": 600**2, "semitrailer.cornering_stiffness": 1000**2}
        >>> Q_p |= {"semitrailer.yaw_inertia": 400**2}
        >>> of_test = fw.article(Q_p=Q_p, forgetting=0.9995, given={"tractor.front.cornering_stiffness": "exact"})
    """
    Q_p = {**_Q_P, **changes.pop("Q_p", {})}
    preset = TwoStage(
        preset="article",
        Q_x={"*": 0.0},
        Q_p=Q_p,
        P_p=Q_p,
        logarithmic=False,
        passes=1,
        rounds=1,
        average=True,
        consistent=False,
        coupled=False,
        restart=False,
        forgetting=0.999,
        relaxation=False,
        given={"sensors": "exact"},
        adapt_noise=False,
        gate=1e6,
    )
    given = {**preset.given, **changes.pop("given", {})}
    return replace(preset, given=given, **changes)
