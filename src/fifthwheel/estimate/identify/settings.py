"""Settings of an identification: every number that controls it is a field with a sentence."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, ClassVar, Literal

from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.names import PAYLOAD_HEIGHT
from fifthwheel.base.options import Names
from fifthwheel.base.settings import Count, Positive, Settings
from fifthwheel.data.channels import ROLL_RATE, names_of
from fifthwheel.estimate.filters.variances import Variances
from fifthwheel.estimate.identify.statement import Given
from fifthwheel.model.dynamics.tyres import ChosenTyres, Tyres, restored_law
from fifthwheel.truck.steering import STEERING

Progress = Callable[[str, int, int], None]
"""Receives a title, the number of steps done and the largest number of steps."""

ROLL_PARAMETERS = (PAYLOAD_HEIGHT, "sprung.cog_height", "sprung.roll_inertia")
"""Parameters of a unit that are identifiable only from its own roll rate."""


@dataclass(frozen=True, kw_only=True)
class CommonSettings(Settings):
    """Settings that both methods share."""

    given: Given = field(default_factory=dict)
    """What is known of numbers: "33.4 t +- 0.5 %", "+- 5 %", "exact", "free" (a wide prior), or a value in SI, by the
    path of a number, of the truck, a sensor, the road or the model; by the end of it; or with * for any words. "truck",
    "others" and "sensors" name all of a kind (`statement.GROUPS`). The most specific counts."""
    tolerance: Positive = 0.01
    """A parameter has settled when it stays within this fraction of its value. Two stages stop when a pass changes no
    parameter by more than a tenth of this fraction, or of its sigma if that is larger."""
    relaxation: bool = True
    """Model the lag of the side forces by the relaxation lengths of the vehicle file; the article has no lag."""
    adapt_noise: bool = True
    """Rescale R to the variance of the residuals after every pass or step."""
    gate: Positive = 6.0
    """Measurements with an innovation beyond this number of standard deviations are rejected."""
    min_speed: Positive = 5.0
    """Segments below this speed are not used, m/s: the linear tyre model does not hold there."""
    check: bool = True
    """Refuse logs with implausible signals."""

    preset = "default"
    """Name of these settings in a result."""
    roll = True
    """Whether the model has roll, if the logs show it."""
    uniform_payload = True
    """Whether the height of a payload gives its roll inertia."""
    excited: ClassVar[float] = 0.5**0.5
    """A parameter is excited when the logs bring its sigma below this fraction of the prior sigma: at this one the logs
    contain more information on it than the prior."""
    method: ClassVar[str]
    """Name of the method in a result."""
    implementation: ClassVar[str]
    """Module and name of the function that identifies with these settings, such as `identify_one_stage`; by name,
    because this function takes them."""

    brakes: ClassVar[bool] = False
    """Whether the model has longitudinal forces."""
    row_rate: ClassVar[float] = math.inf
    """Samples of a log that is at least twice as dense are averaged to about this rate, Hz."""

    def uses(self, name: str) -> bool:
        """Whether the method uses what is stated of a number that a vehicle file does not have."""
        return True

    def models_roll(self, signals: Iterable[str]) -> bool:
        """Whether the method models yaw and roll with these signals, and not yaw only."""
        return bool(names_of(ROLL_RATE, signals))

    @property
    def tyre_law(self) -> Tyres:
        """Law of the side forces of one fit."""
        return "linear"

    @property
    def one_stage(self) -> "OneStage | None":
        """These settings if they are of one stage, which alone uses earlier logs, predicts and learns; else None."""
        return None

    @property
    def stated_noise(self) -> Mapping[str, float]:
        """Noise variance by signal, SI squared, as far as it is stated."""
        return {}


METHODS = {
    "one-stage": "fifthwheel.estimate.identify.settings:OneStage",
    "two-stage": "fifthwheel.apps.cheng_cebon_2011.settings:TwoStage",
}
"""Module and name of the settings of a method, by the name in a result; imported when they are used."""


def settings_of_method(name: str) -> type[CommonSettings]:
    """The settings of a method by its name; a SignalError if there is none."""
    if name not in METHODS:
        raise SignalError(f"method: expected {' or '.join(METHODS)}, got {name!r}; identify again")
    kind: type[CommonSettings] = imported(METHODS[name])
    return kind


def imported(place: str) -> Any:
    """What a module has under a name: "module:name"."""
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


def require_own_functions(contents: Mapping[str, Any], path: str) -> None:
    """A SignalError for a file whose own tyre law or own equations of the steering are not imported, or others."""
    from fifthwheel.truck.steering_equations import found  # only own equations need it

    settings, vehicle = contents.get("settings"), contents.get("vehicle_file", contents.get("vehicle"))
    tyres, steering = (
        part.get(key) if isinstance(part, dict) else None for part, key in ((settings, "tyres"), (vehicle, STEERING))
    )
    try:
        if isinstance(tyres, dict):
            restored_law(tyres)
        if isinstance(steering, dict):
            found(steering.get("equations"))
    except FifthwheelError as error:
        raise SignalError(f"{path}: {error}") from None


@dataclass(frozen=True, kw_only=True)
class OneStage(CommonSettings):
    """Settings of the identification in one stage: all unknowns together, over complete logs.

    Example:
        >>> import fifthwheel as fw
        >>> known = {"tractor.drive.cornering_stiffness": "exact", "steer.tractor.front.delay": "+- 5 ms"}
        >>> fw.OneStage(given=known).tyres
        'auto'
    """

    method = "one-stage"
    implementation = "fifthwheel.estimate.identify.one_stage.identify:identify_one_stage"
    excited = 3**-0.5
    """More than twice the information of the prior: with less, the prior decides, and the error of a positive parameter
    is skewed. Two stages drop a parameter that is not excited."""
    reported: Names = ()
    """Parameters, by path or the end of it, that the result lists with a verdict, beside the usual and the free ones:
    else they are among its uncertain numbers."""
    uniform_payload: bool = True
    """The payload fills its width and height uniformly, so that its height gives CoG height (8) and roll inertia (9).
    False estimates `<unit>.sprung.cog_height` and `<unit>.sprung.roll_inertia` of the laden body separately."""
    tyres: ChosenTyres = "auto"
    """Law of the side forces: linear in the slip angle, with an unknown softening; saturating at the friction of the
    road, which all logs share and which is estimated too; an own function that saturates
    (both `model.dynamics.tyres`); or auto: saturating if the static axle loads are determined."""
    roll: bool = True
    """Model yaw and roll. False: yaw only, without signals that contain roll (roll rates, lateral accelerations, wheel
    speeds), and no payload height is estimated."""
    form: Literal["output_error", "prediction_error"] = "output_error"
    """Output error: residuals of the model without correction by measurements; more robust to model error. Prediction
    error: innovations of a Kalman filter; robust to unmeasured disturbances such as side wind."""
    noise: Variances = field(default_factory=dict)
    """Noise variance by signal, SI squared. A signal that is not listed starts from the article's R."""
    process_noise: float = 1.0
    """Process noise as a multiple of the default (`filters.variances.PROCESS_VARIANCE`); the article has none."""
    outlier: Positive = 4.0
    """Residuals beyond this number of standard deviations get less weight (Huber 1964)."""
    iterations: Count = 50
    """Largest number of steps."""

    brakes = True
    row_rate = 25.0
    """The motion that identifies a truck is below 3 Hz. Inputs and signals are averaged alike."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.roll and not self.uniform_payload:
            raise SignalError(
                "uniform_payload: expected the default, because roll=False estimates no payload height, got False; "
                "remove it, or use roll=True"
            )

    def models_roll(self, signals: Iterable[str]) -> bool:
        """Whether it models yaw and roll, whatever the signals."""
        return self.roll

    @property
    def tyre_law(self) -> Tyres:
        """Law of the side forces of one fit; linear with auto."""
        return "linear" if self.tyres == "auto" else self.tyres

    @property
    def one_stage(self) -> "OneStage":
        """These settings."""
        return self

    @property
    def stated_noise(self) -> Mapping[str, float]:
        """Noise variance by signal, SI squared, as far as it is stated."""
        return self.noise
