"""What a user states of numbers of the truck, the sensors and the road, in the vehicle and the settings.

A statement is used or refused, never dropped.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from fifthwheel.channels import (
    CHANNELS,
    INPUTS,
    SPEED,
    STEER,
    Channel,
    SensorErrorName,
    SignalName,
    channel_of,
    channels_with_errors,
    error_kinds,
    sensor_error_settings,
)
from fifthwheel.dynamics.tyre_law import Tyres
from fifthwheel.dynamics.tyres import saturation_names, saturation_parameters
from fifthwheel.errors import SignalError, VehicleError, suggestion
from fifthwheel.identify import CommonSettings, OneStage
from fifthwheel.identify.estimates import sensor_error_unit
from fifthwheel.identify.settings import DEFAULT_CONSIDERED, MODEL_ERROR_UNITS, MODEL_ERRORS
from fifthwheel.identify.setup import with_tyre_law
from fifthwheel.identify.unknowns.parameters import (
    estimated_parameters,
    guess_prior,
    longest_matching_key,
    prior_of_sensor_error,
)
from fifthwheel.names import ParameterPath, ends_with
from fifthwheel.record import Record
from fifthwheel.record.wheel_speeds import all_pairs
from fifthwheel.vehicle import Vehicle, changes
from fifthwheel.vehicle.masses import with_consistent_masses
from fifthwheel.vehicle.parameters import FRICTION, POSITIONS, is_relative, is_signed, unit_of
from fifthwheel.workflow.statement import Stated, Statement, refused, resolved

S = TypeVar("S", bound=CommonSettings)

SENSOR_PRIORS: Mapping[str, str] = {
    name: unit
    for name, unit in (sensor_error_settings() | {"time_base_delay": "s", "bank": "rad"}).items()
    if hasattr(OneStage, f"{name}_prior")
}
"""Sensor errors of all sensors of a kind, and the bank of the road, whose prior sigma can be chosen, with the SI
unit."""

WIDE_POSITION = 0.5
"""Prior standard deviation of a position that is free, m."""


def apply(vehicle: Vehicle, settings: S, statements: Iterable[Statement]) -> tuple[Vehicle, S]:
    """The vehicle and the settings of an identification that contain the statements.

    Args:
        vehicle: the vehicle to identify.
        settings: of either method; two stages take values and "exact" of parameters.
        statements: in any order.

    Raises:
        FifthwheelError: a name fits nothing, or more than one number that gets a value; a unit does not fit; two
            statements disagree; or the estimation cannot use a statement. The message names it with the cure.
    """
    given = tuple(statements)
    listed = [s for statement in given for s in _of_wheelbase(vehicle, statement, [s.name for s in given])]
    if not listed:
        return vehicle, settings
    apply_to: Any = _apply_to_one_stage if isinstance(settings, OneStage) else _apply_to_two_stages
    changed: tuple[Vehicle, S] = apply_to(vehicle, settings, listed)
    return changed


def _of_wheelbase(vehicle: Vehicle, statement: Statement, names: Sequence[str]) -> list[Statement]:
    """A statement on a wheelbase as statements on the axles of the unit, and on its CoG; others as they are."""
    unit_name, _, quantity = statement.name.rpartition(".")
    if quantity != "wheelbase":
        return [statement]
    known, moved = vehicle.parameters(), vehicle.moved_by_wheelbase()
    if statement.name not in moved:
        positions = [path for path in known if ParameterPath.of(path).quantity == "position"]
        of_unit = [path for path in positions if ParameterPath.of(path).unit == unit_name] or positions
        raise VehicleError(
            f"--set {statement}: expected the wheelbase of a unit with a front coupling and one axle group, one of "
            f"{', '.join(moved) or 'none'}; or state the positions "
            f"{', '.join(path for path in of_unit if 'accelerometer' not in path)}"
        )
    length, cog = vehicle.derived()[statement.name], f"{unit_name}.cog"
    stated = resolved(statement.name, "m", length, [statement])
    sigma = WIDE_POSITION if stated.free else stated.sigma
    of_axles = replace(statement, kind="sigma", sigma=f"{sigma!r} m") if sigma else statement
    shift = length - stated.value
    listed = [
        replace(of_axles, name=path, value=f"{known[path] + shift!r} m" if stated.has_value else "")
        for path in moved[statement.name]
    ]
    # a weighbridge gives the CoG as a fraction of the wheelbase, so that it is uncertain by the same fraction
    if vehicle.stated.get(cog) != 0 and not any(ends_with(cog, name) for name in names):
        (of_file,) = [change.slopes[cog] for change in changes(vehicle) if change.name == cog]
        front = length + vehicle.unit(unit_name).axle_groups[0].position
        of_length = (sigma or 0.0) * (front - known[cog]) / length
        listed.append(Statement(name=cog, kind="sigma", sigma=f"{math.hypot(of_file, of_length)!r} m"))
    return listed


def _apply_to_one_stage(
    vehicle: Vehicle, settings: OneStage, statements: Sequence[Statement]
) -> tuple[Vehicle, OneStage]:
    if not settings.uniform_payload:
        vehicle = vehicle.lumped()  # a statement is on the laden body
    without_value = vehicle.locations().keys() - vehicle.parameters().keys()
    vehicle = vehicle.replace({s.name: 0.0 for s in statements if s.value and s.name in without_value})
    result = _Result(vehicle, settings)
    for name, together in _by_target(statements, lambda s: _targets(vehicle, settings, s)).items():
        if name in MODEL_ERRORS:
            result.set_model_error(resolved(name, MODEL_ERROR_UNITS.get(name, "1"), 0.0, together))
        elif name in SENSOR_PRIORS:
            mean = 1.0 if name.endswith("_gain") else 0.0
            result.set_sensors(resolved(name, SENSOR_PRIORS[name], mean, together))
        elif _is_sensor_error(name):
            mean, sigma = prior_of_sensor_error(vehicle, name, settings) or (0.0, 0.0)
            result.set_sensor(resolved(name, sensor_error_unit(name), mean, together), sigma)
        else:
            stated = resolved(name, unit_of(name), result.known[name], together)
            result.set_parameter(stated)
    return result.finished()


def require_signals(settings: CommonSettings | None, *records: Record) -> None:
    """Refuse settings with a statement on a sensor that none of the logs has.

    Raises:
        SignalError: the settings state an error of such a sensor.
    """
    for message in missing_sensors(settings, *records):
        raise SignalError(f"{message}; map the signal, name another sensor, or remove the statement")


def missing_sensors(settings: CommonSettings | None, *records: Record) -> list[str]:
    """What is stated on sensors that none of the logs has, as sentences."""
    names = {name for record in records for name in record.signals}
    logged = sorted({*names, *all_pairs(names)})
    errors = [error for name in getattr(settings, "stated_priors", {}) if (error := SensorErrorName.of(name))]
    missing = [error for error in errors if channel_of(error.signal) and error.signal not in logged]
    alike = [", ".join(s for s in logged if channel_of(s) is channel_of(error.signal)) for error in missing]
    return [
        f"--set {error.signal}.{error.kind}: expected a sensor of the logs, got one that is in none of them; of its "
        f"kind they have {known or 'none'}"
        for error, known in zip(missing, alike, strict=True)
    ]


class _Result:
    """The vehicle and the settings, as the statements change them."""

    def __init__(self, vehicle: Vehicle, settings: OneStage) -> None:
        self.vehicle, self.settings = vehicle, settings
        self.own, self.known = vehicle.parameters(), _known(vehicle, settings)
        self.estimated = estimated_parameters(vehicle, settings)
        self.values: dict[str, float] = {}
        self.sigmas: dict[str, float] = {}
        self.fixed: list[str] = []
        self.free: list[str] = []
        self.priors = dict(settings.priors)
        self.consider = dict(settings.consider)
        self.stated_priors = dict(settings.stated_priors)
        self.changes: dict[str, Any] = {}
        self.factor_of_file: Stated | None = None

    def set_model_error(self, stated: Stated) -> None:
        if stated.has_value or stated.sigma is None:
            raise refused(stated, "expected a standard deviation such as '+- 50 %' or '+- 5 ms', or exact; give that")
        self.consider.pop(stated.name, None)
        if stated.sigma:
            self.consider[stated.name] = stated.sigma
        if stated.name == "vehicle_file" and stated.sigma != 1:
            self.factor_of_file = stated

    def set_sensors(self, stated: Stated) -> None:
        """The prior sigma of all sensors of a kind."""
        name, sigma = stated.name, stated.sigma
        if stated.has_value and stated.value != float(name.endswith("_gain")):
            raise refused(stated, f"all sensors have it; name one, such as {_example(self.vehicle, name)}, or omit it")
        if sigma is None or (not sigma and name in ("bank", "time_base_delay")):
            raise refused(stated, f"expected a standard deviation above 0 such as '+- 0.01 {SENSOR_PRIORS[name]}'")
        self.changes[f"{name}_prior"] = sigma

    def set_sensor(self, stated: Stated, default: float) -> None:
        error = SensorErrorName.of(stated.name)
        if stated.free:
            raise refused(stated, "is estimated already; give its standard deviation, such as '+- 10 %'")
        if error and error.kind == "play" and stated.value < 0:
            raise refused(stated, f"expected 0 or more, got {stated.value:g} rad; correct it")
        self.stated_priors[stated.name] = stated.value, default if stated.sigma is None else stated.sigma

    def set_parameter(self, stated: Stated) -> None:
        path, sigma = stated.name, stated.sigma
        if stated.has_value:
            self._set_value(stated)
        if sigma == 0:
            self.fixed.append(path)
            self.priors.pop(path, None)
            self.stated_priors.pop(path, None)
            if path in self.own:
                self.sigmas[path] = 0.0
        elif stated.free:
            self._set_free(path, stated)
        elif path in self.estimated and (not is_relative(path) or path in self.stated_priors):
            self.stated_priors[path] = stated.value, self._default_sigma(path) if sigma is None else sigma
        elif sigma is None:
            return
        elif path == FRICTION:
            self.changes["friction_prior"] = stated.relative
        elif path in self.estimated or path not in self.own or self._in_consider(path):
            self.priors[path] = stated.relative
        else:
            self.sigmas[path] = sigma

    def _in_consider(self, path: str) -> bool:
        """Whether settings that are not the default have a prior of an uncertain number."""
        key = longest_matching_key(path, self.consider)
        return key is not None and self.consider[key] != DEFAULT_CONSIDERED.get(key)

    def _default_sigma(self, path: str) -> float:
        """That of an estimated payload height or position: stated before, in the vehicle file, or by default."""
        of_file = 0.0 if path in self.vehicle.assumed else self.vehicle.stated.get(path, 0.0)
        return self.stated_priors.get(path, (0.0, of_file or self.settings.height_prior))[1]

    def _set_value(self, stated: Stated) -> None:
        if stated.name == FRICTION:
            self.changes["friction"] = stated.value
        elif stated.name in self.own:
            self.values[stated.name] = stated.value
        else:
            raise refused(stated, "follows from the vehicle, or is one of all tyres; state only its sigma, or exact")

    def _set_free(self, path: str, stated: Stated) -> None:
        if path == FRICTION:
            return
        if ParameterPath.of(path).quantity == "mass":
            cure = "give its standard deviation, such as '+- 2 %', or weigh the truck"
            raise refused(stated, f"lateral motion alone does not determine a mass; {cure}")
        if ParameterPath.of(path).is_payload_height:
            self.stated_priors[path] = stated.value, self.settings.height_prior
        elif path in self.estimated and path in self.stated_priors:
            return
        elif path not in self.own and path not in self.estimated:
            raise refused(stated, "is no number of a vehicle file; give its standard deviation, such as '+- 20 %'")
        elif is_signed(path):
            is_position = ParameterPath.of(path).quantity in POSITIONS
            wide = WIDE_POSITION if is_position else guess_prior(path, self.settings) * abs(stated.value)
            if not wide:
                raise refused(stated, f"may be 0; give its standard deviation, such as '+- 100 {unit_of(path)}'")
            self.stated_priors[path] = stated.value, wide
        elif stated.value <= 0:
            raise refused(stated, f"expected a value above 0 to be estimated, got {stated.value:g}; give one")
        elif self.vehicle.stated.get(path):
            self.priors[path] = guess_prior(path, self.settings)  # instead of that of the vehicle file
        if path not in self.estimated:
            self.free.append(path)

    def finished(self) -> tuple[Vehicle, OneStage]:
        if self.factor_of_file:
            for path in (path for path, sigma in self.sigmas.items() if sigma):
                if longest_matching_key(path, DEFAULT_CONSIDERED) is None:
                    reason = f"it would also scale the stated sigma of {path}; remove one of the two"
                    raise refused(self.factor_of_file, reason)
        known = {path: self.own[path] for path in self.sigmas} | self.values
        vehicle = with_consistent_masses(self.vehicle, known).with_stated(self.sigmas)
        free = [path for path in self.estimated if path not in self.fixed] + self.free
        return vehicle, replace(
            self.settings,
            fixed=tuple(dict.fromkeys((*self.settings.fixed, *self.fixed))),
            free=tuple(path for path in free if path != FRICTION) if self.free else self.settings.free,
            priors=self.priors,
            consider=self.consider,
            stated_priors=self.stated_priors,
            **self.changes,
        )


def _apply_to_two_stages(
    vehicle: Vehicle, settings: CommonSettings, statements: Sequence[Statement]
) -> tuple[Vehicle, CommonSettings]:
    """Values, and parameters that are exact."""
    known = vehicle.parameters()
    values: dict[str, float] = {}
    fixed = list(settings.fixed)
    for s in statements:
        if s.name in SENSOR_PRIORS or s.name in MODEL_ERRORS or _is_sensor_error(s.name):
            raise VehicleError(f"--set {s}: needs --method one-stage; remove it, or choose that method")
    for path, together in _by_target(statements, lambda s: _paths(vehicle, known, s)).items():
        stated = resolved(path, unit_of(path), known[path], together)
        height = ParameterPath.of(path).is_payload_height and stated.sigma != 0
        if stated.free or stated.sigma or height:
            raise refused(stated, "needs --method one-stage; remove it, or choose that method")
        values |= {path: stated.value} if stated.has_value else {}
        fixed += [path] if stated.sigma == 0 else []
    return with_consistent_masses(vehicle, values), replace(settings, fixed=tuple(dict.fromkeys(fixed)))


def _by_target(
    statements: Iterable[Statement], targets: Callable[[Statement], list[str]]
) -> dict[str, list[Statement]]:
    """The statements on each number; a VehicleError where a value has several numbers."""
    together: dict[str, list[Statement]] = {}
    for statement in statements:
        names = targets(statement)
        if statement.value and len(names) > 1:
            raise VehicleError(
                f"--set {statement}: expected the name of one number for a value, {statement.name} fits "
                f"{', '.join(names)}; give the whole path, or omit the value"
            )
        for name in names:
            together.setdefault(name, []).append(statement)
    return together


def _known(vehicle: Vehicle, settings: OneStage) -> dict[str, float]:
    """Every parameter by path, SI; of saturating tyres too, where the static axle loads are determined."""
    values = vehicle.parameters()
    law = _tyre_law(vehicle, settings)
    if law == "linear":
        return values
    return values | saturation_parameters(vehicle, law) | {FRICTION: settings.friction}


def _tyre_law(vehicle: Vehicle, settings: OneStage) -> Tyres:
    """The law of the side forces that an identification has."""
    return with_tyre_law(vehicle, settings)[0].tyre_law


def _targets(vehicle: Vehicle, settings: OneStage, statement: Statement) -> list[str]:
    """The numbers that a statement names: parameters, a sensor error, or a model error."""
    name = statement.name
    if name in MODEL_ERRORS:
        if name == "softening" and _tyre_law(vehicle, settings) != "linear":
            raise VehicleError(
                f"--set {statement}: saturating tyres soften by their law; remove it, or choose --tyres linear"
            )
        return [name]
    if name in SENSOR_PRIORS:
        single = [(c, signals[0]) for c in INPUTS if len(signals := _signals(vehicle, c)) == 1]
        named = [f"{signal}.{e.kind}" for c, signal in single for e in c.errors if e.setting == name]
        return named if statement.value and named else [name]
    if _is_sensor_error(name):
        _require_sensor(vehicle, statement)
        return [name]
    of_law = any(ends_with(path, name) for path in saturation_names(vehicle.group_paths()))
    if of_law and _tyre_law(vehicle, settings) == "linear":
        noun = "friction" if ends_with(FRICTION, name) else "such parameter"
        raise VehicleError(
            f"--set {statement}: linear tyres have no {noun}; expected --tyres saturating; add it, or remove the "
            "statement"
        )
    return _paths(vehicle, _known(vehicle, settings), statement)


def _paths(vehicle: Vehicle, known: Mapping[str, float], statement: Statement) -> list[str]:
    """The parameters with the path of a statement, or the end of it."""
    name = statement.name
    paths = [path for path in known if ends_with(path, name)]
    if not paths:
        _refuse_change(vehicle, statement)
        ends = {path.rpartition(".")[2] for path in known} | {*SENSOR_PRIORS, *MODEL_ERRORS}
        words = known if "." in name else sorted(ends)
        raise VehicleError(f"{name}: no such parameter in {vehicle.name}; {suggestion(name, words)}")
    used = [path for path in paths if known[path] or statement.kind == "exact"]  # a fraction of 0 is 0
    return used if len(paths) > 1 and used else paths


def _refuse_change(vehicle: Vehicle, statement: Statement) -> None:
    """Refuse the name of a change that several numbers share, such as the axle positions of a unit."""
    altered = [path for change in changes(vehicle) if ends_with(change.name, statement.name) for path in change.slopes]
    if altered:
        example = f"--set {altered[0]}='+- {'2 cm' if unit_of(altered[0]) == 'm' else '1 %'}'"
        raise VehicleError(
            f"--set {statement}: expected one number, got the error that {', '.join(altered)} share; state these with"
            f" their standard deviation, such as {example}"
        )


def _is_sensor_error(name: str) -> bool:
    """Whether a name has the form of a sensor error, of a sensor that may not exist."""
    signal, _, kind = name.rpartition(".")
    return ("." in signal or signal == SPEED.quantity) and SignalName.of(signal).quantity in CHANNELS and bool(kind)


def _require_sensor(vehicle: Vehicle, statement: Statement) -> None:
    """Refuse an error that no sensor of the vehicle can have."""
    signal, _, kind = statement.name.rpartition(".")
    channel, steers = channel_of(signal), vehicle.steer_signals()
    if channel is STEER and signal not in steers:
        raise SignalError(
            f"--set {statement}: {signal} is no steer angle of {vehicle.name}; {suggestion(signal, steers)}"
        )
    if channel not in channels_with_errors():
        names = ", ".join(c.quantity for c in channels_with_errors() if c is not SPEED)
        raise SignalError(f"--set {statement}: expected a signal that is compared with the model, one of {names}")
    unit, units = SignalName.of(signal).unit, [unit.name for unit in vehicle.units]
    if not SignalName.of(signal).fits(units):
        raise SignalError(f"--set {statement}: {unit}: no such unit in {vehicle.name}; {suggestion(unit, units)}")
    if kind not in error_kinds(signal):
        cure = suggestion(kind, error_kinds(signal))
        raise SignalError(f"--set {statement}: {signal} has no error {kind!r}; {cure}")


def _example(vehicle: Vehicle, name: str) -> str:
    """A sensor error of a kind, as a name of one sensor."""
    for channel in channels_with_errors():
        for error in channel.errors:
            if error.setting == name:
                return f"{next(iter(_signals(vehicle, channel)), channel.quantity)}.{error.kind}"
    return "yaw_rate.tractor.gain"


def _signals(vehicle: Vehicle, channel: Channel) -> tuple[str, ...]:
    """The signals of a channel that a vehicle may have, those of the last unit first."""
    if channel in INPUTS:
        return vehicle.steer_signals() if channel is STEER else (channel.quantity,)
    return tuple(f"{channel.quantity}.{unit.name}" for unit in reversed(vehicle.units))
