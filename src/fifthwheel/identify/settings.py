"""Settings of an identification: every number that controls it is a field with a sentence."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Annotated, Any, ClassVar, Literal

from fifthwheel.dynamics import tyre_law
from fifthwheel.dynamics.tyre_law import ChosenTyres, Tyres
from fifthwheel.errors import FifthwheelError, SignalError
from fifthwheel.filters.variances import Variances
from fifthwheel.names import ends_with
from fifthwheel.options import Friction
from fifthwheel.settings import Count, Cure, Finite, FiniteNonNegative, FinitePositive, NonNegative, Positive, Settings
from fifthwheel.vehicle import steering_equations
from fifthwheel.vehicle.parameters import FRICTION, TYRE_PARAMETERS
from fifthwheel.vehicle.steering import STEERING

Progress = Callable[[str, int, int], None]
"""Receives a title, the number of steps done and the largest number of steps."""

RelativeSigmas = Annotated[Mapping[str, FinitePositive], Cure("give a standard deviation as a fraction of the value")]


ROLL_PARAMETERS = ("payload.height", "sprung.cog_height", "sprung.roll_inertia")
"""Parameters of a unit that are identifiable only from its own roll rate."""
StatedPriors = Annotated[
    Mapping[str, tuple[Finite, FiniteNonNegative]], Cure("give a prior mean and a standard deviation in SI")
]


@dataclass(frozen=True, kw_only=True)
class CommonSettings(Settings):
    """Settings that both methods share."""

    preset: str = "default"
    """Name of these settings in the result."""
    fixed: tuple[str, ...] = ()
    """Parameters that keep the value of the vehicle file. The article fixes the front stiffness of its test vehicle."""
    initial_payload_height: float | None = 0.1
    """Initial value of a payload height, m; None takes the value of the vehicle file."""
    prior: Positive = 0.3
    """Prior standard deviation of an estimated stiffness or inertia, as a fraction of its initial value."""
    height_prior: Positive = 1.0
    """Prior standard deviation of a payload height, m."""
    tolerance: Positive = 0.01
    """A parameter has settled when it stays within this fraction of its value. Two stages stop when a pass changes no
    parameter by more than a tenth of this fraction, or of its sigma if that is larger."""
    relaxation: bool = True
    """Model the lag of the side forces by the relaxation lengths of the vehicle file; the article has no lag."""
    nuisances: bool = True
    """Estimate the sensor errors together with the parameters: offset, gain and delay of the steering, offsets of the
    other sensors; in one stage also the gains of the gyros and the bank of the road."""
    steer_offset_prior: float = 0.01
    """Prior standard deviation of a steering offset, rad; each log has its own."""
    steer_gain_prior: float = 0.15
    """Prior standard deviation of a steering gain; all logs share it. A nominal steering ratio may be wrong by this."""
    steer_delay_prior: float = 0.1
    """Prior standard deviation of a steering delay, s; all logs share it."""
    rate_offset_prior: float = 0.004
    """Prior standard deviation of the bias of a gyro, rad/s; each log has its own."""
    articulation_offset_prior: float = 0.01
    """Prior standard deviation of the offset of an articulation sensor, rad; each log has its own."""
    noise: Variances = field(default_factory=dict)
    """Noise variance by signal, SI squared. A signal that is not listed starts from the article's R."""
    adapt_noise: bool = True
    """Rescale R to the variance of the residuals after every pass or step."""
    process_noise: float = 1.0
    """Process noise as a multiple of the default (`filters.variances.PROCESS_VARIANCE`); the article has none."""
    gate: Positive = 6.0
    """Measurements with an innovation beyond this number of standard deviations are rejected."""
    min_speed: Positive = 5.0
    """Segments below this speed are not used, m/s: the linear tyre model does not hold there."""
    correlation_time: Positive = 3.0
    """Longest time over which residuals may be autocorrelated, s; used for sigma."""
    excited: float = 0.5**0.5
    """A parameter is excited when the logs bring its sigma below this fraction of the prior sigma. At the default the
    logs contain more information on it than the prior."""
    check: bool = True
    """Refuse logs with implausible signals."""

    method: ClassVar[str]
    """Name of the method in a result."""

    brakes: ClassVar[bool] = False
    """Whether the model has longitudinal forces."""

    @property
    def tyre_law(self) -> Tyres:
        """Law of the side forces of one fit."""
        return "linear"


METHODS = {"one-stage": "fifthwheel.identify.settings:OneStage", "two-stage": "fifthwheel.cheng_cebon_2011:TwoStage"}
"""Settings of each method, by its name in a result: module and class."""


def settings_class(method: str) -> type[CommonSettings]:
    """The class of the settings of a method.

    Raises:
        SignalError: there is no such method.
    """
    if method not in METHODS:
        raise SignalError(f"method: expected {' or '.join(METHODS)}, got {method!r}; identify again")
    module, _, name = METHODS[method].partition(":")
    found: type[CommonSettings] = getattr(import_module(module), name)
    return found


def require_own_functions(contents: Mapping[str, Any], path: str) -> None:
    """A SignalError for a file whose own tyre law or own equations of the steering are not imported, or others."""
    settings, vehicle = contents.get("settings"), contents.get("vehicle_file", contents.get("vehicle"))
    tyres, steering = (
        part.get(key) if isinstance(part, dict) else None for part, key in ((settings, "tyres"), (vehicle, STEERING))
    )
    try:
        if isinstance(tyres, dict):
            tyre_law.restored(tyres)
        if isinstance(steering, dict):
            steering_equations.found(steering.get("equations"))
    except FifthwheelError as error:
        raise SignalError(f"{path}: {error}") from None


MODEL_ERRORS: Mapping[str, float] = {
    "vehicle_file": 1.0,
    "softening": 1.0,
    "gyro_delay": 0.01,
    "stiffness_variation": 0.025,
    "time_base": 0.002,
    "fixed_axles": 0.015,
    "discrepancy": 0.015,
    "bank_variation": 0.005,
    "drive_axle_braking": 0.4,
}
"""What a model lacks, in groups: the standard deviations of masses and lengths in the vehicle file, as a multiple of
those that the file states or implies (`vehicle.uncertainty`); the softening of linear tyres with the slip angle, as a
multiple of that of `parameters.softening_priors`; the latency of each gyro, s; the variation of a cornering
stiffness from log to log, with temperature and pressure of the tyres, as a fraction; the rate of the time base, because
timestamps are sometimes made from a nominal sampling rate; the self-steering of the last axle of a group behind the
first unit that is fixed according to the file; the least discrepancy of a free-running model (`noise_model`), as a
fraction of each signal; the difference of the bank from its estimate within a log, rad, which includes side wind and
the pull of tyres and misaligned axles; the fraction of the braking force by engine and retarder in each log, about a
half."""
MODEL_ERROR_UNITS: Mapping[str, str] = {"gyro_delay": "s", "bank_variation": "rad"}
"""SI units of those model errors that are no fraction."""

DEFAULT_CONSIDERED: Mapping[str, float] = {
    **MODEL_ERRORS,
    "roll_stiffness": 0.1,
    "tyre_roll_stiffness": 0.1,
    "roll_damping": 0.3,
    "roll_axis_height": 0.1,
    "fifth_wheel.roll_stiffness": 0.3,
    "sprung.cog_height": 0.1,
    "sprung.roll_inertia": 0.2,
    "yaw_inertia": 0.1,
    "relaxation_length": 0.2,
    "pneumatic_trail": 0.2,
    "tyre.shape": 0.12,
    "tyre.stiffness_load_sensitivity": 0.4,
    "tyre.friction_load_sensitivity": 0.5,
    "tyre.combined_slip": 0.45,
    "body.half_track": 0.05,
    "static_load": 0.02,
    "relative_friction": 0.1,
    "body.drag_area": 0.25,
    "tyre.rolling_resistance": 0.25,
}
"""Parameters that are uncertain in most vehicle files and hardly separable from the estimated parameters in a log, with
their prior standard deviation as a fraction of the value; see `OneStage.consider`."""


@dataclass(frozen=True, kw_only=True)
class OneStage(CommonSettings):
    """Settings of the identification in one stage: all unknowns together, over complete logs.

    Example:
        >>> import fifthwheel as fw
        >>> settings = fw.OneStage(fixed=("tractor.drive.cornering_stiffness",), steer_delay_prior=0.005)
        >>> settings.prior
        0.3
    """

    method = "one-stage"

    initial_payload_height: float | None = 1.4
    """Prior mean of a payload height, m; None takes the value of the vehicle file. With `height_prior` it has mean and
    standard deviation of a height that is equally probable up to 2.7 m, the inside of a usual body."""
    height_prior: Positive = 0.75
    """Prior standard deviation of a payload height, m."""
    steer_delay_prior: float = 0.05
    """Prior standard deviation of a steering delay, s; all logs share it. Correct a longer one in the signal map."""
    excited: float = 3**-0.5
    """As in two stages, but more than twice the information of the prior: with less, the prior decides, and the error
    of a positive parameter is skewed. Two stages drop a parameter that is not excited."""
    guess_tail: Positive = 3.0
    """Beyond about this number of standard deviations the prior of an estimated stiffness or inertia falls only
    exponentially, because a guess may be far off. A parameter in `priors` has a normal prior."""
    free: tuple[str, ...] | None = None
    """Paths of the estimated parameters; None for the cornering stiffness of every axle group, the yaw inertia of every
    unit behind the first, and every payload height."""
    priors: RelativeSigmas = field(default_factory=dict)
    """Uncertain parameters that are estimated too: prior standard deviation as a fraction of the value, by path or end
    of a path (the longest that matches counts)."""
    consider: RelativeSigmas = field(default_factory=lambda: dict(DEFAULT_CONSIDERED))
    """Numbers that are uncertain in most vehicle files, and what the model lacks (`MODEL_ERRORS`), estimated from their
    priors. Same form as `priors`; what the vehicle file states replaces a default. Empty if the rest of the vehicle
    file is exact. A `Learner` keeps them at their prior mean and includes their uncertainty in every sigma."""
    stated_priors: StatedPriors = field(default_factory=dict)
    """Prior mean and standard deviation, SI, of single sensor errors, such as steer.tractor.front.gain, by name. A
    standard deviation of 0: the error is exactly its mean. Also of estimated parameters whose prior is not a fraction
    of the value, by path: payload heights and positions."""
    surroundings: Mapping[str, Finite] = field(default_factory=dict)
    """Prior means of parameters that have no place in a vehicle file, SI, by name, such as tyre.shape; see
    `ObserverSettings`."""
    uniform_payload: bool = True
    """The payload fills its width and height uniformly, so that its height gives CoG height (8) and roll inertia (9).
    False estimates `<unit>.sprung.cog_height` and `<unit>.sprung.roll_inertia` of the laden body separately."""
    roll_inertia_prior: Positive = 0.6
    """Prior standard deviation of that roll inertia, as a fraction of the inertia of a uniform payload: a payload of
    the same height may be a point, or stand along the sides."""
    tyres: ChosenTyres = "auto"
    """Law of the side forces: linear in the slip angle, with an unknown softening; saturating at the friction of the
    road, which all logs share and which is estimated too (`dynamics.tyres`); an own function that saturates
    (`dynamics.tyre_law`); or auto: saturating if the static axle loads are determined."""
    roll: bool = True
    """Model yaw and roll. False: yaw only, without signals that contain roll (roll rates, lateral accelerations, wheel
    speeds), and no payload height is estimated."""
    friction: Friction = TYRE_PARAMETERS[FRICTION].default
    """Prior median of the peak friction of the road; 0.75: truck tyres on a dry road."""
    friction_prior: Positive = 0.4
    """Prior standard deviation of the friction, as a fraction of its median."""
    form: Literal["output_error", "prediction_error"] = "output_error"
    """Output error: residuals of the model without correction by measurements; more robust to model error. Prediction
    error: innovations of a Kalman filter; robust to unmeasured disturbances such as side wind."""
    speed_delay_prior: NonNegative = 0.1
    """Prior standard deviation of the delay of the speed, s; all logs share it. A CAN bus gives the speed of the truck
    50 to 150 ms late. Correct a longer delay in the signal map. A `Learner` does not estimate it."""
    rate_gain_prior: NonNegative = 0.005
    """Prior standard deviation of the gain of a gyro; all logs share it."""
    steer_play_prior: float = math.radians(0.2)
    """Prior standard deviation of the play between steer sensor and road wheels, rad at the wheels; all logs share it.
    Smaller if the angle is measured at the wheels, larger for a steering wheel angle of a worn steering."""
    time_base_delay_prior: float = 0.1
    """Prior standard deviation of the delay of a further time base against that of the steer angle, s; all logs share
    it. The model is linear in this delay: correct a delay of more than 0.1 s in the signal map."""
    misalignment_prior: float = math.radians(1)
    """Prior standard deviation of the misalignment of a gyro, rad; all logs share it. A bracket is square to 0.5 to
    1 degree."""
    acceleration_offset_prior: float = 0.3
    """Prior standard deviation of the offset of a lateral accelerometer, m/s^2; each log has its own. It contains
    gravity by the tilt of the mounting: 1 degree gives 0.17 m/s^2."""
    acceleration_gain_prior: float = 0.03
    """Prior standard deviation of the gain of a lateral accelerometer; all logs share it."""
    acceleration_delay_prior: float = 0.03
    """Prior standard deviation of the delay of a lateral accelerometer, s; all logs share it. It contains that of the
    low-pass filter of the sensor."""
    wheel_speed_offset_prior: float = 0.005
    """Prior standard deviation of the offset of a wheel speed difference; each log has its own. It is the relative
    difference of the rolling radii of both sides."""
    wheel_speed_gain_prior: float = 0.03
    """Prior standard deviation of the gain of a wheel speed difference, the track of the axle over that of the vehicle;
    all logs share it."""
    wheel_load_sensitivity_prior: float = 0.015
    """Prior standard deviation of the load sensitivity of a wheel speed difference; all logs share it. Magic Formula
    files of two truck tyres give 0.001 and 0.017 for a laden trailer axle."""
    wheel_speed_delay_prior: float = 0.05
    """Prior standard deviation of the delay of a wheel speed difference, s; all logs share it. The control unit
    averages pulses over 20 to 60 ms, and a wheel follows the road within a relaxation length, 20 ms at 25 m/s."""
    accelerometer_position_prior: float = 0.5
    """Prior standard deviation of the position of a lateral accelerometer along its unit, m, where the vehicle file
    states none."""
    accelerometer_height_prior: float = 0.3
    """The same for its height, m."""
    bank_prior: Positive = 0.03
    """Prior standard deviation of the road's bank, rad; each segment has its own. In the prediction-error form: of the
    bank at the start of a segment."""
    bank_walk: float = 0.002
    """Standard deviation that the bank gains in one second, rad; prediction-error form and `Learner` only."""
    outlier: Positive = 4.0
    """Residuals beyond this number of standard deviations get less weight (Huber 1964)."""
    iterations: Count = 50
    """Largest number of steps."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.free or ():
            if any(ends_with(name, fixed) for fixed in self.fixed):
                raise SignalError(
                    f"free, {name}: expected a parameter that is not fixed; remove it from free or from fixed"
                )
        for key in ("height_prior", "roll_inertia_prior", "uniform_payload") if not self.roll else ():
            if (value := getattr(self, key)) != getattr(type(self), key):
                raise SignalError(
                    f"{key}: expected the default, because roll=False estimates no payload height, got {value}; "
                    "remove it, or use roll=True"
                )
        requested = {"free": self.free or (), "priors": self.priors, "stated_priors": self.stated_priors}
        for key, names in requested.items() if not self.roll else ():
            for name in names:
                if any(ends_with(name, of_roll) for of_roll in ROLL_PARAMETERS):
                    raise SignalError(
                        f"{key}, {name}: expected a parameter of the yaw motion, because roll=False; remove it, or use "
                        "roll=True"
                    )

    brakes = True

    @property
    def tyre_law(self) -> Tyres:
        """Law of the side forces of one fit; linear with auto."""
        return "linear" if self.tyres == "auto" else self.tyres
