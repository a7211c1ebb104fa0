"""Masses and CoG positions of a vehicle from static axle loads: of a log, or of the slips of a weighbridge.

A slip file has the static loads of the axle groups of a tractor-semitrailer, as masses, in up to three conditions: the
laden combination, the tractor alone (solo), and the empty combination; docs/howto/weigh.md has an example.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any, Self

from fifthwheel.errors import FifthwheelError, VehicleError, suggestion
from fifthwheel.input_files import parse_toml, read_toml
from fifthwheel.units import STANDARD_GRAVITY, quantity
from fifthwheel.vehicle.uncertainty import DEFAULT_SIGMAS
from fifthwheel.vehicle.unit import Unit
from fifthwheel.vehicle.vehicle import Vehicle

LOAD_SIGMA = 0.5
"""Standard deviation of the mass of a load before it is weighed, as a fraction of the mass in the file."""
STEP = 0.01
"""For the slopes, kg and m; the loads are linear in masses and moments."""


def with_axle_loads(
    vehicle: Vehicle,
    loads: Mapping[str, float],
    *,
    unladen_tractor: Mapping[str, float] | None = None,
    tolerance: float = 0.02,
) -> Vehicle:
    """The same vehicle with the masses and CoG positions that follow from its axle loads.

    Cheng and Cebon (2011), section 2.2. The coupling load is the load of the tractor's axles less the tractor's weight;
    with the trailer's axle load it gives the trailer's mass and CoG. The change of mass goes to the payload, or to the
    sprung body of a unit without payload. Yaw and roll inertias do not change, because loads contain no information on
    them. The road is level and the vehicle is stationary.

    The n loads of another vehicle of k units do not determine its 2 k masses and CoG positions. Those of the file then
    change as little as possible, each change divided by its standard deviation. All axle groups have to be weighed.

    Args:
        vehicle: a tractor with two axle groups and a trailer with one, or any other vehicle.
        loads: load of each group by its path, N, as in `Vehicle.axle_loads`. The load of a front axle on steel springs
            may be missing; the coupling load then follows from the drive axles and the tractor's CoG in the file.
        unladen_tractor: loads of the tractor's two groups without the trailer, N. If given, they set the tractor's mass
            and CoG; otherwise the file's values stay.
        tolerance: largest difference of the measured and the predicted front load, as a fraction of the load of all
            tractor axles.

    Raises:
        VehicleError: a load is missing, unknown or not positive, or the loads contradict the file.
    """
    paths = tuple(vehicle.axle_loads())
    if [len(unit.axle_groups) for unit in vehicle.units] != [2, 1]:
        if unladen_tractor is not None:
            raise VehicleError(
                f"unladen_tractor: expected none for {vehicle.name}, which is no tractor with two axle groups and a"
                " trailer with one; write the tractor's mass and CoG into the vehicle file"
            )
        _check_loads(loads, paths)
        return _nearest_masses(vehicle, loads)
    tractor, trailer = vehicle.units
    front, drive, bogie = paths
    _check_loads(loads, (front, drive, bogie), optional=front)
    if unladen_tractor is not None:
        _check_loads(unladen_tractor, (front, drive))
        a, b = (group.position for group in tractor.axle_groups)
        total = unladen_tractor[front] + unladen_tractor[drive]
        moment = unladen_tractor[front] * a + unladen_tractor[drive] * b
        vehicle = _weighed(vehicle, tractor, total / STANDARD_GRAVITY, moment / total)
        tractor = vehicle.units[0]

    coupling_load = _coupling_load(vehicle, loads, front, drive)
    total = coupling_load + loads[bogie]
    moment = coupling_load * vehicle.couplings[0].trailing_position + loads[bogie] * trailer.axle_groups[0].position
    weighed = _weighed(vehicle, trailer, total / STANDARD_GRAVITY, moment / total)
    if front not in loads:
        return weighed
    difference = loads[front] - weighed.axle_loads()[front]
    if abs(difference) > tolerance * (loads[front] + loads[drive]):
        if abs(difference + loads[drive] - loads[front]) <= tolerance * (loads[front] + loads[drive]):
            raise VehicleError(
                f"{front}, {drive}: {EXCHANGED}: expected {loads[front] - difference:.0f} N on {front} from the"
                f" tractor's CoG and the coupling's position, got {loads[front]:.0f} N, and {loads[drive]:.0f} N on"
                f" {drive}; exchange them"
            )
        raise VehicleError(
            f"{front}: expected {loads[front] - difference:.0f} N from the tractor's CoG and the coupling's position,"
            f" got {loads[front]:.0f} N; check {tractor.name}.cog and {vehicle.couplings[0].name}.leading_position,"
            " or allow a larger tolerance"
        )
    return weighed


EXCHANGED = "front and drive axle loads seem exchanged"


def _coupling_load(vehicle: Vehicle, loads: Mapping[str, float], front: str, drive: str) -> float:
    """Vertical load of the trailer on the coupling, N: the measured load less the tractor's contribution to it."""
    tractor = vehicle.units[0]
    weight = tractor.mass * STANDARD_GRAVITY
    if front in loads:
        weighed, measured, tractor_load, lever = f"{front}, {drive}", loads[front] + loads[drive], weight, 1.0
    else:
        a, b = (group.position for group in tractor.axle_groups)
        weighed, measured, tractor_load = drive, loads[drive], weight * (tractor.cog - a) / (b - a)
        lever = (vehicle.couplings[0].leading_position - a) / (b - a)
    if measured <= tractor_load:
        raise VehicleError(
            f"{weighed}: expected more than the tractor's own {tractor_load:.0f} N, got {measured:.0f} N; check "
            f"{tractor.name}.mass, or give unladen_tractor"
        )
    return (measured - tractor_load) / lever


def _weighed(vehicle: Vehicle, unit: Unit, mass: float, cog: float) -> Vehicle:
    """The vehicle with another mass, kg, and CoG, m, of a unit; its payload or sprung body has the change of mass."""
    component, before = ("payload", unit.payload.mass) if unit.payload else ("sprung", unit.sprung.mass)
    after = before + mass - unit.mass
    if after <= 0:
        raise VehicleError(
            f"{unit.name}: expected more than {unit.mass - before:.0f} kg, its mass without {component}, got"
            f" {mass:.0f} kg from the loads; "
            + ("remove the payload from its description" if unit.payload else "correct its masses in the vehicle file")
        )
    return vehicle.replace({f"{unit.name}.mass": mass, f"{unit.name}.cog": cog, f"{unit.name}.{component}.mass": after})


def _nearest_masses(vehicle: Vehicle, loads: Mapping[str, float]) -> Vehicle:
    """The vehicle with masses and CoG positions that have these axle loads and are nearest to those of the file."""
    import numpy as np  # only this needs it

    def changed(vehicle: Vehicle, unit: Unit, mass: float, moment: float) -> Vehicle:
        """With more mass of a unit, kg, that has a moment about its origin, kg m."""
        return _weighed(vehicle, unit, unit.mass + mass, (unit.mass * unit.cog + moment) / (unit.mass + mass))

    before = vehicle.axle_loads()
    sigma = np.array([s for unit in vehicle.units for s in _sigmas(unit)])
    columns = []
    for unit in vehicle.units:
        for mass, moment in ((STEP, STEP * unit.cog), (0.0, STEP * unit.mass)):  # by mass at the CoG, and by CoG
            after = changed(vehicle, unit, mass, moment).axle_loads()
            columns.append([(after[path] - load) / STEP for path, load in before.items()])
    slopes = np.array(columns).T
    difference = np.array([loads[path] - load for path, load in before.items()])
    weighted = slopes * sigma**2
    change = weighted.T @ np.linalg.solve(weighted @ slopes.T, difference)
    for unit, (mass, shift) in zip(vehicle.units, change.reshape(-1, 2), strict=True):
        vehicle = changed(vehicle, unit, mass, mass * unit.cog + shift * unit.mass)
    return vehicle


def _sigmas(unit: Unit) -> tuple[float, float]:
    """Standard deviations of mass, kg, and CoG, m, of a unit before it is weighed."""
    if unit.payload:
        return LOAD_SIGMA * unit.payload.mass, DEFAULT_SIGMAS["cog.laden"].sigma
    return DEFAULT_SIGMAS["mass"].sigma * unit.mass, DEFAULT_SIGMAS["cog.unladen"].sigma


def _check_loads(loads: Mapping[str, float], paths: tuple[str, ...], optional: str | None = None) -> None:
    """Raise where a load is unknown, missing or not positive; the load of the path `optional` may be missing."""
    for path in loads:
        if path not in paths:
            raise VehicleError(f"{path}: no such axle load; {suggestion(path, paths)}")
    for path in paths:
        if path == optional and path not in loads:
            continue
        if not 0 < loads.get(path, 0.0) < float("inf"):
            raise VehicleError(f"{path}: expected a load > 0 N, got {loads.get(path)}; weigh every group")


Number = tuple[float, float | None]
"""Value and standard deviation, SI; None where nothing is stated on it."""
CONDITIONS = ("laden", "solo", "empty")
ACCURACY = 0.01
"""Standard deviation of a load, as a fraction: axle by axle, with the slope of the ground and the friction of the
suspension; a weighbridge that carries the whole vehicle at once has 0.1 %."""
LOADS = (500.0, 40e3)
"""Least and largest load of an axle group, kg: the drive axle of a light tractor has 1.4 t, heavy tridems 36 t."""
CONTRADICTION = 4.0
"""Largest difference of a measured and a predicted load, in standard deviations."""
MAX_SOLO = 0.55
"""Largest fraction of the tractor's mass on its drive axles without a trailer: published tractors have up to 0.48."""
MIN_SOLO = 0.2
"""Least such fraction: published tractors have 0.28 and more."""
MIN_DIFFERENCE = 0.1
"""Of front and drive loads that may have been exchanged, as a fraction of their sum; others fit both ways."""
COUPLING_RANGE = (0.6, 1.2)
"""Positions of a fifth wheel, by the wheelbase to the middle of the drive axles: published tractors have 0.84 and 1."""


@dataclass(frozen=True, kw_only=True)
class Slip:
    """Static loads of the axle groups, kg, by their paths."""

    laden: Mapping[str, float] = field(default_factory=dict)
    solo: Mapping[str, float] = field(default_factory=dict)
    empty: Mapping[str, float] = field(default_factory=dict)
    accuracy: float = ACCURACY
    """Standard deviation of each load, as a fraction."""

    def __post_init__(self) -> None:
        if not 0 <= self.accuracy < 0.5:
            raise VehicleError(f"accuracy: expected a fraction from 0 to 0.5, got {self.accuracy:g}; such as 1 %")
        for condition in CONDITIONS:
            for path, load in getattr(self, condition).items():
                if not LOADS[0] <= load <= LOADS[1]:
                    raise VehicleError(
                        f"{condition}.{path}: expected a load of {LOADS[0]:g} to {LOADS[1]:g} kg, got {load:g} kg;"
                        " correct it"
                    )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a slip file.

        Raises:
            VehicleError: the file is not readable or not TOML, or has another key or a load that is no mass.
        """
        try:
            table = parse_toml(read_toml(Path(path)))
            accuracy = fraction(table.pop("accuracy", ACCURACY))
            for key in table:
                if key not in CONDITIONS:
                    raise VehicleError(f"{key}: no such key; {suggestion(key, ('accuracy', *CONDITIONS))}")
            return cls(accuracy=accuracy, **{key: dict(_loads(value, key)) for key, value in table.items()})
        except FifthwheelError as error:
            raise VehicleError(f"{path}: {error}") from None


def fraction(value: object) -> float:
    """A fraction such as 0.01 or "1 %"."""
    text = str(value).strip()
    try:
        return float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        raise VehicleError(f"accuracy: expected a fraction such as '1 %', got {value!r}; correct it") from None


def _loads(value: Any, path: str) -> Iterator[tuple[str, float]]:
    """Loads in nested tables by their paths, without the name of the condition."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _loads(inner, f"{path}.{key}")
        return
    try:
        yield path.partition(".")[2], quantity(value, "kg")
    except FifthwheelError as error:
        raise VehicleError(f"{path}: {error}; give the load as a mass") from None


@dataclass(frozen=True, kw_only=True)
class Lengths:
    """What the loads act on, m, each positive to the rear."""

    wheelbase: float
    """From the tractor's first axle to the middle of its other axles."""
    coupling: float | None
    """From the tractor's first axle to the kingpin; None if it is not known, then the slips determine it."""
    coupling_sigma: float | None = None
    """By default 1 % of the wheelbase, as in a vehicle file that states nothing."""
    trailer: float
    """From the kingpin to the middle of the trailer's axles."""
    trailer_sigma: float | None = None
    """By default that of axle positions in a vehicle file that states nothing."""


def weigh(lengths: Lengths, slip: Slip, groups: tuple[str, str, str], tares: Mapping[str, Number]) -> dict[str, Number]:
    """Masses and CoG positions, from moments of the loads; Cheng and Cebon (2011), section 2.2.

    The groups are the paths of the tractor's two axle groups and of the trailer. The tares are "tractor.mass", kg, and
    "tractor.cog", m behind the first axle, where there is no solo slip, and "trailer.mass" without load, kg, where
    there is no empty slip. Without a solo slip, the laden loads inform the tractor's CoG too if the kingpin is known.
    The result has "tractor.mass", "tractor.cog", "trailer.mass", "trailer.cog", "payload.mass" and "coupling", with
    standard deviations; distances are behind the first axle and the kingpin. What does not follow is absent.

    Raises:
        VehicleError: a load is missing or unknown, or the loads contradict each other.
    """
    _check_slip(slip, groups)
    _check_order(lengths, slip, groups, tares)
    inputs = _inputs(slip, groups)
    if lengths.coupling is not None:
        usual = DEFAULT_SIGMAS["coupling"].sigma * lengths.wheelbase
        inputs["coupling"] = (lengths.coupling, usual if lengths.coupling_sigma is None else lengths.coupling_sigma)
    usual = DEFAULT_SIGMAS["axle_positions"].sigma
    inputs["trailer"] = (lengths.trailer, usual if lengths.trailer_sigma is None else lengths.trailer_sigma)
    if not slip.solo:
        inputs |= {key: tares[key] for key in ("tractor.mass", "tractor.cog")}
    if not slip.empty and "trailer.mass" in tares:
        inputs["unladen"] = tares["trailer.mass"]
    if lengths.coupling is None and not slip.solo:
        raise VehicleError(
            "solo: expected the loads of the tractor alone, because the position of the fifth wheel is not known; give"
            " them (--solo), or the distance from the front axle to the kingpin (--fifth-wheel)"
        )
    results = propagate(lambda values: _solve(values, lengths), inputs)
    if results["hitch"][0] <= 0:
        raise VehicleError(
            f"laden: expected more on {groups[0]} and {groups[1]} than the tractor's {results['tractor.mass'][0]:.0f}"
            " kg; check the slip, or the tractor's mass"
        )
    difference, sigma = results.pop("front")
    if abs(difference) > CONTRADICTION * (sigma or 0.0) + 1e-6 * results["hitch"][0]:
        where = _kingpin({key: value for key, (value, _) in inputs.items()}, lengths)["kingpin"]
        raise VehicleError(
            f"laden: expected a kingpin {lengths.coupling:.2f} m behind the front axle, got {where:.2f} m by the loads"
            f" ({groups[0]} differs by {difference:+.0f} kg with a sigma of {sigma:.0f} kg); measure the position of"
            " the fifth wheel, or weigh again on level ground with released brakes"
        )
    if not slip.solo:
        results["tractor.cog"] = _mean(results["tractor.cog"], results["cog by moments"])
    return {key: number for key, number in results.items() if key not in ("hitch", "cog by moments")}


def weigh_solo(lengths: Lengths, slip: Slip, groups: tuple[str, str, str]) -> dict[str, Number]:
    """The results "tractor.mass" and "tractor.cog" of `weigh`, from the loads of the tractor alone.

    Raises:
        VehicleError: a load is missing or unknown, or front and drive loads seem exchanged.
    """
    _check_slip(slip, groups, "solo")
    _check_order(lengths, slip, groups, {})
    return propagate(lambda values: _tractor(values, lengths), _inputs(slip, groups))


def _inputs(slip: Slip, groups: tuple[str, str, str]) -> dict[str, Number]:
    """Every load of a slip with its standard deviation, kg, by condition and number of the group."""
    return {
        f"{condition}.{groups.index(path)}": (load, slip.accuracy * load)
        for condition in CONDITIONS
        for path, load in getattr(slip, condition).items()
    }


def _mean(one: Number, other: Number) -> Number:
    """The mean of two independent numbers, weighted by their information; an exact one is kept."""
    if not one[1] or not other[1]:
        return other if one[1] else one
    weight = one[1] ** 2 / (one[1] ** 2 + other[1] ** 2)
    return one[0] + weight * (other[0] - one[0]), math.hypot(weight * other[1], (1 - weight) * one[1])


def _check_order(lengths: Lengths, slip: Slip, groups: tuple[str, str, str], tares: Mapping[str, Number]) -> None:
    """Refuse a slip that contradicts the statics of the tractor, and does not with exchanged front and drive loads."""
    front, drive, _ = groups
    stated = _statics(lengths, slip, groups, tares)
    wrong = [condition for condition, (_, fits) in stated.items() if not fits]
    different = {
        condition
        for condition, loads in ((condition, getattr(slip, condition)) for condition in stated)
        if abs(loads[front] - loads[drive]) > MIN_DIFFERENCE * (loads[front] + loads[drive])
    }
    for count in range(1, len(stated) + 1) if wrong else ():
        for conditions in combinations(stated, count):
            if not different & {*conditions}:
                continue
            other = _statics(lengths, _exchanged(slip, conditions, groups), groups, tares)
            if all(fits for _, fits in other.values()):
                loads = getattr(slip, conditions[0])
                one = f"write {loads[drive]:g} kg for {front} and {loads[front]:g} kg for {drive}"
                cure = one if count == 1 else "exchange them in each"
                as_stated, exchanged = (found[wrong[0]][0] for found in (stated, other))
                raise VehicleError(
                    f"{' and '.join(conditions)}: {EXCHANGED}; {cure}. As stated, {as_stated}; exchanged, {exchanged}"
                )


def _exchanged(slip: Slip, conditions: Iterable[str], groups: tuple[str, str, str]) -> Slip:
    """The slip with exchanged loads of the tractor's groups in some conditions."""
    front, drive, _ = groups
    for condition in conditions:
        given = getattr(slip, condition)
        loads: dict[str, Any] = {condition: {**given, front: given[drive], drive: given[front]}}
        slip = replace(slip, **loads)
    return slip


def _statics(
    lengths: Lengths, slip: Slip, groups: tuple[str, str, str], tares: Mapping[str, Number]
) -> dict[str, tuple[str, bool]]:
    """What the loads of each condition say of the tractor, and whether it is possible."""
    front, drive, _ = groups
    found: dict[str, tuple[str, bool]] = {}
    inputs = {key: tares[key] for key in ("tractor.mass", "tractor.cog") if key in tares}
    if slip.solo:
        fraction = slip.solo[drive] / (slip.solo[front] + slip.solo[drive])
        text = f"{fraction:.0%} of the tractor's mass are on {drive} (expected: at most {MAX_SOLO:.0%})"
        found["solo"] = text, fraction <= MAX_SOLO
        inputs = {
            f"solo.{k}": (slip.solo[path], slip.accuracy * slip.solo[path]) for k, path in enumerate((front, drive))
        }
    if not inputs:
        return found
    for condition in ("laden", "empty"):
        if loads := getattr(slip, condition):
            of_slip = {f"laden.{k}": (loads[path], slip.accuracy * loads[path]) for k, path in enumerate(groups)}
            where, sigma = propagate(lambda values: _kingpin(values, lengths), {**inputs, **of_slip})["kingpin"]
            low, high = (ratio * lengths.wheelbase for ratio in COUPLING_RANGE)
            expected = f"{low:.2f} to {high:.2f} m"
            if lengths.coupling is not None:
                margin = CONTRADICTION * (sigma or 0.0) + 1e-6
                low, high = lengths.coupling - margin, lengths.coupling + margin
                expected = f"{lengths.coupling:.2f} m"
            text = f"the kingpin is {where:.2f} m behind the front axle (expected: {expected})"
            found[condition] = text, low <= where <= high
    return found


def _kingpin(values: Mapping[str, float], lengths: Lengths) -> dict[str, float]:
    """Position of the kingpin behind the front axle by the loads, m; infinite if it carries nothing."""
    return {"kingpin": _solve(values, replace(lengths, coupling=None))["coupling"]}


def propagate(
    function: Callable[[Mapping[str, float]], dict[str, float]], inputs: Mapping[str, Number]
) -> dict[str, Number]:
    """Results of a function, with standard deviations to first order from those of its independent inputs."""
    values = {key: value for key, (value, _) in inputs.items()}
    centre = function(values)
    variance = dict.fromkeys(centre, 0.0)
    for key, (value, sigma) in inputs.items():
        if sigma:
            high, low = (function({**values, key: value + step}) for step in (sigma / 2, -sigma / 2))
            for name in centre:
                variance[name] += (high[name] - low[name]) ** 2
    return {name: (centre[name], math.sqrt(variance[name])) for name in centre}


def _solve(x: Mapping[str, float], lengths: Lengths) -> dict[str, float]:
    """Masses, CoG positions, kingpin load and error of the front load, kg and m, from the loads. Where the kingpin is
    known, the laden loads have a CoG of the tractor that needs no solo loads, "cog by moments"."""
    result = _tractor(x, lengths) if "solo.0" in x else {key: x[key] for key in ("tractor.mass", "tractor.cog")}
    tractor, cog = result["tractor.mass"], result["tractor.cog"]
    hitch = x["laden.0"] + x["laden.1"] - tractor
    moment = lengths.wheelbase * x["laden.1"] - cog * tractor
    result |= {"hitch": hitch, "front": 0.0}
    if lengths.coupling is None:
        result["coupling"] = moment / hitch if hitch > 0 else math.inf
    else:
        kingpin = x.get("coupling", lengths.coupling)
        result["front"] = (kingpin * hitch - moment) / lengths.wheelbase
        result["cog by moments"] = (lengths.wheelbase * x["laden.1"] - kingpin * hitch) / tractor
    trailer = hitch + x["laden.2"]
    result |= {"trailer.mass": trailer, "trailer.cog": x.get("trailer", lengths.trailer) * x["laden.2"] / trailer}
    if "empty.0" in x:
        result["payload.mass"] = trailer - (x["empty.0"] + x["empty.1"] - tractor + x["empty.2"])
    elif "unladen" in x:
        result["payload.mass"] = trailer - x["unladen"]
    return result


def _tractor(x: Mapping[str, float], lengths: Lengths) -> dict[str, float]:
    """Mass, kg, and CoG, m, of the tractor from its solo loads."""
    mass = x["solo.0"] + x["solo.1"]
    return {"tractor.mass": mass, "tractor.cog": lengths.wheelbase * x["solo.1"] / mass}


def _check_slip(slip: Slip, groups: tuple[str, ...], required: str = "laden") -> None:
    for condition, expected in (("laden", groups), ("solo", groups[:2]), ("empty", groups)):
        loads = getattr(slip, condition)
        for path in loads:
            if path not in expected:
                raise VehicleError(f"{condition}.{path}: no such axle load; {suggestion(path, expected)}")
        missing = [path for path in expected if path not in loads]
        if missing and (loads or condition == required):
            raise VehicleError(f"{condition}.{missing[0]}: expected a load, got none; weigh every axle group")
