"""The numbers of an observer's compiled step, for the vehicle as given and with changed parameters."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fifthwheel import dynamics
from fifthwheel._lazy import lazy
from fifthwheel._types import Array
from fifthwheel.dynamics import ChainModel
from fifthwheel.dynamics.sensors import QUANTITIES, sensor_parameters
from fifthwheel.dynamics.steps import StepLimit
from fifthwheel.errors import SignalError, suggestion
from fifthwheel.filters import Noise, variances
from fifthwheel.filters.initial_state import TYPICAL_STEER_SIGMA, initial_state
from fifthwheel.filters.model import pack_array
from fifthwheel.names import SENSOR_ERROR_KINDS, ParameterPath, SensorErrorName, SignalName
from fifthwheel.native import Scan
from fifthwheel.observe.observer_step import observer_step
from fifthwheel.observe.settings import ObserverSettings
from fifthwheel.observe.uncertainty import SigmaPointPair, Uncertainty
from fifthwheel.vehicle import Vehicle

SUSPECT_STEER_SIGMA = 0.15
"""rad; the measurements are within the gate after a restart, whatever the steer angle was."""
NO_CHANGES: Mapping[str, float] = {}
SIGNED = frozenset({"cog", "position", "leading_position", "trailing_position", "roll_yaw_product"})
"""Quantities of a vehicle that may be negative; all others keep their sign."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ObserverModel:
    """A vehicle with the models of its measured and its reported signals.

    Methods with an argument `changed` take values of parameters and sensor errors, by name, that replace the given ones
    in the constants of the models. These values are not validated.
    """

    vehicle: Vehicle
    model: ChainModel  # outputs: the measured signals
    report: ChainModel  # outputs: the reported signals
    settings: ObserverSettings

    @lazy
    def scan(self) -> Scan:
        """The compiled step."""
        return observer_step(self.model, self.report)

    @lazy
    def step_limit(self) -> StepLimit:
        """The longest step of the model."""
        return StepLimit(self.vehicle, roll=self.model.roll)

    def values(self) -> dict[str, float]:
        """Every parameter of the vehicle and of the measuring sensors, by name, SI."""
        return dynamics.all_parameters(self.vehicle, self.model.outputs) | dict(self.settings.sensor_errors)

    def pairs(self, uncertainty: Uncertainty) -> list[SigmaPointPair]:
        """Sigma points of the vehicle. Errors of sensors that are not measured have no effect.

        Raises:
            SignalError: a name is neither a parameter of the vehicle nor an error of a sensor on it.
        """
        parameters, known = self.vehicle.parameters(), self.model.known
        for name in uncertainty.names:
            if name not in known and not self._is_error_of_a_sensor(name):
                raise SignalError(
                    f"{name}: uncertain, but {self.vehicle.name} has no such parameter or sensor error;"
                    f" {suggestion(name, known)}"
                )
        positive = {n for n, value in parameters.items() if value > 0 and ParameterPath.of(n).quantity not in SIGNED}
        return uncertainty.among(known).pairs(self.values(), positive)

    def _is_error_of_a_sensor(self, name: str) -> bool:
        """Whether a name is an error that a sensor on the vehicle can have."""
        error = SensorErrorName.of(name)
        if error is None:
            return False
        signal = SignalName.of(error.signal)
        if signal.quantity == "steer":
            axles = {f"{unit.name}.{axle.name}" for unit in self.vehicle.units for axle in unit.axles}
            return signal.place in axles and error.kind in SENSOR_ERROR_KINDS
        if signal.quantity not in QUANTITIES or signal.place not in {unit.name for unit in self.vehicle.units}:
            return False
        return name in sensor_parameters(self.vehicle, error.signal)

    def constant(self, changed: Mapping[str, float] = NO_CHANGES, gate: float | None = None) -> Array:
        """Constant of the compiled step (see `observer_step`); by default with the settings' gate."""
        settings, outputs = self.settings, self.model.outputs
        noise = Noise(
            process=variances.process_covariance(
                self.model.states, variances.OBSERVER_PROCESS_VARIANCE, settings.process_noise
            ),
            measurement=np.array([variances.sensor_variance(self.vehicle, name, settings.noise) for name in outputs]),
            gate=settings.gate if gate is None else gate,
        )
        c = self.model.known_values({**self.values(), **changed})
        monitor_settings = [settings.nis_window, settings.restart_after]
        report = self.report.known_values(self._report_values(changed))
        return np.concatenate([c, noise.vector(), report, monitor_settings])

    def _report_values(self, changed: Mapping[str, float]) -> dict[str, float]:
        """Parameters of the report. Of the sensor errors only those of steer angles apply: reports have no errors."""
        parameters, names = self.vehicle.parameters(), self.report.outputs
        values = dynamics.all_parameters(self.vehicle, names)
        errors = {**self.settings.sensor_errors, **changed}
        values |= {name: value for name, value in errors.items() if SignalName.of(name).quantity == "steer"}
        values |= {name: value for name, value in changed.items() if name in parameters}
        for name in signals_with_position(names):  # under the CoG, also if the CoG is changed
            unit = SignalName.of(name).unit
            values |= {f"{name}.position": values[f"{unit}.cog"], f"{name}.height": values[f"{unit}.roll_axis_height"]}
        return values | {f"{name}.position": x for name, x in self.settings.positions.items()}

    def start(self, inputs: Mapping[str, float], *, suspect: bool = False) -> Array:
        """[x, P] before a first sample.

        Args:
            inputs: speed, m/s, and steer angles, rad, of the sample.
            suspect: whether the measurements contradict the inputs; then P allows for any steer angle.
        """
        x0, P0 = initial_state(
            self.vehicle,
            inputs,
            self.settings.sensor_errors,
            roll=self.model.roll,
            steer_sigma=SUSPECT_STEER_SIGMA if suspect else TYPICAL_STEER_SIGMA,
            bank=self.settings.bank,
        )
        return np.concatenate([x0, pack_array(P0)])


def signals_with_position(reported: tuple[str, ...]) -> list[str]:
    """The reported signals that depend on a position on their unit."""
    quantities = [QUANTITIES.get(SignalName.of(name).quantity) for name in reported]
    return [name for name, quantity in zip(reported, quantities, strict=True) if quantity and quantity.has_position]
