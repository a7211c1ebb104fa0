"""Masses and CoG positions of any chain of units from its measured static axle loads.

n loads determine n numbers, and a chain of k units has 2 k masses and CoG positions. The solution is the one with the
smallest changes, each divided by its standard deviation: the load of a unit is little known, its empty body well.
"""

from collections.abc import Mapping

import numpy as np

from fifthwheel._types import Array
from fifthwheel.errors import VehicleError
from fifthwheel.vehicle.uncertainty import DEFAULT_SIGMAS
from fifthwheel.vehicle.unit import Unit
from fifthwheel.vehicle.vehicle import Vehicle

LOAD_SIGMA = 0.5
"""Standard deviation of the mass of a load before it is weighed, as a fraction of the mass in the file."""
STEP = 0.01
"""For the slopes, kg and m; the loads are linear in masses and moments."""


def nearest_masses(vehicle: Vehicle, loads: Mapping[str, float]) -> Vehicle:
    """The vehicle with masses and CoG positions that have these axle loads and are nearest to those of the file.

    Args:
        vehicle: any chain of units whose axle loads are determined.
        loads: load of every axle group by its path, N.

    Raises:
        VehicleError: a unit would have less mass than without its load.
    """
    before = vehicle.axle_loads()
    sigma = np.array([s for unit in vehicle.units for s in _sigmas(unit)])
    columns = []
    for unit in vehicle.units:
        for mass, moment in ((STEP, STEP * unit.cog), (0.0, STEP * unit.mass)):  # by mass at the CoG, and by CoG
            after = _changed(vehicle, unit, mass, moment).axle_loads()
            columns.append([(after[path] - load) / STEP for path, load in before.items()])
    slopes = np.array(columns).T
    difference = np.array([loads[path] - load for path, load in before.items()])
    weighted = slopes * sigma**2
    change: Array = weighted.T @ np.linalg.solve(weighted @ slopes.T, difference)
    for unit, (mass, shift) in zip(vehicle.units, change.reshape(-1, 2), strict=True):
        vehicle = _changed(vehicle, unit, mass, mass * unit.cog + shift * unit.mass)
    return vehicle


def _sigmas(unit: Unit) -> tuple[float, float]:
    """Standard deviations of mass, kg, and CoG, m, of a unit before it is weighed."""
    if unit.payload:
        return LOAD_SIGMA * unit.payload.mass, DEFAULT_SIGMAS["cog.laden"].sigma
    return DEFAULT_SIGMAS["mass"].sigma * unit.mass, DEFAULT_SIGMAS["cog.unladen"].sigma


def _changed(vehicle: Vehicle, unit: Unit, mass: float, moment: float) -> Vehicle:
    """The vehicle with more mass of a unit, kg, that has a moment about its origin, kg m."""
    component, part = ("payload", unit.payload.mass) if unit.payload else ("sprung", unit.sprung.mass)
    if part + mass <= 0:
        raise VehicleError(
            f"{unit.name}: expected more than {unit.mass - part:.0f} kg, its mass without {component}, got"
            f" {unit.mass + mass:.0f} kg from the loads; check the loads, and the masses of the file"
        )
    total = unit.mass + mass
    cog = (unit.mass * unit.cog + moment) / total
    values = {f"{unit.name}.mass": total, f"{unit.name}.cog": cog, f"{unit.name}.{component}.mass": part + mass}
    return vehicle.replace(values)
