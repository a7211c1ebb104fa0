"""How an identification is done. Every number that steers it is a field here, with a sentence."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

from fifthwheel.errors import SignalError


@dataclass(frozen=True, kw_only=True)
class Common:
    """What both methods are told."""

    preset: str = "default"
    """Name under which the settings go into the result."""
    held: tuple[str, ...] = ()
    """Parameters that keep the value of the vehicle file, as the article holds the front stiffness of its vehicle."""
    initial_payload_height: float | None = 0.1
    """Height from which the payload's is sought, m; None starts from the vehicle file."""
    prior: float = 0.3
    """Prior standard deviation of a stiffness or an inertia that is sought, as a part of its initial value."""
    height_prior: float = 1.0
    """Prior standard deviation of a payload height, m."""
    tolerance: float = 0.01
    """Converged: the last step or pass moves it by no more than a tenth of this part of it, or of its sigma."""
    relaxation: bool = True
    """Let side forces build up over the relaxation lengths of the vehicle file; the article's do at once."""
    nuisances: bool = True
    """Estimate steer zero, steer gain and delay, and the sensors' zeros beside the parameters."""
    steer_offset_prior: float = 0.01
    """Prior standard deviation of a steer zero, rad; one for each log."""
    steer_gain_prior: float = 0.15
    """Prior standard deviation of a steer gain, one for the truck: a fixed steering ratio may be off by as much."""
    steer_delay_prior: float = 0.1
    """Prior standard deviation of a steer delay, s; one for the truck."""
    rate_offset_prior: float = 0.004
    """Prior standard deviation of a gyro's zero, rad/s; one for each log."""
    articulation_offset_prior: float = 0.01
    """Prior standard deviation of an articulation sensor's zero, rad; one for each log."""
    noise: dict[str, float] = field(default_factory=dict)
    """Variance of a signal's noise, SI squared; where it is not given the article's R is the start."""
    adapt_noise: bool = True
    """Rescale R after every pass to the innovations that were seen."""
    process_noise: float = 1.0
    """Process noise, in units of the default (`observe.noise.PROCESS`); the article has none here."""
    gate: float = 6.0
    """Innovations beyond so many standard deviations are not used."""
    min_speed: float = 5.0
    """Below this the linear tyre model does not hold, m/s; such stretches are left out."""
    correlation_time: float = 3.0
    """How long residuals may hang together, s, when sigma is reckoned."""
    excited: float = 0.5**0.5
    """A parameter counts as excited when the logs bring its sigma below this part of its prior's: by default, when they
    tell more of it than the prior does."""
    check: bool = True
    """Refuse logs whose signals cannot be what they are called."""

    def __post_init__(self) -> None:
        for name in ("prior", "height_prior", "tolerance", "gate", "min_speed", "correlation_time"):
            if not getattr(self, name) > 0:
                raise SignalError(f"{name}: expected above 0, got {getattr(self, name)}")
        for name, variance in self.noise.items():
            if not 0 < variance < math.inf:
                raise SignalError(f"{name}: expected a variance above 0, got {variance}")

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class TwoStage(Common):
    """Settings of the two-stage identification; `TwoStage()` is our default, `article()` the published preset."""

    initial_sigma: float | None = None
    """Where the filter's own P_p(0) starts, as a part of the initial value; None for the prior's."""
    initial_height_sigma: float | None = None
    """The same for a payload height, m."""
    logarithmic: bool = True
    """Seek stiffness and inertia by their logarithm, so that they stay positive."""
    passes: int = 40
    """At most so many times through the logs in each stage."""
    rounds: int = 10
    """At most so many times through both stages; after the first, stage 1 uses the yaw-roll model too."""
    average: bool = False
    """Take the average since a parameter stays within the tolerance of it as the estimate (the article's rule), or the
    last value, which holds all the data."""
    consistent: bool = True
    """Count the state's own uncertainty in the parameter filter's innovation variance."""
    coupled: bool = True
    """Carry a parameter's correction over to the state."""
    random_walk: float = 0.0
    """Standard deviation that a parameter gains at every sample, as a part of its initial value (the article's Q_p)."""
    height_walk: float = 0.0
    """The same for a payload height, m."""
    restart: bool = True
    """Begin every pass with the prior covariance, so that no sample is counted twice; the article carries it on."""
    forgetting: float = 1.0
    """The article's lambda: the random walk shrinks by this factor at every sample."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("passes", "rounds"):
            if not getattr(self, name) > 0:
                raise SignalError(f"{name}: expected above 0, got {getattr(self, name)}")
        if not 0 < self.forgetting <= 1:
            raise SignalError(f"forgetting: expected above 0 and at most 1, got {self.forgetting}")


ROUGHLY_KNOWN: Mapping[str, float] = {
    "roll_stiffness": 0.1,
    "tyre_roll_stiffness": 0.1,
    "roll_damping": 0.3,
    "roll_axis_height": 0.1,
    "fifth_wheel.roll_stiffness": 0.3,
    "sprung.cog_height": 0.1,
    "sprung.roll_inertia": 0.2,
    "yaw_inertia": 0.1,
    "relaxation_length": 0.2,
}
"""What a vehicle file mostly knows only roughly, and a log can hardly tell from what is sought; see
`OneStage.consider`."""


@dataclass(frozen=True, kw_only=True)
class OneStage(Common):
    """Settings of the one-stage identification: everything at once, over whole records."""

    free: tuple[str, ...] | None = None
    """What is sought, by path; None for every axle group's cornering stiffness, the yaw inertia of every unit behind
    the first and every payload height."""
    priors: Mapping[str, float] = field(default_factory=dict)
    """What is known roughly and learned beside: prior standard deviation as a part of the value, by a path or the end
    of one (the longest that fits counts)."""
    consider: Mapping[str, float] = field(default_factory=lambda: dict(ROUGHLY_KNOWN))
    """The same for what is never learned from the logs, but whose uncertainty goes into every sigma. A log can hardly
    tell it from what is sought: learned, it would take up what the model errs instead. Empty
    to trust the rest of the vehicle file to the last digit."""
    uniform_payload: bool = True
    """The payload fills its width and height evenly, so that its height gives CoG height (8) and roll inertia (9);
    False seeks `<unit>.sprung.cog_height` and `<unit>.sprung.roll_inertia` of the laden body apart."""
    roll_inertia_prior: float = 0.6
    """Prior standard deviation of that roll inertia, as a part of the uniform load's: a load of one height may be a
    point or stand along the sides."""
    form: Literal["output_error", "prediction_error"] = "output_error"
    """Compare the logs with a model that runs free from its start, or with one that a Kalman filter corrects at every
    sample: the second bears unmeasured disturbances such as side wind, the first bears errors of the model longer."""
    rate_gain_prior: float = 0.005
    """Prior standard deviation of a gyro's gain, as a part; one for the truck."""
    bank_prior: float = 0.03
    """Prior standard deviation of a road's bank, rad; one for each log or, in the prediction-error form, its start."""
    bank_walk: float = 0.002
    """How far the bank wanders, rad in a second, one standard deviation; in the prediction-error form only."""
    outlier: float = 4.0
    """Residuals beyond so many standard deviations lose weight (Huber 1964)."""
    iterations: int = 50
    """At most so many steps."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("roll_inertia_prior", "rate_gain_prior", "bank_prior", "outlier", "iterations"):
            if not getattr(self, name) > 0:
                raise SignalError(f"{name}: expected above 0, got {getattr(self, name)}")
        for name, sigma in {**self.priors, **self.consider}.items():
            if not 0 < sigma < math.inf:
                raise SignalError(f"{name}: expected a standard deviation above 0 as a part of the value, got {sigma}")


def article(**changes: Any) -> TwoStage:
    """The article's settings, sections 3.1 to 3.3; those it leaves open are ours.

    Published: Q_x = 0, Q_p of 0.1 % of nominal (0.005 m for the height) shrunk by lambda at every step, the average
    once within 1 %. Open: P_p(0), here Q_p as its name "initial parameter covariance" suggests; no bounds are told.
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
        nuisances=False,
        adapt_noise=False,
        process_noise=0.0,
        gate=1e6,
    )
    return replace(preset, **changes)
