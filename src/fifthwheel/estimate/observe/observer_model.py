"""The numbers of an observer's compiled step, for the vehicle as given and with changed parameters."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from fifthwheel.base.errors import SignalError, suggestion
from fifthwheel.base.lazy import lazy
from fifthwheel.base.native import Scan
from fifthwheel.base.types import Array
from fifthwheel.data.channels import (
    CHANNELS,
    MODELLED,
    STEER,
    SensorErrorName,
    SignalName,
    channel_of,
    is_of,
    measured_signals,
)
from fifthwheel.estimate.filters import Noise, variances
from fifthwheel.estimate.filters.initial_state import (
    TYPICAL_STEER_SIGMA,
    bank_effect,
    initial_covariance,
    steady_initial_state,
    steer_effects,
)
from fifthwheel.estimate.filters.model import pack_array
from fifthwheel.estimate.observe.observer_step import ObservedChain, observed_chain, observer_step
from fifthwheel.estimate.observe.settings import ObserverSettings
from fifthwheel.estimate.observe.uncertainty import Uncertainty
from fifthwheel.estimate.stream import InputRule, StreamSettings, magnitude
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.sensors import sensor_parameters
from fifthwheel.model.dynamics.simulation import StepLimit, step_limit
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import FRICTION, HALF_TRACK

SUSPECT_STEER_SIGMA = 0.15
"""rad; the measurements are within the gate after a restart, whatever the steer angle was."""
SHORTEST = 0.01
"""s; the change of this time is plausible within any shorter time, because of noise and repeated samples."""
NO_CHANGES: Mapping[str, float] = {}


@dataclass(frozen=True, kw_only=True, eq=False)
class ObserverModel:
    """A vehicle with the models of its measured and its reported signals, which are built when they are first used."""

    vehicle: Vehicle  # with the measured steer angles
    settings: ObserverSettings
    outputs: tuple[str, ...]  # the measured signals
    reported: tuple[str, ...]  # the reported signals
    roll: bool  # yaw and roll, or yaw only

    def __getstate__(self) -> dict[str, Any]:
        """The fields without the models, which a copy builds anew."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @lazy
    def model(self) -> ObservedChain:
        """The model of the measured signals."""
        return self._chain(self.outputs)

    @lazy
    def report(self) -> ObservedChain:
        """The model of the reported signals."""
        return self._chain(self.reported)

    def _chain(self, names: tuple[str, ...]) -> ObservedChain:
        return observed_chain(
            self.vehicle,
            names,
            offset_states=[name for name in self.outputs if CHANNELS[SignalName.of(name).quantity].large_offset],
            roll=self.roll,
            estimate_bank=self.settings.estimate_bank,
            tyres=self.settings.tyre_law,
        )

    @lazy
    def scan(self) -> Scan:
        """The compiled step."""
        return observer_step(self.model, self.report)

    @lazy
    def stream(self) -> StreamSettings:
        """How it treats faults of the signals."""
        settings = self.settings
        rates = {"speed": settings.max_acceleration}
        rates |= dict.fromkeys(self.vehicle.steer_signals(), settings.max_steer_rate)
        return StreamSettings(
            inputs=tuple(
                InputRule(name=name, largest=magnitude(name), jump=rate * SHORTEST, rate=rate)
                for name, rate in rates.items()
            ),
            measured={name: magnitude(name) for name in self.outputs},
            min_speed=settings.min_speed,
            hold=settings.hold,
            max_gap=settings.max_gap,
            coast=settings.coast,
            speed_smoothing=settings.speed_smoothing,
        )

    @property
    def step_limit(self) -> StepLimit:
        """The longest step of the model."""
        return step_limit(self.vehicle, self.roll)

    def values(self) -> dict[str, float]:
        """Every parameter of the vehicle and of the measuring sensors, by name, SI."""
        values = dynamics.all_parameters(self.vehicle, self.outputs, tyres=self.settings.tyre_law)
        return values | self._surroundings() | dict(self.settings.sensor_errors)

    def _surroundings(self) -> dict[str, float]:
        """Parameters that neither the vehicle nor a sensor has, as the settings give them."""
        settings = self.settings
        values = {HALF_TRACK: settings.half_track, BANK: settings.bank_mean}
        values |= {} if settings.friction is None else {FRICTION: settings.friction}
        return values | dict(settings.surroundings)

    def uncertain(self, uncertainty: Uncertainty) -> Uncertainty:
        """The uncertainty without what has no effect: errors of sensors that are not measured, and unknowns that the
        filter estimates with a prior of its own.

        Raises:
            SignalError: a name is neither a parameter of the vehicle nor an error of a sensor on it.
        """
        known = {*self.model.known, *self.model.unknowns, *self._surroundings()}
        for name in uncertainty.names:
            if name not in known and not self._is_error_of_a_sensor(name):
                raise SignalError(
                    f"{name}: uncertain, but {self.vehicle.name} has no such parameter or sensor error;"
                    f" {suggestion(name, known)}"
                )
        estimated = {BANK} if self.model.estimates_bank else set()
        estimated |= {name for name in self.model.offsets if self.settings.offset_sigma(name)}
        return uncertainty.among(known - estimated)

    def _is_error_of_a_sensor(self, name: str) -> bool:
        """Whether a name is an error that a sensor on the vehicle can have."""
        error = SensorErrorName.of(name)
        if error is None:
            return False
        if is_of(error.signal, STEER):
            axles = {f"{unit.name}.{axle.name}" for unit in self.vehicle.units for axle in unit.axles}
            return SignalName.of(error.signal).place in axles
        if error.signal not in measured_signals([error.signal], [unit.name for unit in self.vehicle.units], MODELLED):
            return False
        return name in sensor_parameters(self.vehicle, error.signal)

    def constant(self, changed: Mapping[str, float] = NO_CHANGES, gate: float | None = None) -> Array:
        """Constant of the compiled step (see `observer_step`), by default with the gate of the settings.

        Parameters and sensor errors may be changed, by name; their values are not validated.
        """
        settings, outputs = self.settings, self.outputs
        constant = dict.fromkeys(SignalName.of(name).quantity for name in self.model.offsets)
        drift = variances.OBSERVER_PROCESS_VARIANCE | dict.fromkeys(constant, 0.0)
        noise = Noise(
            process=variances.process_covariance(self.model.states, drift, settings.process_noise),
            measurement=np.array([variances.sensor_variance(self.vehicle, name, settings.noise) for name in outputs]),
            gate=settings.gate if gate is None else gate,
        )
        c = self.model.known_values({**self.values(), **changed})
        considered = [] if self.model.estimates_bank else [settings.bank]
        monitor_settings = [settings.nis_window, settings.restart_after]
        report = self.report.known_values(self._report_values(changed))
        return np.concatenate([c, noise.vector(), report, considered, monitor_settings])

    def _report_values(self, changed: Mapping[str, float]) -> dict[str, float]:
        """Parameters of the report. Of the sensor errors only those of steer angles apply: reports have no errors."""
        parameters, names = self.vehicle.parameters() | self._surroundings(), self.reported
        values = dynamics.all_parameters(self.vehicle, names, tyres=self.settings.tyre_law) | self._surroundings()
        errors = {**self.settings.sensor_errors, **changed}
        values |= {name: value for name, value in errors.items() if SignalName.of(name).quantity == "steer"}
        values |= {name: value for name, value in changed.items() if name in parameters}
        for name in signals_with_position(names):  # under the CoG, also if the CoG is changed
            unit = SignalName.of(name).unit
            values |= {f"{name}.position": values[f"{unit}.cog"], f"{name}.height": values[f"{unit}.roll_axis_height"]}
        return values | {f"{name}.position": x for name, x in self.settings.positions.items()}

    def start(self, inputs: Mapping[str, float], *, suspect: bool = False) -> Array:
        """[x, P, considered] before a first sample: the steady state of the inputs and of the means of the unknowns.

        If the measurements contradict the inputs (`suspect`), P allows for any steer angle.
        """
        values, n = self.values(), len(self.model.states)
        unknowns = self.model.unknowns
        means = np.array([values[name] for name in unknowns])
        errors = self.settings.sensor_errors
        x0, m = steady_initial_state(self.vehicle, inputs, errors, roll=self.roll, bank=means[0])
        P0 = initial_covariance(m, SUSPECT_STEER_SIGMA if suspect else TYPICAL_STEER_SIGMA)
        sigmas = np.array([self.settings.bank, *map(self.settings.offset_sigma, unknowns[1:])])
        bank, *offsets = sigmas[:, None] * self._effects(m, inputs)
        states = [bank, *offsets] if self.model.estimates_bank else offsets
        P0 = np.pad(P0, (0, n - len(P0))) + sum((np.outer(effect, effect) for effect in states), np.zeros((n, n)))
        x0 = np.concatenate([x0, means if self.model.estimates_bank else means[1:]])
        return np.concatenate([x0, pack_array(P0), [] if self.model.estimates_bank else bank])

    def effects(self, inputs: Mapping[str, float]) -> Array:
        """Change (u, n) of the first state, from the inputs there, per unit of each of the u unknowns."""
        _, m = steady_initial_state(self.vehicle, inputs, {}, roll=self.roll)
        return self._effects(m, inputs)

    def _effects(self, m: dynamics.Matrices, inputs: Mapping[str, float]) -> Array:
        values, steers = self.values(), self.vehicle.steer_signals()
        slopes = np.array([dynamics.steer_angle(name, inputs[name], values).slope for name in steers])
        of_sensors = np.zeros((len(self.model.offsets) - len(steers), len(m.A)))
        moved = np.vstack([bank_effect(m), -slopes[:, None] * steer_effects(m), of_sensors])
        states = moved if self.model.estimates_bank else moved[:, :-1]
        return np.hstack([states, np.eye(len(moved))[:, 1:]])


def signals_with_position(reported: tuple[str, ...]) -> list[str]:
    """The reported signals that depend on a position on their unit."""
    channels = [(name, channel_of(name)) for name in reported]
    return [name for name, channel in channels if channel and channel.model and channel.model.has_place]
