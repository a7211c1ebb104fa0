"""The unknowns of an identification: parameters, uncertain numbers and sensor errors."""

import math
from collections.abc import Collection, Container, Iterable, Mapping, Sequence
from dataclasses import replace

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.names import PAYLOAD_HEIGHT, ParameterPath, ends_with
from fifthwheel.data.channels import PLACE_KINDS, ROLL_RATE, SensorErrorName, SignalName, channel_of, names_of
from fifthwheel.estimate.identify.settings import ROLL_PARAMETERS, CommonSettings, OneStage
from fifthwheel.estimate.identify.statement import Stated, prior_of, refused, stated
from fifthwheel.estimate.identify.unknowns.unknown import (
    GUESS_TAIL,
    Unknown,
    limited_unknown,
    linear_unknown,
    logarithmic_unknown,
)
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.tyres import saturation_parameters
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import DRIVE_AXLE_BRAKING, FRICTION, TIME_BASE, quantity_of, unit_of
from fifthwheel.truck.steering import own_parameters
from fifthwheel.truck.uncertainty import changes

VARIATION = "variation"
"""Last word of the name of a cornering stiffness's variation from log to log."""
ROAD_FRICTION = 0.8
"""Of a dry road, in Fiala's law."""
SOFTENING = 3.0
"""That of Fiala's law for an axle group whose load is not determined, 1/rad."""
SOFTENING_PRIOR = 0.75, 0.5
"""Prior mean and standard deviation of a softening over that of Fiala's law: all tyres soften. Magic Formulas of truck
tyres with load transfer lose as much at 0.3 g, and a quarter of it at 0.1 g."""
SMALL_STEP = 1e-3
"""Of a numerical derivative, in standard deviations."""
EXACT = 1e-6
"""Of a sensor error that is exactly another number than in an ideal sensor: its standard deviation over the default
one. The model gets the number as that of an unknown which the logs cannot change."""


def stage_1_names(vehicle: Vehicle) -> tuple[str, ...]:
    """Cornering stiffness of every axle group, and yaw inertia of every unit behind the first."""
    groups = [f"{path}.cornering_stiffness" for path in vehicle.group_paths()]
    return (*groups, *[f"{unit.name}.yaw_inertia" for unit in vehicle.units[1:]])


def stage_2_names(vehicle: Vehicle) -> tuple[str, ...]:
    """Payload height of every unit with a payload."""
    return tuple(f"{unit.name}.{PAYLOAD_HEIGHT}" for unit in vehicle.units if unit.payload is not None)


def given_parameters(vehicle: Vehicle, settings: OneStage) -> dict[str, float]:
    """Every parameter of the vehicle, and of tyres that saturate, before the identification, by path, SI; a
    VehicleError if tyres saturate, and the static axle loads are not determined."""
    values = vehicle.parameters()
    if settings.tyre_law == "linear":
        return values
    of_tyres = saturation_parameters(vehicle, settings.tyre_law) | {FRICTION: quantity_of(FRICTION).mean or 0.0}
    return values | with_stated_values(of_tyres, settings)


def with_stated_values(values: Mapping[str, float], settings: CommonSettings) -> dict[str, float]:
    """Numbers beyond a vehicle file, SI by name, with the values that the settings state of them."""
    return {n: known_of(n, v, settings).value for n, v in values.items()} if settings.given else dict(values)


def reported_parameters(vehicle: Vehicle, settings: OneStage) -> list[str]:
    """Paths of the parameters that one stage estimates, with a verdict, where nobody states that they are exact; a
    VehicleError if the settings name one that does not exist."""
    bodies = [f"{unit.name}.sprung" for unit in vehicle.units[1:]]
    separate = [f"{body}.{quantity}" for body in bodies for quantity in ("cog_height", "roll_inertia")]
    of_roll = stage_2_names(vehicle) if settings.uniform_payload else separate
    names = [*stage_1_names(vehicle), *(of_roll if settings.roll else ()), *own_parameters(vehicle.steering)]
    names += [] if settings.tyre_law == "linear" else [FRICTION]
    return list(dict.fromkeys((*names, *vehicle.paths(settings.reported))))


def estimated_parameters(vehicle: Vehicle, settings: OneStage) -> list[str]:
    """Paths of the parameters that one stage estimates with a verdict: the reported ones that are uncertain, and those
    that are free. Own parameters of the steering are uncertain only with a stated standard deviation."""
    reported, own = reported_parameters(vehicle, settings), own_parameters(vehicle.steering)
    of_file = [name for name in reported if name not in own]
    uncertain = [name for name in of_file if vehicle.stated.get(name) != 0 and name != FRICTION]
    chosen = {*(uncertain or of_file), FRICTION}  # of a simulated vehicle every number is exact
    names = [name for name in reported if name in chosen or (name in own and vehicle.stated.get(name))]
    if not settings.given:
        return names
    values = given_parameters(vehicle, settings)
    known = {name: known_of(name, value, settings, reported=name in reported) for name, value in values.items()}
    free = [name for name, found in known.items() if found.free and name not in names]
    return [*[name for name in names if not known[name].exact], *free]


def known_of(name: str, value: float, settings: CommonSettings, *, reported: bool = False) -> Stated:
    """What the settings state of a parameter, SI."""
    return stated(settings.given, name, unit_of(name), value, reported=reported)


def lacks_roll_rate(name: str, channels: Iterable[str]) -> bool:
    """Whether a parameter is identifiable only from a roll rate that is not among the channels.

    Yaw rates contain some information on it, but the effect is smaller than the error of any linear model.
    """
    unit = ParameterPath.of(name).unit
    measured = any(SignalName.of(channel).unit == unit for channel in names_of(ROLL_RATE, channels))
    return any(ends_with(name, key) for key in ROLL_PARAMETERS) and not measured


def unit_of_unknown(unknown: str) -> str:
    """The unit that a parameter or the sensor of a sensor error belongs to; the coupling for its own parameters."""
    error = SensorErrorName.of(unknown)
    return SignalName.of(error.signal).unit if error else ParameterPath.of(unknown).unit


def one_stage_unknowns(vehicle: Vehicle, outputs: Sequence[str], settings: OneStage) -> list[Unknown]:
    """All unknowns of one stage but the initial states: parameters, uncertain numbers, sensor errors.

    The values of the vehicle are the prior means. A VehicleError: an estimated parameter is not above 0.
    """
    estimated = estimated_parameters(vehicle, settings)
    unknowns = [
        *_parameters(vehicle, estimated, settings),
        *_uncertain_numbers(vehicle, estimated, settings),
    ]
    unknowns += _optional_unknowns(vehicle, [u.name for u in unknowns], settings)
    unknowns += _changes_of_vehicle(vehicle, {*[u.name for u in unknowns], *estimated}, settings)
    ranges = vehicle.parameter_ranges()
    return [
        *(u.within(*ranges[u.name]) if u.name in ranges and not u.moves else u for u in unknowns),
        *sensor_error_unknowns(vehicle, outputs, settings),
        *_model_errors(vehicle, settings),
    ]


def time_base_delays(
    time_bases: Mapping[str, str], main: str, outputs: Sequence[str], settings: OneStage
) -> list[Unknown]:
    """The delay of every time base but the main one, that of the steer angles: one unknown that delays all its
    channels.

    Signals that `time_bases` does not list are on the main one.
    """
    moves: dict[str, dict[str, float]] = {}
    for name in outputs:
        base = time_bases.get(name, "")
        if base != main:
            moves.setdefault(f"{TIME_BASE}.{base or 'main'}.delay", {})[f"{name}.delay"] = 1.0
    return [
        linear_unknown(name, *prior, moves=of_channels)
        for name, of_channels in moves.items()
        if (prior := prior_of(settings.given, name))[1]
    ]


def prior_of_sensor_error(vehicle: Vehicle, name: str, settings: CommonSettings) -> tuple[float, float] | None:
    """Prior mean and standard deviation of a sensor error, SI; None where no such error is estimated.

    What the settings state comes first. What the vehicle file states of the place of a sensor replaces the standard
    deviation of its channel.
    """
    error = SensorErrorName.of(name)
    kind = error.row if error else None
    if error is None or kind is None:
        return None
    mean, sigma = kind.ideal, kind.prior
    if kind.kind in PLACE_KINDS:
        signal = SignalName.of(error.signal)
        sigma = vehicle.stated.get(path_of_place(vehicle, error), sigma)
        mean = getattr(vehicle.unit(signal.unit).place_of_accelerometer(signal.part), kind.kind)
    found = stated(settings.given, name, error.unit or "1", mean)
    if found.free:
        usual = f"+- {kind.prior:.3g} {error.unit}".removesuffix(" 1")
        raise refused(found, f"is estimated already; give its standard deviation, such as {usual!r}")
    if kind.positive and found.value < 0:
        raise refused(found, f"expected 0 or more, got {found.value:g} {error.unit}; correct it")
    chosen = found.or_sigma(sigma)
    return found.value, EXACT * (sigma or 1.0) if not chosen and found.value != mean else chosen


def path_of_place(vehicle: Vehicle, error: SensorErrorName) -> str:
    """The path in the vehicle file of a sensor error that is a coordinate of its place."""
    signal = SignalName.of(error.signal)
    return f"{vehicle.unit(signal.unit).accelerometer_path(signal.part)}.{error.kind}"


def sensor_error_unknowns(vehicle: Vehicle, outputs: Sequence[str], settings: CommonSettings) -> list[Unknown]:
    """The errors of the steer angles and of the measured signals.

    An error that is exact, with a sigma of 0, is no unknown.
    """
    unknowns = []
    for name in ("speed", *vehicle.steer_signals(), *outputs):
        channel = channel_of(name)
        for kind in channel.errors if channel else ():
            prior = prior_of_sensor_error(vehicle, f"{name}.{kind.kind}", settings)
            if prior and prior[1]:
                unknown = linear_unknown(f"{name}.{kind.kind}", *prior, per_log=kind.per_log)
                unknowns.append(replace(unknown, lower=max(unknown.lower, 0.0)) if kind.positive else unknown)
    return unknowns


def _changes_of_vehicle(vehicle: Vehicle, done: Container[str], settings: OneStage) -> list[Unknown]:
    """The changes of the masses and lengths of the vehicle file that have no unknown of their own (`done`)."""
    unknowns, values = list[Unknown](), vehicle.parameters()
    for change in changes(vehicle):
        moves = {path: slope for path, slope in change.slopes.items() if path not in done}
        of_tyres = _changes_of_tyres(vehicle, moves, settings) if moves else {}
        if [*moves, *of_tyres] == [change.name]:
            sigma = abs(moves[change.name])
            unknowns.append(linear_unknown(change.name, values[change.name], sigma))
        elif moves:
            given = {p: values[p] for p in moves if values[p] > 0 and not quantity_of(p).signed}
            size = _size(moves, given)
            rates = {path: slope / size for path, slope in (moves | of_tyres).items()}
            unknown = linear_unknown(change.name, 0.0, size, moves=rates)
            unknowns.append(replace(unknown, given=given))
    return unknowns


def _size(moves: Mapping[str, float], given: Mapping[str, float]) -> float:
    """The standard deviation of a change: the largest of its positions, m, else of its masses, as a fraction. In this
    unit a change means the same whatever its standard deviation is, such as in the knowledge from earlier logs."""
    lengths = [abs(slope) for path, slope in moves.items() if quantity_of(path).is_position]
    masses = [abs(moves[path]) / value for path, value in given.items() if quantity_of(path).unit == "kg"]
    return max(lengths, default=0.0) or max(masses, default=0.0) or 1.0


def _changes_of_tyres(vehicle: Vehicle, moves: Mapping[str, float], settings: OneStage) -> dict[str, float]:
    """Change of the parameters of saturating tyres, such as the axle loads, with masses and lengths."""
    if settings.tyre_law == "linear":
        return {}
    values = vehicle.parameters()
    given, changed = (
        saturation_parameters(vehicle.replace({path: values[path] + step * slope for path, slope in moves.items()}))
        for step in (0.0, SMALL_STEP)
    )
    slopes = {name: (changed[name] - value) / SMALL_STEP for name, value in given.items()}
    return {name: slope for name, slope in slopes.items() if slope}


def _optional_unknowns(vehicle: Vehicle, done: Collection[str], settings: OneStage) -> list[Unknown]:
    """What the file leaves out and a truck may have (`left_out`), and the self-steering of castor axles, that are not
    `done`."""
    sigmas, values, ranges = {}, vehicle.parameters(), vehicle.parameter_ranges()
    for name in left_out(vehicle):
        default = 0.0 if vehicle.is_exact else quantity_of(name).sigma
        sigmas[name] = vehicle.stated.get(name, known_of(name, 0.0, settings).or_sigma(default))
    for change in changes(vehicle):
        sigmas |= {name: slope for name, slope in change.slopes.items() if ends_with(name, "self_steering")}
    return [
        limited_unknown(name, values.get(name, 0.0), sigma, ranges[name][1])
        for name, sigma in sigmas.items()
        if sigma and name not in done
    ]


def left_out(vehicle: Vehicle, *, locked: bool = False) -> list[str]:
    """Paths of numbers that are 0 as far as the vehicle file knows, and may not be: the self-steering of the last axle
    of each unit behind the first, in a group of two or more, and the yaw damping of the joints of buses and caravans.
    `locked`: as if steerable axles were not logged."""
    paths, own = [], vehicle.steering.trace.wheels if vehicle.steering else ()
    for unit in vehicle.units[1:]:
        *others, last = unit.axle_groups[-1].on_road
        steers = (last.steerable and not locked) or f"steer.{unit.name}.{last.name}" in own
        if others and not (steers or last.self_steering or last.command_steering):
            paths.append(f"{unit.name}.{last.name}.self_steering")
    return paths + [f"{c.name}.yaw_damping" for c in vehicle.couplings_with_damper() if not c.yaw_damping]


def _model_errors(vehicle: Vehicle, settings: OneStage) -> list[Unknown]:
    """What the model lacks: softening and variation of tyres, who brakes, rate of the time base."""
    unknowns, values = list[Unknown](), vehicle.parameters()
    for path, (mean, default) in (softening_priors(vehicle) if settings.tyre_law == "linear" else {}).items():
        found = known_of(f"{path}.softening", mean, settings)
        if sigma := found.or_sigma(default):
            unknowns.append(linear_unknown(found.name, found.value, sigma))
    for name in (f"{path}.cornering_stiffness" for path in vehicle.group_paths()):
        variation = f"{name}.{VARIATION}"
        _, sigma = prior_of(settings.given, variation)
        if sigma and not known_of(name, values[name], settings, reported=True).exact:
            moves = {name: values[name]}
            unknowns.append(linear_unknown(variation, 0.0, sigma, moves=moves))
    mean, sigma = prior_of(settings.given, DRIVE_AXLE_BRAKING)
    if sigma and settings.brakes:
        unknowns.append(limited_unknown(DRIVE_AXLE_BRAKING, mean, sigma))
    if rate := prior_of(settings.given, TIME_BASE)[1]:
        moves = {dynamics.TIME_SCALE: 1.0}
        unknowns.append(linear_unknown(TIME_BASE, 0.0, rate, moves=moves))
    return unknowns


def softening_priors(vehicle: Vehicle) -> dict[str, tuple[float, float]]:
    """Prior mean and standard deviation of the softening of each axle group by its path, 1/rad.

    The side force of a tyre under the vertical load Fz on a road with the friction mu has the cornering stiffness
    C / (1 + softening |alpha|) to first order, in Fiala's law (1954) with softening = C / (3 mu Fz). The load is the
    static one.
    """
    groups = {unit.group_path(group): group for unit in vehicle.units for group in unit.axle_groups}
    try:
        loads = vehicle.axle_loads()
    except VehicleError:
        loads = {}
    of_fiala = {
        path: group.cornering_stiffness / (3 * ROAD_FRICTION * loads[path]) if loads.get(path, 0.0) > 0 else SOFTENING
        for path, group in groups.items()
    }
    mean, sigma = SOFTENING_PRIOR
    return {path: (mean * slope, sigma * slope) for path, slope in of_fiala.items()}


def _parameters(vehicle: Vehicle, estimated: Sequence[str], settings: OneStage) -> list[Unknown]:
    """The estimated parameters: with the prior that is stated, else as a guess."""
    values, named = given_parameters(vehicle, settings), vehicle.paths(settings.reported)
    of_steering, unknowns = own_parameters(vehicle.steering), []
    for name in estimated:
        value, row, found = values[name], quantity_of(name), known_of(name, values[name], settings, reported=True)
        of_file = 0.0 if name in vehicle.assumed else vehicle.stated.get(name, 0.0)
        sigma = 0.0 if found.free else found.or_sigma(of_file)
        if name in named and not (sigma or found.free):
            sigma = _default_sigma(vehicle, name, value)
        may_be_zero = name in of_steering and sigma and 2 * sigma > value
        if row.bounds:
            unknowns.append(
                linear_unknown(name, *((value, sigma) if sigma else (row.mean or value, row.sigma)), reported=True)
            )
        elif row.signed or may_be_zero:
            unknowns.append(linear_unknown(name, value, sigma or row.guess_of(value), reported=True))
        elif sigma or name == FRICTION:
            unknowns.append(logarithmic_unknown(name, value, sigma / value if sigma else row.sigma, reported=True))
        else:
            unknowns.append(logarithmic_unknown(name, value, row.guess, reported=True, tail=GUESS_TAIL))
    return unknowns


def _default_sigma(vehicle: Vehicle, name: str, value: float) -> float:
    """Standard deviation, SI, of a parameter on which nothing is stated, as if it were not reported; a VehicleError if
    nothing is known of it."""
    row = quantity_of(name)
    sigma = row.sigma_of(value) if row.is_uncertain else 0.0
    sigma = sigma or math.hypot(*(change.slopes.get(name, 0.0) for change in changes(vehicle)))
    if not sigma:
        raise VehicleError(
            f"{name}: nothing is known of its uncertainty; state it, such as '+- 10 {unit_of(name)}', or 'free'"
        )
    return sigma


def _uncertain_numbers(vehicle: Vehicle, estimated: Sequence[str], settings: OneStage) -> list[Unknown]:
    """Uncertain numbers of the vehicle file and of saturating tyres, beside masses and lengths.

    The roll inertia of the sprung body below a payload whose height is estimated is none: it acts like this height.
    """
    loaded = {ParameterPath.of(name).unit for name in estimated if ends_with(name, PAYLOAD_HEIGHT)}
    own, unknowns = vehicle.parameters(), list[Unknown]()
    for name, value in given_parameters(vehicle, settings).items():
        row, path = quantity_of(name), ParameterPath.of(name)
        hidden = path.unit in loaded and ends_with(name, "sprung.roll_inertia")
        if not row.is_uncertain or name in estimated or hidden or not (value or row.signed):
            continue
        sigma = vehicle.stated.get(name) if name in own else known_of(name, value, settings).sigma
        usual = row.sigma_of(value) if row.signed else row.sigma
        if scale := usual if sigma is None else sigma / (1.0 if row.signed else value):
            make = linear_unknown if row.signed else logarithmic_unknown
            unknowns.append(make(name, value, scale))
    return unknowns
