"""What is given of the numbers of truck, sensors, road and model: its way into the vehicle, and from the signal map.

A statement is used or refused, never dropped.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from fifthwheel.base.errors import SignalError, VehicleError, suggestion
from fifthwheel.base.names import PAYLOAD_HEIGHT, ParameterPath, begins_with, ends_with
from fifthwheel.base.options import FRICTION_RANGE
from fifthwheel.base.spelling import setting
from fifthwheel.data.channels import (
    SPEED,
    STEER,
    SensorErrorName,
    SignalName,
    channel_of,
    channels_with_errors,
    error_kinds,
)
from fifthwheel.data.channels.sensors import SensorPrior
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import all_pairs
from fifthwheel.estimate.identify.settings import ROLL_PARAMETERS, CommonSettings, OneStage
from fifthwheel.estimate.identify.setup import with_tyre_law
from fifthwheel.estimate.identify.statement import (
    GROUPS,
    Stated,
    Statement,
    applies,
    combined,
    refused,
    stated,
    statement,
)
from fifthwheel.estimate.identify.unknowns.parameters import (
    VARIATION,
    given_parameters,
    left_out,
    prior_of_sensor_error,
    reported_parameters,
    softening_priors,
)
from fifthwheel.model.dynamics.tyres import saturation_names
from fifthwheel.truck import Vehicle, changes, toml_format
from fifthwheel.truck.quantities import (
    BANK_VARIATION,
    DISCREPANCY,
    DRIVE_AXLE_BRAKING,
    FRICTION,
    ROAD_BANK,
    TIME_BASE,
    quantity_of,
    unit_of,
)
from fifthwheel.truck.weighing import with_consistent_masses

S = TypeVar("S", bound=CommonSettings)

WITHOUT_MEAN = (ROAD_BANK, BANK_VARIATION, DISCREPANCY, TIME_BASE)
"""Numbers whose mean is 0."""


def applied(vehicle: Vehicle, settings: S) -> tuple[Vehicle, S]:
    """The vehicle with what the settings state of its numbers, and the settings with the other statements.

    Twice is once.

    Raises:
        FifthwheelError: a name fits nothing, or a value more than one number; a unit does not fit; two statements
            disagree; or the estimation cannot use a statement. The message names it with the cure.
    """
    if not settings.given:
        return vehicle, settings
    if not settings.uniform_payload:
        vehicle = vehicle.lumped()  # a statement is on the laden body
    written = [statement(*item) for item in settings.given.items()]
    listed = list(_without_wheelbases(vehicle, written))
    without_value = vehicle.locations().keys() - vehicle.parameters().keys()
    vehicle = vehicle.replace({s.name: 0.0 for s in listed if s.value != "" and s.name in without_value})
    law, own = with_tyre_law(vehicle, settings.one_stage or OneStage(tyres="linear"))[0], vehicle.parameters()
    others = _beyond_vehicle(vehicle, law)
    for each in listed:
        _require_use(vehicle, law, settings, each, others)
    given, reported = combined(listed), reported_parameters(vehicle, law)
    found = [stated(given, path, unit_of(path), value, reported=path in reported) for path, value in own.items()]
    found = [each for each in found if each.source is not None]
    values = {each.name: each.value for each in found if each.has_value}
    sigmas = dict(_sigmas(vehicle, settings, found, reported))
    known = {s.name: s.value for s in found if s.name in sigmas and s.source and s.source.name not in GROUPS}
    changed = with_consistent_masses(vehicle, known | values)
    sigmas = {path: sigma for path, sigma in sigmas.items() if changed.stated.get(path) != sigma}
    kept = combined(_kept(written, own, others))
    return changed.with_stated(sigmas) if sigmas else changed, replace(settings, given=kept)


def _sigmas(
    vehicle: Vehicle, settings: CommonSettings, found: Sequence[Stated], reported: Sequence[str]
) -> Iterator[tuple[str, float]]:
    """The standard deviations that are stated of numbers of the vehicle; a VehicleError where one has no use."""
    for each in found:
        is_height = ends_with(each.name, PAYLOAD_HEIGHT)
        if settings.one_stage is None:
            if each.free or (each.sigma and each.name not in reported):
                raise refused(each, "needs one stage; remove it, or choose that method")
            if is_height and each.sigma is None:
                raise refused(each, "two stages need its standard deviation, or exact; give it, such as '+- 1 m'")
        if each.free:
            _require_possible(each)
        elif each.sigma is not None:
            yield each.name, each.sigma
        elif is_height and (each.name in vehicle.assumed or not vehicle.stated.get(each.name)):
            yield each.name, quantity_of(each.name).sigma


def _require_possible(found: Stated) -> None:
    """Refuse a number that logs do not determine, or without a wide prior."""
    row, last = quantity_of(found.name), ParameterPath.of(found.name).quantity
    if last == "mass":
        cure = "give its standard deviation, such as '+- 2 %', or weigh the truck"
        raise refused(found, f"lateral motion alone does not determine a mass; {cure}")
    if row.signed and not found.value and not row.absolute:
        raise refused(found, f"may be 0; give its standard deviation, such as '+- 100 {unit_of(found.name)}'")
    if found.value <= 0 and not row.signed:
        raise refused(found, f"expected a value above 0 to be estimated, got {found.value:g}; give one")


def _kept(listed: Sequence[Statement], own: Mapping[str, float], others: Sequence[str]) -> Iterator[Statement]:
    """The statements without the values that the vehicle has now."""
    for each in listed:
        of_vehicle = ends_with(each.name, "wheelbase") or any(applies(each, path) for path in own)
        if not of_vehicle or any(applies(each, name) for name in others):
            yield each
        elif each.kind != "value":
            yield replace(each, value="")


def _without_wheelbases(vehicle: Vehicle, listed: Sequence[Statement]) -> Iterator[Statement]:
    """The statements; one on a wheelbase as statements on the axles of the unit, and on its CoG."""
    known, moved = vehicle.parameters(), vehicle.moved_by_wheelbase()
    for each in listed:
        named = ParameterPath.of(each.name)
        if named.last_word != "wheelbase":
            yield each
            continue
        if each.name not in moved:
            positions = {path: parsed for path in known if (parsed := ParameterPath.of(path)).quantity == "position"}
            of_unit = [path for path, parsed in positions.items() if parsed.unit == named.owner] or list(positions)
            raise VehicleError(
                f"{each}: expected the wheelbase of a unit with a front coupling and one axle group, one of "
                f"{', '.join(moved) or 'none'}; or state the positions "
                f"{', '.join(path for path in of_unit if 'accelerometer' not in path)}"
            )
        length, cog = vehicle.derived()[each.name], f"{named.unit}.cog"
        found = stated({each.name: each.given}, each.name, "m", length)
        sigma = quantity_of(cog).guess if found.free else found.sigma
        of_axles = replace(each, kind="sigma", sigma=f"{sigma!r} m") if sigma else each
        shift = length - found.value
        for path in moved[each.name]:
            yield replace(of_axles, name=path, value=f"{known[path] + shift!r} m" if found.has_value else "")
        if all(math.isclose(vehicle.stated.get(path, math.inf), sigma or 0.0) for path in moved[each.name]):
            continue  # it is applied already
        # a weighbridge gives the CoG as a fraction of the wheelbase, so that it is uncertain by the same fraction
        if vehicle.stated.get(cog) != 0 and not any(applies(other, cog) for other in listed):
            (of_file,) = [change.slopes[cog] for change in changes(vehicle) if change.name == cog]
            front = length + vehicle.unit(named.unit).axle_groups[0].position
            of_length = (sigma or 0.0) * (front - known[cog]) / length
            yield Statement(name=cog, kind="sigma", sigma=f"{math.hypot(of_file, of_length)!r} m")


def possible_names(vehicle: Vehicle, settings: OneStage) -> tuple[str, ...]:
    """The numbers that can be stated, those that are estimated first; of sensors, the errors of one on each unit."""
    reported = reported_parameters(vehicle, settings)
    return tuple(dict.fromkeys((*reported, *vehicle.parameters(), *_beyond_vehicle(vehicle, settings))))


def _beyond_vehicle(vehicle: Vehicle, settings: OneStage) -> tuple[str, ...]:
    """Names of the numbers that a vehicle file does not have."""
    groups, linear = vehicle.group_paths(), settings.tyre_law == "linear"
    of_tyres = [f"{path}.softening" for path in groups] if linear else saturation_names(groups)
    quantities = [channel.quantity for channel in channels_with_errors() if channel not in (SPEED, STEER)]
    signals = ["speed", *vehicle.steer_signals(), *[f"{q}.{unit.name}" for q in quantities for unit in vehicle.units]]
    errors = [f"{signal}.{kind}" for signal in signals for kind in error_kinds(signal)]
    variations = [f"{path}.cornering_stiffness.{VARIATION}" for path in groups]
    own = vehicle.parameters()
    optional = [path for path in left_out(vehicle, locked=True) if path not in own]
    single = (DRIVE_AXLE_BRAKING, ROAD_BANK, BANK_VARIATION, DISCREPANCY, TIME_BASE, f"{TIME_BASE}.main.delay")
    return tuple(dict.fromkeys((*of_tyres, *variations, *optional, *single, *errors)))


def _require_use(
    vehicle: Vehicle, settings: OneStage, chosen: CommonSettings, each: Statement, others: Sequence[str]
) -> None:
    """Refuse a statement that fits no number, whose value fits several, or that the chosen method does not use."""
    if each.name in GROUPS:
        return
    own, single = vehicle.parameters(), "*" not in each.name
    if single and _is_sensor_error(each.name):
        _require_sensor(vehicle, each)
    fitting = [name for name in (*own, *others) if applies(each, name)]
    if single and each.name not in fitting and (_is_sensor_error(each.name) or begins_with(each.name, TIME_BASE)):
        fitting.append(each.name)  # of a sensor or a time base that the vehicle does not name
    if not fitting:
        _refuse(vehicle, settings, chosen, each, (*own, *others))
    if each.value != "" and len(fitting) > 1 and single:
        raise VehicleError(
            f"{each}: expected the name of one number for a value, {each.name} fits {', '.join(fitting)}; give the "
            "whole path, or omit the value"
        )
    for name in fitting:
        _require_number(vehicle, settings, each, name)
    if unused := [name for name in fitting if name not in own and not chosen.uses(name)]:
        raise VehicleError(f"{each}: {unused[0]}: needs one stage; remove it, or choose that method")
    of_roll = any(ends_with(name, key) for name in fitting for key in ROLL_PARAMETERS)
    if of_roll and each.kind != "exact" and not settings.roll:
        raise VehicleError(
            f"{each}: expected a number of the yaw motion, because roll=False; remove it, or use roll=True"
        )


def _require_number(vehicle: Vehicle, settings: OneStage, each: Statement, name: str) -> None:
    """Refuse a statement with another unit, or outside of what its number can be."""
    given = {each.name: each.given}
    if prior_of_sensor_error(vehicle, name, replace(settings, given=given)) or name in vehicle.parameters():
        return
    found = stated(given, name, quantity_of(name).unit, _usual_value(vehicle, settings, name))
    if found.has_value and found.value and (name in WITHOUT_MEAN or ParameterPath.of(name).quantity == VARIATION):
        raise refused(found, "has the mean 0; state only its standard deviation, or exact")
    if found.free and name != FRICTION:
        raise refused(found, "is no number of a vehicle file; give its standard deviation, such as '+- 20 %'")
    least, largest = FRICTION_RANGE
    if name == FRICTION and not least <= found.value <= largest:
        raise refused(found, f"expected between {least:g} and {largest:g}, got {found.value:g}; correct it")


def _usual_value(vehicle: Vehicle, settings: OneStage, name: str) -> float:
    """The default of a number that a vehicle file does not have, SI."""
    path = ParameterPath.of(name)
    if path.quantity == "softening":
        return softening_priors(vehicle)[path.owner][0]
    return quantity_of(name).mean or given_parameters(vehicle, replace(settings, given={})).get(name, 0.0)


def _refuse(
    vehicle: Vehicle, settings: OneStage, chosen: CommonSettings, each: Statement, names: Sequence[str]
) -> None:
    """The reason why a statement fits no number, as an error."""
    if settings.tyre_law == "linear":
        if any(applies(each, path) for path in saturation_names(vehicle.group_paths())):
            if chosen.one_stage is None:
                raise VehicleError(f"{each}: needs one stage; remove it, or choose that method")
            noun = "friction" if applies(each, FRICTION) else "such parameter"
            law = setting("tyres", "saturating")
            raise VehicleError(f"{each}: linear tyres have no {noun}; choose saturating tyres ({law}), or remove it")
    elif ends_with(each.name, "softening"):
        law = setting("tyres", "linear")
        raise VehicleError(f"{each}: saturating tyres soften by their law; remove it, or choose {law}")
    altered = [path for change in changes(vehicle) if ends_with(change.name, each.name) for path in change.slopes]
    if altered:
        raise VehicleError(
            f"{each}: expected one number, got the error that {', '.join(altered)} share; state these with their "
            f"standard deviation, such as {altered[0]}='+- {'2 cm' if unit_of(altered[0]) == 'm' else '1 %'}'"
        )
    if valueless := [path for path in vehicle.locations() if ends_with(path, each.name)]:
        number = f"0 {unit_of(valueless[0])}".removesuffix(" 1")
        raise VehicleError(
            f"{each}: {valueless[0]} has no value in the vehicle file; state one, such as '{number} +- ...'"
        )
    is_path = "." in each.name and "*" not in each.name
    words = names if is_path else sorted({ParameterPath.of(name).last_word for name in names})
    sought = each.name if is_path else ParameterPath.of(each.name).last_word
    raise VehicleError(f"{each.name}: no such parameter in {vehicle.name}; {suggestion(sought, words)}")


def _is_sensor_error(name: str) -> bool:
    """Whether a name has the form of a sensor error, of a sensor that may not exist."""
    signal, kind = SensorErrorName.split(name)
    return ("." in signal or signal == SPEED.quantity) and channel_of(signal) is not None and bool(kind)


def _require_sensor(vehicle: Vehicle, each: Statement) -> None:
    """Refuse an error that no sensor of the vehicle can have."""
    signal, kind = SensorErrorName.split(each.name)
    channel, steers = channel_of(signal), vehicle.steer_signals()
    if channel is STEER and signal not in steers:
        raise SignalError(f"{each}: {signal} is no steer angle of {vehicle.name}; {suggestion(signal, steers)}")
    if channel not in channels_with_errors():
        names = ", ".join(c.quantity for c in channels_with_errors() if c is not SPEED)
        raise SignalError(f"{each}: expected a signal that is compared with the model, one of {names}")
    place, units = SignalName.of(signal), [unit.name for unit in vehicle.units]
    if not place.fits(units):
        raise SignalError(f"{each}: {place.unit}: no such unit in {vehicle.name}; {suggestion(place.unit, units)}")
    if kind not in error_kinds(signal):
        raise SignalError(f"{each}: {signal} has no error {kind!r}; {suggestion(kind, error_kinds(signal))}")


def require_signals(settings: CommonSettings | None, *records: Record) -> None:
    """A SignalError if the settings state an error of a sensor that none of the logs has."""
    for message in missing_sensors(settings, *records):
        raise SignalError(f"{message}; map the signal, name another sensor, or remove the statement")


def missing_sensors(settings: CommonSettings | None, *records: Record) -> list[str]:
    """What is stated on sensors that none of the logs has, as sentences."""
    names = {name for record in records for name in record.signals}
    logged = sorted({*names, *all_pairs(names)})
    errors = [error for name in (settings.given if settings else ()) if (error := SensorErrorName.of(name))]
    missing = [
        error for error in errors if channel_of(error.signal) and error.signal not in logged and "*" not in error.signal
    ]
    alike = [", ".join(s for s in logged if channel_of(s) is channel_of(error.signal)) for error in missing]
    return [
        f"{error.signal}.{error.kind}: expected a sensor of the logs, got one that is in none of them; of its kind they"
        f" have {known or 'none'}"
        for error, known in zip(missing, alike, strict=True)
    ]


def common_sensors(records: Sequence[Record]) -> dict[str, SensorPrior]:
    """What the records state of the sensors of a vehicle, by signal; a SignalError if two state different things."""
    found: dict[str, tuple[str, SensorPrior]] = {}
    for record in records:
        for signal in record.signals:
            sensor = record.sensors.get(signal, SensorPrior())
            other, first = found.setdefault(signal, (record.name, sensor))
            if sensor != first:
                raise SignalError(
                    f"{signal}: expected one sensor in all logs, got {first} in {other}, and {sensor} in "
                    f"{record.name}; read the logs with the same signals.toml"
                )
    return {signal: sensor for signal, (_, sensor) in found.items() if sensor != SensorPrior()}


def with_sensors(vehicle: Vehicle, settings: OneStage, sensors: Mapping[str, SensorPrior]) -> OneStage:
    """The settings with what is stated of sensors, and of their classes, as statements; and with their noise.

    A statement of the settings on a single error comes before that of its sensor; one on many errors comes before the
    class.
    """
    more, noise = dict[str, str | float](), dict[str, float]()
    units = {unit.name for unit in vehicle.units}
    for signal, sensor in sensors.items():
        if not SignalName.of(signal).fits(units):  # no model has it; it is refused later
            continue
        for kind in error_kinds(signal):
            name = f"{signal}.{kind}"
            default, usual = prior_of_sensor_error(vehicle, name, settings), sensor.usual_sigma(signal, kind)
            if name in settings.given or default is None:
                continue
            if any(applies(statement(*item), name) for item in settings.given.items()):
                usual = None
            if usual is not None or kind in sensor.errors:
                mean, sigma = sensor.errors.get(kind, (default[0], None))
                sigma = (default[1] if usual is None else usual) if sigma is None else sigma
                more[name] = toml_format.text(mean, SensorErrorName(signal, kind).unit or "1", sigma)
        if deviation := sensor.noise or sensor.usual_sigma(signal, "noise"):
            noise[signal] = deviation**2
    return replace(settings, given={**more, **settings.given}, noise={**noise, **settings.noise})
