"""Masses and CoG positions of a tractor-semitrailer from its static axle loads, as weighed on board."""

from collections.abc import Mapping

from fifthwheel.errors import VehicleError
from fifthwheel.vehicle.part import suggestion
from fifthwheel.vehicle.statics import STANDARD_GRAVITY
from fifthwheel.vehicle.unit import Unit
from fifthwheel.vehicle.vehicle import Vehicle


def with_axle_loads(
    vehicle: Vehicle,
    loads: Mapping[str, float],
    *,
    unladen_tractor: Mapping[str, float] | None = None,
    tolerance: float = 0.02,
) -> Vehicle:
    """The same vehicle with the masses and CoG positions that its axle loads tell (Cheng and Cebon 2011, section 2.2).

    loads: of each group by its path, N, as in vehicle.axle_loads(): two groups on the tractor, one on the trailer.
    A front axle on steel springs may be left out; what the coupling adds to the drive axles is believed then.
    unladen_tractor: the loads of the tractor's two groups without the trailer, N; without them the tractor's mass and
    CoG are believed.
    tolerance: how far the measured split front to drive may be from the predicted one, as part of the tractor's total.

    The coupling load is the tractor's axle loads less its weight; with the trailer's axle load it gives the mass and
    CoG of the trailer. The change of mass is the payload's, or the sprung body's on a unit without payload.
    Yaw and roll inertias are left alone: loads do not tell them. Road level, vehicle at rest.
    """
    expected = vehicle.axle_loads()
    if [len(unit.axle_groups) for unit in vehicle.units] != [2, 1]:
        raise VehicleError(
            f"{vehicle.name}: expected a tractor with two axle groups and a trailer with one; weigh others apart"
        )
    tractor, trailer = vehicle.units
    front, drive, bogie = expected
    _check_loads(loads, (front, drive, bogie), optional=front)
    if unladen_tractor is not None:
        _check_loads(unladen_tractor, (front, drive))
        a, b = (group.position for group in tractor.axle_groups)
        total = unladen_tractor[front] + unladen_tractor[drive]
        moment = unladen_tractor[front] * a + unladen_tractor[drive] * b
        vehicle = vehicle.replace(_weighed(tractor, total, moment))
        tractor = vehicle.units[0]

    coupling_load = _coupling_load(vehicle, loads, front, drive)
    total = coupling_load + loads[bogie]
    moment = coupling_load * vehicle.couplings[0].trailing_position + loads[bogie] * trailer.axle_groups[0].position
    weighed = vehicle.replace(_weighed(trailer, total, moment))

    if front not in loads:
        return weighed
    off = loads[front] - weighed.axle_loads()[front]
    if abs(off) > tolerance * (loads[front] + loads[drive]):
        raise VehicleError(
            f"{front}: expected {loads[front] - off:.0f} N from the tractor's CoG and the coupling's position, got"
            f" {loads[front]:.0f} N; check {tractor.name}.cog and {vehicle.couplings[0].name}.leading_position,"
            " or allow a larger tolerance"
        )
    return weighed


def _coupling_load(vehicle: Vehicle, loads: Mapping[str, float], front: str, drive: str) -> float:
    """What the trailer puts on the coupling, N: all that the tractor's axles bear beyond the tractor."""
    tractor = vehicle.units[0]
    weight = tractor.mass * STANDARD_GRAVITY
    if front in loads:
        named, measured, own, lever = f"{front}, {drive}", loads[front] + loads[drive], weight, 1.0
    else:
        a, b = (group.position for group in tractor.axle_groups)
        named, measured, own = drive, loads[drive], weight * (tractor.cog - a) / (b - a)
        lever = (vehicle.couplings[0].leading_position - a) / (b - a)
    if measured <= own:
        raise VehicleError(
            f"{named}: expected more than the tractor's own {own:.0f} N, got {measured:.0f} N; check "
            f"{tractor.name}.mass, or give unladen_tractor"
        )
    return (measured - own) / lever


def _weighed(unit: Unit, load: float, moment: float) -> dict[str, float]:
    """New mass, CoG and payload of a unit from its total load, N, and the moment of its loads about its origin, N m."""
    mass = load / STANDARD_GRAVITY
    part, before = ("payload", unit.payload.mass) if unit.payload else ("sprung", unit.sprung.mass)
    after = before + mass - unit.mass
    if after <= 0:
        raise VehicleError(
            f"{unit.name}: expected more than {unit.mass - before:.0f} kg, its mass without {part}, got {mass:.0f} kg"
            f" from the loads; describe the unit {'without payload' if unit.payload else 'anew'}"
        )
    return {f"{unit.name}.mass": mass, f"{unit.name}.cog": moment / load, f"{unit.name}.{part}.mass": after}


def _check_loads(loads: Mapping[str, float], paths: tuple[str, ...], optional: str | None = None) -> None:
    for path in loads:
        if path not in paths:
            raise VehicleError(f"{path}: no such axle load; {suggestion(path, paths)}")
    for path in paths:
        if path == optional and path not in loads:
            continue
        if not 0 < loads.get(path, 0.0) < float("inf"):
            raise VehicleError(f"{path}: expected a load > 0 N, got {loads.get(path)}; weigh every group")
