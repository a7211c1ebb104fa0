"""The unknowns of an identification: parameters, uncertain numbers and sensor errors."""

import math
from collections.abc import Collection, Container, Iterable, Mapping, Sequence
from dataclasses import replace

from fifthwheel import dynamics
from fifthwheel.channels import (
    GYROS,
    PLACE_KINDS,
    ROLL_RATE,
    SensorErrorName,
    SignalName,
    channel_of,
    is_of,
    names_of,
)
from fifthwheel.dynamics.tyres import saturation_names, saturation_parameters
from fifthwheel.errors import VehicleError, suggestion
from fifthwheel.identify.settings import DEFAULT_CONSIDERED, ROLL_PARAMETERS, CommonSettings, OneStage
from fifthwheel.identify.unknowns.unknown import (
    Unknown,
    UnknownKind,
    change_unknown,
    error_unknown,
    fraction_unknown,
    height_unknown,
    linear_unknown,
    logarithmic_unknown,
)
from fifthwheel.names import ParameterPath, ends_with
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.parameters import (
    DRIVE_AXLE_BRAKING,
    FRICTION,
    MEAN_DRIVE_AXLE_BRAKING,
    POSITIONS,
    is_signed,
    unit_of,
)
from fifthwheel.vehicle.steering import own_parameters
from fifthwheel.vehicle.uncertainty import MASS_SCALE, changes

VARIATION = ".variation"
"""End of the name of a cornering stiffness's variation from log to log."""
TIME_BASE = "time_base"
"""First word of the name of a time base's delay."""
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
    return tuple(f"{unit.name}.payload.height" for unit in vehicle.units if unit.payload is not None)


def given_parameters(vehicle: Vehicle, settings: OneStage) -> dict[str, float]:
    """Every parameter of the vehicle, and of tyres that saturate, before the identification, by path, SI.

    Raises:
        VehicleError: tyres saturate, and the static axle loads are not determined.
    """
    values = vehicle.parameters()
    if settings.tyre_law != "linear":
        values |= saturation_parameters(vehicle, settings.tyre_law) | {FRICTION: settings.friction}
    return values | {name: value for name, value in settings.surroundings.items() if name in values}


def estimated_parameters(vehicle: Vehicle, settings: OneStage) -> list[str]:
    """Paths of the parameters that one stage estimates; not those that the vehicle file states to be exact, and own
    parameters of the steering only with a stated standard deviation.

    Raises:
        VehicleError: a name in the settings is neither a parameter nor the end of one.
    """
    if settings.free is not None:
        names = expand_names(vehicle, settings.free, settings)
    else:
        bodies = [f"{unit.name}.sprung" for unit in vehicle.units[1:]]
        separate = [f"{body}.{quantity}" for body in bodies for quantity in ("cog_height", "roll_inertia")]
        of_roll = stage_2_names(vehicle) if settings.uniform_payload else separate
        names = [*stage_1_names(vehicle), *(of_roll if settings.roll else ())]
        uncertain = [name for name in names if vehicle.stated.get(name) != 0]
        names = uncertain or names  # of a simulated vehicle every number is exact
        names += [name for name in own_parameters(vehicle.steering) if vehicle.stated.get(name)]
    if settings.tyre_law != "linear":
        names = list(dict.fromkeys([*names, FRICTION]))
    fixed = expand_names(vehicle, settings.fixed, settings)
    return [name for name in names if name not in fixed]


def lacks_roll_rate(name: str, channels: Iterable[str]) -> bool:
    """Whether a parameter is identifiable only from a roll rate that is not among the channels.

    Yaw rates contain some information on it, but the effect is smaller than the error of any linear model.
    """
    unit = ParameterPath.of(name).unit
    measured = any(SignalName.of(channel).unit == unit for channel in names_of(ROLL_RATE, channels))
    return any(ends_with(name, key) for key in ROLL_PARAMETERS) and not measured


def unit_of_unknown(unknown: str) -> str:
    """The unit that a parameter or the sensor of a sensor error belongs to; the coupling for its own parameters; "" for
    the mass scale of all units."""
    if unknown == MASS_SCALE:
        return ""
    error = SensorErrorName.of(unknown)
    return SignalName.of(error.signal).unit if error else ParameterPath.of(unknown).unit


def longest_matching_key(path: str, table: Mapping[str, float]) -> str | None:
    """The longest key of a table that is a path or the end of it; None if there is none."""
    return max((key for key in table if ends_with(path, key)), key=len, default=None)


def expand_names(vehicle: Vehicle, names: Iterable[str], settings: OneStage) -> list[str]:
    """Paths of the parameters that are named by their path or by the end of it, each once.

    With linear tyres, names of the parameters of saturating ones are left out.

    Raises:
        VehicleError: a name is neither.
    """
    known, of_tyres = given_parameters(vehicle, settings), saturation_names(vehicle.group_paths())
    paths: list[str] = []
    for name in names:
        matching = [path for path in known if ends_with(path, name)]
        if not matching and not any(ends_with(path, name) for path in of_tyres):
            raise VehicleError(f"{name}: no such parameter in {vehicle.name}; {suggestion(name, known)}")
        paths += matching
    return list(dict.fromkeys(paths))


def one_stage_unknowns(vehicle: Vehicle, outputs: Sequence[str], settings: OneStage) -> list[Unknown]:
    """All unknowns of one stage but the initial states: parameters, uncertain numbers, sensor errors.

    The values of the vehicle are the prior means. A VehicleError: a name in the settings is unknown, a prior in the
    settings has no use, or an estimated parameter is not above 0.
    """
    estimated = estimated_parameters(vehicle, settings)
    _require_use(vehicle, estimated, settings)
    unknowns = [
        *_estimated_unknowns(vehicle, estimated, settings),
        *_vehicle_file_unknowns(vehicle, estimated, settings),
    ]
    unknowns += _self_steering_unknowns(vehicle, [u.name for u in unknowns], settings)
    unknowns += _changes_of_vehicle(vehicle, {*[u.name for u in unknowns], *estimated}, settings)
    ranges = vehicle.parameter_ranges()
    return [
        *(u.within(*ranges[u.name]) if u.name in ranges and not u.moves else u for u in unknowns),
        *sensor_error_unknowns(vehicle, outputs, settings),
        *_model_errors(vehicle, outputs, settings),
    ]


def _require_use(vehicle: Vehicle, estimated: Sequence[str], settings: OneStage) -> None:
    """Refuse a prior of the settings that would change nothing."""
    known, fixed = given_parameters(vehicle, settings), expand_names(vehicle, settings.fixed, settings)
    for name in {*settings.priors, *settings.consider} - {*DEFAULT_CONSIDERED}:
        paths = expand_names(vehicle, [name], settings)
        if name in settings.consider and paths and all(path in estimated for path in paths):
            raise VehicleError(f"{name}: is estimated; give its prior in priors, or remove it from consider")
        if name in settings.priors and name in fixed:
            raise VehicleError(f"{name}: is fixed; remove it from priors or from fixed")
    for name in settings.stated_priors:
        if SensorErrorName.of(name) or name in (*estimated, *fixed) or ParameterPath.of(name).is_payload_height:
            continue
        if name in known:
            raise VehicleError(f"{name}: is not estimated; give its prior in priors, as a fraction, or add it to free")
        raise VehicleError(f"{name}: no such parameter in {vehicle.name}; {suggestion(name, known)}")


def time_base_delays(
    time_bases: Mapping[str, str], main: str, outputs: Sequence[str], settings: OneStage
) -> list[Unknown]:
    """The delay of every time base but the main one, that of the steer angles: one unknown that delays all its
    channels.

    Signals that `time_bases` does not list are on the main one.
    """
    if not settings.nuisances:
        return []
    moves: dict[str, dict[str, float]] = {}
    for name in outputs:
        base = time_bases.get(name, "")
        if base != main:
            moves.setdefault(f"{TIME_BASE}.{base or 'main'}", {})[f"{name}.delay"] = 1.0
    return [
        replace(error_unknown(f"{base}.delay", settings.time_base_delay_prior), moves=channels)
        for base, channels in moves.items()
    ]


def prior_of_sensor_error(vehicle: Vehicle, name: str, settings: CommonSettings) -> tuple[float, float] | None:
    """Prior mean and standard deviation of a sensor error, SI; None where the settings estimate no such error.

    What the settings state of the single error comes first. What the vehicle file states of the place of a sensor
    replaces the standard deviation of the settings.
    """
    default, stated = default_prior(vehicle, name, settings), getattr(settings, "stated_priors", {}).get(name)
    if stated is None or default is None:
        return default
    mean, sigma = stated
    return mean, EXACT * (default[1] or 1.0) if not sigma and mean != default[0] else sigma


def default_prior(vehicle: Vehicle, name: str, settings: CommonSettings) -> tuple[float, float] | None:
    """`prior_of_sensor_error` without what the settings state of the single error."""
    error = SensorErrorName.of(name)
    channel = channel_of(error.signal) if error else None
    kind = channel.error(error.kind) if error and channel else None
    sigma = getattr(settings, f"{kind.setting}_prior", kind.prior) if kind else None
    if error and error.kind == "delay" and is_of(error.signal, *GYROS) and isinstance(settings, OneStage):
        sigma = settings.consider.get("gyro_delay", 0.0)
    if error is None or sigma is None:
        return None
    if error.kind in PLACE_KINDS:
        signal = SignalName.of(error.signal)
        unit = vehicle.unit(signal.unit)
        stated = vehicle.stated.get(f"{unit.accelerometer_path(signal.part)}.{error.kind}", sigma)
        return getattr(unit.place_of_accelerometer(signal.part), error.kind), stated
    return float(error.kind == "gain"), sigma


def sensor_error_unknowns(vehicle: Vehicle, outputs: Sequence[str], settings: CommonSettings) -> list[Unknown]:
    """The errors of the steer angles and of the measured signals; none if the settings say so.

    An error that is exact, with a sigma of 0, is no unknown.
    """
    unknowns = []
    for name in ("speed", *vehicle.steer_signals(), *outputs) if settings.nuisances else ():
        channel = channel_of(name)
        for kind in channel.errors if channel else ():
            prior = prior_of_sensor_error(vehicle, f"{name}.{kind.kind}", settings)
            if prior and prior[1]:
                mean, sigma = prior
                unknown = error_unknown(f"{name}.{kind.kind}", sigma, centre=mean, per_log=kind.per_log)
                unknowns.append(replace(unknown, lower=max(unknown.lower, 0.0)) if kind.positive else unknown)
    return unknowns


def _changes_of_vehicle(vehicle: Vehicle, done: Container[str], settings: OneStage) -> list[Unknown]:
    """The changes of the masses and lengths of the vehicle file that have no unknown of their own (`done`)."""
    factor, exact = settings.consider.get("vehicle_file", 0.0), expand_names(vehicle, settings.fixed, settings)
    unknowns, values = list[Unknown](), vehicle.parameters()
    for change in changes(vehicle) if factor else ():
        moves = {path: factor * s for path, s in change.slopes.items() if path not in done and path not in exact}
        of_tyres = _changes_of_tyres(vehicle, moves, settings) if moves else {}
        if [*moves, *of_tyres] == [change.name]:
            sigma = abs(moves[change.name])
            unknowns.append(linear_unknown(change.name, values[change.name], sigma, UnknownKind.UNCERTAIN))
        elif moves:
            unknown = change_unknown(change.name, 1.0, moves | of_tyres)
            given = {p: values[p] for p in moves if values[p] > 0 and ParameterPath.of(p).quantity not in POSITIONS}
            unknowns.append(replace(unknown, given=given))
    return unknowns


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


def _self_steering_unknowns(vehicle: Vehicle, done: Collection[str], settings: OneStage) -> list[Unknown]:
    """The self-steering of axles that are not `done`: of castor axles, and of fixed ones that may be castor axles."""
    factor, fixed = settings.consider.get("vehicle_file", 0.0), settings.consider.get("fixed_axles", 0.0)
    unstated = 0.0 if vehicle.is_exact else fixed
    sigmas = {name: vehicle.stated.get(name, unstated) for name in _fixed_last_axles(vehicle)}
    for change in changes(vehicle) if factor else ():
        sigmas |= {name: factor * s for name, s in change.slopes.items() if ends_with(name, "self_steering")}
    exact, values = {*done, *expand_names(vehicle, settings.fixed, settings)}, vehicle.parameters()
    unknowns = [change_unknown(name, sigma) for name, sigma in sigmas.items() if sigma and name not in exact]
    return [replace(u, centre=values.get(u.name, 0.0), upper=1.0).within(0.0, 1.0) for u in unknowns]


def _fixed_last_axles(vehicle: Vehicle) -> list[str]:
    """Paths of the self-steering of axles that are fixed, as far as the vehicle file knows: the last axle of each unit
    behind the first, in a group of two or more."""
    paths, own = [], vehicle.steering.trace.wheels if vehicle.steering else ()
    for unit in vehicle.units[1:]:
        axles = unit.axle_groups[-1].on_road
        if f"steer.{unit.name}.{axles[-1].name}" in own:
            continue
        if len(axles) > 1 and not (axles[-1].steerable or axles[-1].self_steering or axles[-1].command_steering):
            paths.append(f"{unit.name}.{axles[-1].name}.self_steering")
    return paths


def _model_errors(vehicle: Vehicle, outputs: Sequence[str], settings: OneStage) -> list[Unknown]:
    """What the model lacks: softening and variation of tyres, rate of the time base, latency of the gyros."""
    unknowns = []
    factor = settings.consider.get("softening", 0.0) if settings.tyre_law == "linear" else 0.0
    for path, (mean, sigma) in (softening_priors(vehicle) if factor else {}).items():
        change = change_unknown(f"{path}.softening", sigma * factor)
        mean = settings.surroundings.get(change.name, mean)
        unknowns.append(replace(change, centre=mean, lower=mean + change.lower, upper=mean + change.upper))
    variation = settings.consider.get("stiffness_variation", 0.0)
    exact = expand_names(vehicle, settings.fixed, settings)
    names = [f"{path}.cornering_stiffness" for path in vehicle.group_paths()] if variation else []
    for name in (name for name in names if name not in exact):
        moves = {name: vehicle.parameters()[name]}
        unknowns.append(change_unknown(f"{name}{VARIATION}", variation, moves, per_log=True))
    if (sigma := settings.consider.get("drive_axle_braking", 0.0)) and settings.brakes:
        unknowns.append(fraction_unknown(DRIVE_AXLE_BRAKING, MEAN_DRIVE_AXLE_BRAKING, sigma))
    if rate := settings.consider.get(TIME_BASE, 0.0):
        unknowns.append(change_unknown(TIME_BASE, rate, {dynamics.TIME_SCALE: 1.0}))
    delays = [f"{name}.delay" for name in outputs if is_of(name, *GYROS)] if settings.nuisances else []
    for name in delays:
        mean, sigma = prior_of_sensor_error(vehicle, name, settings) or (0.0, 0.0)
        latency = error_unknown(name, sigma, centre=mean) if sigma else None
        unknowns += [replace(latency, kind=UnknownKind.UNCERTAIN)] if latency else []
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


def _estimated_unknowns(vehicle: Vehicle, estimated: Sequence[str], settings: OneStage) -> list[Unknown]:
    """The estimated parameters: with the prior of the settings, else with that of the vehicle file, else as a guess."""
    values = given_parameters(vehicle, settings)
    unknowns = []
    for name in estimated:
        value, prior = values[name], _stated_prior(vehicle, name, values[name], settings)
        if ParameterPath.of(name).is_payload_height:
            unknown = height_unknown(name, value, settings)
            centre, scale = prior or (unknown.centre, unknown.scale)
            unknowns.append(replace(unknown, centre=centre, scale=scale))
        elif is_signed(name) or name in settings.stated_priors or _may_be_zero(vehicle, name, prior):
            unknowns.append(linear_unknown(name, *(prior or _default_prior(vehicle, name, value))))
        elif prior or name == FRICTION:
            unknowns.append(logarithmic_unknown(name, value, prior[1] / value if prior else settings.friction_prior))
        else:
            unknowns.append(logarithmic_unknown(name, value, guess_prior(name, settings), tail=settings.guess_tail))
    return unknowns


def _stated_prior(vehicle: Vehicle, name: str, value: float, settings: OneStage) -> tuple[float, float] | None:
    """Prior mean and standard deviation of a parameter, SI, by the settings or the vehicle file; None if they state
    nothing."""
    if name in settings.stated_priors:
        return settings.stated_priors[name]
    if key := longest_matching_key(name, settings.priors):
        sigma = settings.priors[key] * abs(value)
    else:
        sigma = 0.0 if name in vehicle.assumed else vehicle.stated.get(name, 0.0)
    return (value, sigma) if sigma else None


def _may_be_zero(vehicle: Vehicle, name: str, prior: tuple[float, float] | None) -> bool:
    """Whether an own parameter of a steering is 0 within two of its standard deviations."""
    return prior is not None and name in own_parameters(vehicle.steering) and 2 * prior[1] > prior[0]


def _default_prior(vehicle: Vehicle, name: str, value: float) -> tuple[float, float]:
    """The same of a signed parameter by the uncertainty of every vehicle file.

    Raises:
        VehicleError: nothing is known of this parameter.
    """
    sigma = math.hypot(*(change.slopes.get(name, 0.0) for change in changes(vehicle)))
    if not sigma:
        raise VehicleError(
            f"{name}: may be 0 or negative, so its value gives no standard deviation; state it in the vehicle file, "
            f"such as {name.rpartition('.')[2]} = '{value:g} {unit_of(name)} +- SIGMA', or in stated_priors"
        )
    return value, sigma


def guess_prior(name: str, settings: OneStage) -> float:
    """Prior standard deviation of an estimated parameter on which nothing is stated, as a fraction of its value."""
    return settings.roll_inertia_prior if ends_with(name, "sprung.roll_inertia") else settings.prior


def _vehicle_file_unknowns(vehicle: Vehicle, estimated: Sequence[str], settings: OneStage) -> list[Unknown]:
    """Uncertain numbers of the vehicle file and of saturating tyres: those of `priors`, then those of `consider`.

    A key that is the end of a path does not apply to values of 0, nor to the roll inertia of the sprung body below a
    payload whose height is estimated: it acts like this height. What the vehicle file states replaces a default.
    """
    loaded = {path.unit for path in map(ParameterPath.of, estimated) if path.is_payload_height}
    done = {*estimated, *expand_names(vehicle, settings.fixed, settings)}
    unknowns = []
    for table, has_defaults in ((settings.priors, False), (settings.consider, True)):
        for name, value in given_parameters(vehicle, settings).items():
            key, path = longest_matching_key(name, table), ParameterPath.of(name)
            excluded = value <= 0 or (path.unit in loaded and ends_with(name, "sprung.roll_inertia"))
            if key is None or name in done or (excluded and key != name):
                continue
            if has_defaults and value == 0:  # a fraction of it is 0
                continue
            done.add(name)
            sigma = table[key]
            if has_defaults and name in vehicle.stated and sigma == DEFAULT_CONSIDERED.get(key):
                sigma = vehicle.stated[name] / value
            if sigma and is_signed(name) and value:
                unknowns.append(linear_unknown(name, value, sigma * abs(value), UnknownKind.UNCERTAIN))
            elif sigma:
                unknowns.append(logarithmic_unknown(name, value, sigma, UnknownKind.UNCERTAIN))
    return unknowns
