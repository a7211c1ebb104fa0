"""Masses and CoG positions: which are unusual, how they follow from each other, and from static axle loads."""

from collections.abc import Iterator, Mapping

from fifthwheel.base.errors import VehicleError, suggestion
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.truck.classes import CLASSES, TRAILER_AXLE
from fifthwheel.truck.quantities import quantity_of
from fifthwheel.truck.uncertainty import cog_sigma
from fifthwheel.truck.unit import Unit
from fifthwheel.truck.vehicle import Vehicle

MAX_SOLO = 0.55
"""Largest fraction of the tractor's mass on its drive axles without a trailer: published tractors have up to 0.48."""
MIN_SOLO = 0.2
"""Least such fraction: published tractors have 0.28 and more."""
COUPLING_RANGE = (0.6, 1.2)
"""Positions of a fifth wheel, by the wheelbase to the middle of the drive axles: published tractors have 0.84 and 1."""
EXCHANGED = "front and drive axle loads seem exchanged"
MAX_DEVIATION = 3.0
"""Largest usual difference of an unladen mass and that of its class, in standard deviations of the class."""
MAX_FACTOR = 3.0
"""Largest usual factor between the mass of axles and wheels and that of published vehicles, or its inverse."""
LIGHT = 7.5e3
"""Largest mass of a car with its trailer, whose axles are not those of trucks, kg."""
LOAD_SIGMA = 0.5
"""Standard deviation of the mass of a load before it is weighed, as a fraction of the mass in the file."""
STEP = 0.01
"""For the slopes, kg and m; the loads are linear in masses and moments."""


def with_consistent_masses(vehicle: Vehicle, values: Mapping[str, float]) -> Vehicle:
    """The vehicle with other numbers, SI, by path, and with the masses and assumed numbers that follow from them.

    Axles and wheels keep their mass. The payload takes a change of the mass of its unit; the sprung body takes it where
    there is no payload, or its mass is among the numbers. Nothing follows in a unit whose sprung mass is among them. A
    VehicleError if a number is not valid, or nothing remains for the payload or the sprung body.
    """
    before, changed = vehicle.parameters(), dict(values)
    given = {path for path, value in values.items() if value != before.get(path)}
    for unit in vehicle.units:
        total, body, payload = (f"{unit.name}.{key}" for key in ("mass", "sprung.mass", "payload.mass"))
        if body in values or not {total, payload} & given:
            continue
        mass, axles = values.get(total, unit.mass), unit.mass - unit.laden_sprung_mass
        if unit.payload is None or payload in values:
            path, parts, rest = body, "payload and axles" if unit.payload else "axles", axles + values.get(payload, 0.0)
        else:
            path, parts, rest = payload, "sprung body and axles", axles + unit.sprung.mass
        if mass <= rest:
            raise VehicleError(
                f"{total}: expected more than {rest:.0f} kg, the mass of {parts}, got {mass:.0f} kg; correct {total} or"
                f" {payload if unit.payload else body}"
            )
        if path not in vehicle.assumed:
            changed[path] = mass - rest
    return vehicle.restated(changed) if given else vehicle


def unusual_masses(vehicle: Vehicle) -> Iterator[str]:
    """A tractor whose axle loads seem exchanged, units whose mass without load is not that of their class, and those
    whose axles and wheels have an unusual mass.

    All may be right, so these are warnings.
    """
    if exchanged := exchanged_loads(vehicle):
        yield exchanged
    is_heavy = sum(unit.mass for unit in vehicle.units) > LIGHT
    for unit in vehicle.units:
        load = unit.payload.mass if unit.payload else 0.0
        empty, keys = ("empty ", "sprung.mass and payload.mass") if load else ("", "sprung.mass")
        if unit.vehicle_class:
            (tare, sigma, _), mass = CLASSES[unit.vehicle_class].tare, unit.mass - load
            if abs(mass - tare) > MAX_DEVIATION * sigma:
                yield (
                    f"{unit.name}: the {empty}{unit.name} weighs {mass / 1e3:.1f} t by the masses of the vehicle file,"
                    f" and {tare / 1e3:.1f} ± {sigma / 1e3:.1f} t as others of the class {unit.vehicle_class} do; check"
                    f" {'the mass of the load and ' if load else ''}the axle loads by the weighbridge"
                )
        axles, usual = unit.mass - unit.laden_sprung_mass, _usual_axles(unit)
        if is_heavy and not usual / MAX_FACTOR <= axles <= usual * MAX_FACTOR:
            yield (
                f"{unit.name}: axles and wheels weigh {axles / 1e3:.1f} t, the mass of the unit less {keys}; usual are"
                f" {usual / 1e3:.1f} t; check these masses"
            )


def exchanged_loads(vehicle: Vehicle) -> str:
    """Why the CoG of a tractor seems to come from exchanged axle loads; "" if it does not.

    Without its trailer, a tractor has most of its mass on the front axle. If a vehicle file says the contrary, and the
    exchanged loads would be usual, the loads were exchanged.
    """
    tractor = vehicle.units[0]
    if len(tractor.axle_groups) != 2 or not vehicle.couplings or tractor.payload is not None:
        return ""
    front, drive = tractor.axle_groups
    a, b, wheel = front.position, drive.position, vehicle.couplings[0]
    low, high = COUPLING_RANGE
    fraction = (a - tractor.cog) / (a - b)
    is_tractor = wheel.kind == "fifth_wheel" and low <= (a - wheel.leading_position) / (a - b) <= high
    if not is_tractor or not MAX_SOLO < fraction < 1 - MIN_SOLO:
        return ""
    paths = [tractor.group_path(group) for group in tractor.axle_groups]
    loads = [
        f"{part * tractor.mass:.0f} kg on {path}" for path, part in zip(paths, (1 - fraction, fraction), strict=True)
    ]
    return (
        f"{tractor.name}.cog: {EXCHANGED}: {tractor.cog:.2f} m means {' and '.join(loads)} without a trailer, and"
        f" tractors have at most {MAX_SOLO:.0%} of their mass on {paths[1]}; exchanged, the CoG is at"
        f" {a + b - tractor.cog:.2f} m; correct it"
    )


def _usual_axles(unit: Unit) -> float:
    """Mass of axles and wheels by the class of a unit or, without a class, by their number, kg."""
    if unit.vehicle_class:
        counts = [len(group.axles) for group in unit.axle_groups]
        return CLASSES[unit.vehicle_class].unsprung_mass(counts)[0]
    return len(unit.axles) * TRAILER_AXLE.unsprung_mass.value


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
        return LOAD_SIGMA * unit.payload.mass, cog_sigma(laden=True)
    return quantity_of("mass").sigma * unit.mass, cog_sigma(laden=False)


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
