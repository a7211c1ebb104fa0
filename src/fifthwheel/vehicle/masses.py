"""Unusual masses of the units of a vehicle."""

from collections.abc import Iterator

from fifthwheel.vehicle.classes import CLASSES
from fifthwheel.vehicle.classes.table import TRAILER_AXLE
from fifthwheel.vehicle.unit import Unit
from fifthwheel.vehicle.vehicle import Vehicle

MAX_DEVIATION = 3.0
"""Largest usual difference of an unladen mass and that of its class, in standard deviations of the class."""
MAX_FACTOR = 3.0
"""Largest usual factor between the mass of axles and wheels and that of published vehicles, or its inverse."""


def unusual_masses(vehicle: Vehicle) -> Iterator[str]:
    """Units whose mass without load is not that of their class, and those whose axles and wheels have an unusual mass.

    Both may be right, so these are warnings.
    """
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


def _usual_axles(unit: Unit) -> float:
    """Mass of axles and wheels by the class of a unit or, without a class, by their number, kg."""
    if unit.vehicle_class:
        counts = [len(group.axles) for group in unit.axle_groups]
        return CLASSES[unit.vehicle_class].unsprung_mass(counts)[0]
    return len(unit.axles) * TRAILER_AXLE.unsprung_mass.value
