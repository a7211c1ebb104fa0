"""Settings of the identification in two stages, and those of the article."""

from dataclasses import dataclass, replace
from typing import Annotated, Any

from fifthwheel.channels import STEER, SensorErrorName, is_of
from fifthwheel.identify.settings import CommonSettings
from fifthwheel.settings import Count, Limits, Positive


@dataclass(frozen=True, kw_only=True)
class TwoStage(CommonSettings):
    """Settings of the identification in two stages. `TwoStage()` is our default, `article()` the published method.

    Example:
        >>> import fifthwheel as fw
        >>> fw.TwoStage(given={"tractor.front.cornering_stiffness": "exact"}).preset
        'default'
    """

    method = "two-stage"

    preset: str = "default"
    """Name of these settings in the result."""
    prior: Positive = 0.3
    """Prior standard deviation of a stiffness or inertia, as a fraction of its initial value."""
    height_prior: Positive = 1.0
    """Prior standard deviation of a payload height, m."""
    initial_payload_height: float | None = 0.1
    """Initial value of a payload height, m; None takes the value of the vehicle file."""
    initial_sigma: float | None = None
    """Initial standard deviation in the filter, P_p(0), as a fraction of the initial value; None takes the prior."""
    initial_height_sigma: float | None = None
    """The same for a payload height, m."""
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
    random_walk: float = 0.0
    """Standard deviation that a parameter gains per sample, as a fraction of its initial value (the article's Q_p)."""
    height_walk: float = 0.0
    """The same for a payload height, m."""
    restart: bool = True
    """Start every pass with the prior covariance, so that no sample counts twice; the article continues with the
    covariance of the last pass."""
    forgetting: Annotated[float, Limits(gt=0, le=1)] = 1.0
    """The article's lambda: factor by which the random walk shrinks at every sample."""

    def uses(self, name: str) -> bool:
        """Whether it is a sensor error that two stages estimate."""
        error = SensorErrorName.of(name)
        kinds = ("offset", "gain", "delay") if error and is_of(error.signal, STEER) else ("offset",)
        return error is not None and error.kind in kinds


def article(**changes: Any) -> TwoStage:
    """The settings of the article, sections 3.1 to 3.3, with `changes`.

    Published: Q_x = 0; Q_p of 0.1 % of the nominal value (0.005 m for the height), shrunk by lambda at every step; the
    average once within 1 %. Not published: P_p(0), here Q_p after its name "initial parameter covariance", and bounds.

    Example:
        >>> import fifthwheel as fw
        >>> fw.article().forgetting
        0.999
    """
    preset = TwoStage(
        preset="article",
        initial_sigma=0.001,
        initial_height_sigma=0.005,
        logarithmic=False,
        passes=1,
        rounds=1,
        average=True,
        consistent=False,
        coupled=False,
        random_walk=0.001,
        height_walk=0.005,
        restart=False,
        forgetting=0.999,
        relaxation=False,
        given={"sensors": "exact"},
        adapt_noise=False,
        process_noise=0.0,
        gate=1e6,
    )
    given = {**preset.given, **changes.pop("given", {})}
    return replace(preset, given=given, **changes)
