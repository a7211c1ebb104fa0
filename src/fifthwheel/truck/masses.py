"""How the masses of a unit follow from each other, and which are unusual."""

from collections.abc import Iterator, Mapping

from fifthwheel.base.errors import VehicleError
from fifthwheel.truck.classes import CLASSES
from fifthwheel.truck.classes.table import TRAILER_AXLE
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
        if not usual / MAX_FACTOR <= axles <= usual * MAX_FACTOR:
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
