"""The on-line state estimator of a vehicle: a Kalman filter for single samples and for records.

Section 2.3 of Cheng and Cebon (2011). `push` processes one sample; `batch` processes a record and gives the same result
as `push`, bit for bit. Both are causal: missing inputs are not interpolated from later samples.
"""

import copy
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Self

import casadi as ca
import numpy as np

from fifthwheel.base.arguments import expect, expect_names, expect_optional, expect_sample
from fifthwheel.base.errors import SignalError, suggestion
from fifthwheel.base.lazy import lazy
from fifthwheel.base.native import Scan
from fifthwheel.base.types import Array
from fifthwheel.data.channels import CHANNELS, MEASURED, WHEEL_SPEED_DIFFERENCE, SignalName, measured_signals, names_of
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import sample_with_differences, sides_of
from fifthwheel.estimate.filters.variances import require_units
from fifthwheel.estimate.observe import monitor, offline
from fifthwheel.estimate.observe.observer_model import ObserverModel, signals_with_position
from fifthwheel.estimate.observe.observer_step import (
    ObservedChain,
    filter_step,
    observer_function,
    output_size,
    reported_signals,
)
from fifthwheel.estimate.observe.settings import ObserverSettings
from fifthwheel.estimate.observe.states import States
from fifthwheel.estimate.observe.uncertainty import Uncertainty
from fifthwheel.estimate.stream import VALID, Stream, take_turn
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.sensors import wheel_pairs, with_wheel_speed_differences
from fifthwheel.model.dynamics.tyres import saturation_names
from fifthwheel.truck import Vehicle
from fifthwheel.truck.steering import require_roll


class Observer:
    """Estimates the states of a vehicle from its measured signals.

    The first sample or record builds and compiles the model, which takes up to a few seconds; a compiled model is
    stored in the cache of `native`.

    Args:
        vehicle: with its numbers, as identified.
        signals: names of the available signals: the speed, a steer angle, and at least one yaw rate, roll rate, roll
            angle or articulation angle; lateral accelerations and wheel speeds of both sides of an axle that is not
            driven are used in addition. With a roll rate, a roll angle, a lateral acceleration, which contains gravity
            by the roll angle, or wheel speeds, the yaw-roll model is used, otherwise the yaw model; also with
            `ObserverSettings(roll=False)`, which does not use these signals. `roll` says which model it is.
        settings: of the observer.

    Raises:
        SignalError: the speed or every steer angle is missing, no signal is a measurement, or the settings give a
            position for a signal that has none.
        VehicleError: no axle of the vehicle is steerable.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> record = fw.simulate(truck, count=1)
        >>> observer = fw.Observer(truck, record.signals)  # of an identification: result.observer()
        >>> states = observer.batch(record)
        >>> sample = {"time": record.time[0]} | {name: values[0] for name, values in record.signals.items()}
        >>> bool(observer.push(sample)["sideslip.semitrailer"] == states.values["sideslip.semitrailer"][0])
        True
    """

    def __init__(self, vehicle: Vehicle, signals: Iterable[str], settings: ObserverSettings | None = None) -> None:
        expect("vehicle", vehicle, Vehicle)
        expect_names("signals", signals)
        expect_optional("settings", settings, ObserverSettings)
        self.settings = settings or ObserverSettings()
        given = frozenset(signals)
        available = given.union(wheel_pairs(vehicle, given))
        self.vehicle = vehicle.with_logged_steering(available, "the signals")
        if "speed" not in available:
            raise SignalError("speed: not among the signals; map the forward speed in m/s to it")
        units = [unit.name for unit in vehicle.units]
        usable = [channel for channel in MEASURED if self.settings.roll or not channel.of_roll]
        self.outputs = measured_signals(available, units, usable)
        channels = [CHANNELS[SignalName.of(name).quantity] for name in self.outputs]
        if all(channel.large_offset for channel in channels):  # their offsets would decide
            raise SignalError(
                f"yaw_rate.{units[0]}: not among the signals; an observer needs at least one yaw rate, roll rate, roll "
                "angle or articulation angle of a unit of the vehicle"
            )
        self.inputs = ("speed", *self.vehicle.steer_signals())
        self._differences = names_of(WHEEL_SPEED_DIFFERENCE, self.outputs)
        sources = {name: sides_of(name) for name in self._differences if name not in given}
        self._measured = [source for name in self.outputs for source in sources.get(name, (name,))]
        own_roll = self.vehicle.steering is not None and self.vehicle.steering.uses_roll
        self.roll = self.settings.roll and (own_roll or any(channel.of_roll for channel in channels))
        require_roll(self.vehicle.steering, self.roll)
        self.reported = reported_signals(vehicle, roll=self.roll, bank=self.settings.estimate_bank)
        for name in self.settings.positions:
            if name not in (allowed := signals_with_position(self.reported)):
                raise SignalError(f"{name}: has no position; positions can be given for {', '.join(allowed)}")
        known = {*dynamics.all_parameters(self.vehicle, ()), *saturation_names(vehicle.group_paths())}
        for name in self.settings.surroundings.keys() - known:
            raise SignalError(f"surroundings, {name}: no such parameter; {suggestion(name, known)}")
        require_units(vehicle, self.settings.noise)
        sigmas = [f"{name}.sigma" for name in self.reported]
        self._names = (*self.reported, *sigmas)  # in the order of the compiled step
        pairs = [name for pair in zip(self.reported, sigmas, strict=True) for name in pair]
        self._without_states = dict.fromkeys(["time", "status", "nis", *pairs], math.nan)
        self._model = ObserverModel(
            vehicle=self.vehicle, settings=self.settings, outputs=self.outputs, reported=self.reported, roll=self.roll
        )
        self._filter, self._idle = _ObserverFilter(self._model), [True]
        self.reset()

    @property
    def model(self) -> ObservedChain:
        """The model of the measured signals."""
        return self._model.model

    @property
    def signals(self) -> tuple[str, ...]:
        """The signals that it uses: of a wheel speed difference the wheel speeds, unless the difference is given."""
        return (*self.inputs, *self._measured)

    @property
    def scan(self) -> Scan:
        """The compiled step."""
        return self._model.scan

    @property
    def function(self) -> ca.Function:
        """The step as exported, see `observer_function`."""
        return observer_function(self._model.model, self._model.report, filter_step, ca.MX)

    @property
    def constant(self) -> Array:
        """The constant of the compiled step (n_constant,): vehicle, noise and settings, see `observer_step`."""
        return np.array(self._filter.constant)

    def __copy__(self) -> Self:
        return copy.deepcopy(self)

    def reset(self) -> None:
        """Return to the state before the first sample."""
        self.stream = Stream(self._model.stream, self._model.step_limit)

    def push(self, sample: Mapping[str, float | None]) -> dict[str, float]:
        """Process one sample.

        Args:
            sample: "time" in s, and signals in SI by name; a signal is missing if its value is absent, None or NaN.

        Returns:
            "time", "status" (`Status`), "nis" (health, see `States`), and each reported state with "<state>.sigma",
            SI; NaN if the status is TOO_SLOW or INPUT_MISSING.

        Raises:
            SignalError: the time is missing, not finite, or not after the previous one; or another thread pushes a
                sample. The observer does not change. Samples in order for 1 s after the time went back are a new start.
        """
        take_turn(self._idle)
        try:
            if self._differences:
                sample = sample_with_differences(sample, self._differences)
            get = sample.get
            status = self.stream.process_sample(
                self._filter, get("time"), map(get, self.inputs), map(get, self.outputs)
            )
            answer = self._without_states.copy()
            answer["time"] = self.stream.time
            if status in VALID:
                out = self._filter.reported.tolist()
                answer.update(zip(self._names, out, strict=False))
                answer["nis"] = nis = out[-2]
                status = monitor.health(status, out[-3], nis, self.settings.max_nis)
            answer["status"] = status
        except (AttributeError, TypeError):
            expect_sample(sample)
            raise
        else:
            return answer
        finally:
            self._idle.append(True)

    def batch(self, record: Record, uncertainty: Uncertainty | None = None) -> States:
        """States of a record from a new start. The state of the observer itself does not change.

        Args:
            record: with all signals of the observer.
            uncertainty: of parameters and sensor errors. Every sigma then contains their contribution; values do not
                change.

        Raises:
            SignalError: the record does not have a signal of the observer, or an uncertain name does not exist.
        """
        return self._states(record, uncertainty, smooth=False)

    def smooth(self, record: Record, uncertainty: Uncertainty | None = None) -> States:
        """States of a record given all samples of their segment; arguments and errors as in `batch`.

        A segment ends where the filter starts again. Status and innovations are those of `batch`, and so are the states
        of a segment in which the smoother diverges; samples before the filter has settled are OK if later ones agree.
        """
        return self._states(record, uncertainty, smooth=True)

    def _states(self, record: Record, uncertainty: Uncertainty | None, *, smooth: bool) -> States:
        expect("record", record, Record)
        record = with_wheel_speed_differences(record, self.vehicle)
        return offline.states(record, self._model, uncertainty, smooth=smooth)

    def _identity(self) -> dict[str, Any]:
        """Vehicle, signals and settings, for JSON."""
        return {
            "signals": [*self.inputs, *self.outputs],
            "settings": self.settings.as_dict(),
            "constant": self._filter.constant.tolist(),
            "carry": len(self._filter.carry),  # other versions may have another state
        }

    def save(self) -> dict[str, Any]:
        """The state of the observer for `resume`, for JSON."""
        return {"made_for": self._identity(), **self.stream.save(), "carry": self._filter.carry.tolist()}

    def resume(self, saved: Mapping[str, Any]) -> None:
        """Continue from the result of `save`, also in another process.

        Raises:
            SignalError: an observer of another vehicle, other signals, other settings or another version saved it.
        """
        if saved["made_for"] != self._identity():
            raise SignalError(
                "state: expected one of the same vehicle, signals and settings, and of this version, got another one; "
                "start without it"
            )
        self.stream.resume(saved)
        self._filter.carry[:] = saved["carry"]


class _ObserverFilter:
    """The compiled step of an observer for one sample.

    `row` and `out` are the memory of its sample and output, `reported` the part of `out` that is not for sensitivities.
    Everything but the carry is built when it is first used.
    """

    def __init__(self, model: ObserverModel) -> None:
        self._model = model

    def __getstate__(self) -> dict[str, Any]:
        """What a copy does not build anew."""
        return {name: value for name, value in vars(self).items() if name in ("_model", "carry")}

    constant = lazy(lambda self: self._model.constant())  # see `observer_step`
    carry = lazy(lambda self: np.zeros(self._model.scan.n_carry))
    row: Any = lazy(lambda self: np.zeros(self._model.scan.n_sample).data)
    out: Any = lazy(lambda self: np.zeros(self._model.scan.n_output).data)
    reported: Any = lazy(lambda self: self.out[-output_size(self._model.model, self._model.report) :])

    @lazy
    def step(self) -> Callable[[], None]:
        """Process the row."""
        return self._model.scan.bound(self.carry, np.asarray(self.row), self.constant, np.asarray(self.out))

    def start(self, stream: Stream, monitored: Array = monitor.START, *, suspect: bool = False) -> None:
        """Start at the steady state of the inputs; `monitored` is the carry of the monitor."""
        inputs = dict(zip(stream.settings.names, stream.inputs, strict=True))
        self.carry[:] = np.append(self._model.start(inputs, suspect=suspect), monitored)

    def ends(self, stream: Stream) -> tuple[list[float], list[float]]:
        """The held inputs."""
        return stream.last, stream.inputs

    def update(self, stream: Stream) -> bool:
        """Process a sample, again from a new start if the measurements contradict the state."""
        self.step()
        out, m = self.out, len(self._model.outputs)
        if out[-1]:
            self.start(stream, monitor.after_restart(out[-2]), suspect=True)
            for i, value in enumerate((0.0, *stream.inputs)):  # no step leads to the sample
                self.row[i] = value
            self.step()
        return any(out[-3 - m : -3])
