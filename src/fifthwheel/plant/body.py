"""Masses, springs and places of the plant's bodies, from the vehicle and the plant's own properties. SI, ISO 8855."""

import math
from dataclasses import dataclass

from fifthwheel.errors import VehicleError
from fifthwheel.plant.properties import Properties
from fifthwheel.vehicle import AxleGroup, Unit, Vehicle
from fifthwheel.vehicle.statics import STANDARD_GRAVITY as GRAVITY


@dataclass(frozen=True, kw_only=True)
class Beam:
    """One axle: a beam with a wheel at either end, on its suspension and its tyres."""

    name: str  # "tractor.front"
    group: str  # path of its group
    x: float  # m, on its unit
    mass: float  # kg, beam and both wheels
    wheel_mass: float  # kg, one side
    load: float  # N, static, on the ground
    spring: float  # N/m, vertical, suspension
    damper: float  # N s/m
    roll_spring: float  # N m/rad, suspension with its auxiliary
    roll_damper: float  # N m s/rad
    roll_centre: float  # m above the ground
    tyre_spring: float  # N/m, one side
    tyres: int  # of one side
    cornering_stiffness: float  # N/rad, of the axle at its static load
    driven: bool
    steered: bool


@dataclass(frozen=True, kw_only=True)
class Body:
    """The sprung body of a unit with its payload, and the axles below it."""

    name: str
    mass: float  # kg
    cog: tuple[float, float]  # x on the unit and height above the ground, m
    inertia: tuple[float, float, float, float]  # xx, yy, zz and the product, integral of x z dm, about its CoG, kg m^2
    beams: tuple[Beam, ...]


def bodies(vehicle: Vehicle, properties: Properties) -> tuple[Body, ...]:
    """Of every unit, front to rear.

    Raises:
        VehicleError: the axles leave the sprung body no mass or no inertia, or a property names no axle group.
    """
    groups = [unit.group_path(group) for unit in vehicle.units for group in unit.axle_groups]
    for named in (properties.twin_tyres or (), properties.roll_centre, properties.roll_steer, properties.lash):
        for path in named:
            if path not in groups:
                raise VehicleError(f"{path}: no such axle group in {vehicle.name}; it has {', '.join(groups)}")
    loads = vehicle.axle_loads()
    return tuple(_body(unit, vehicle, properties, loads) for unit in vehicle.units)


def _body(unit: Unit, vehicle: Vehicle, properties: Properties, loads: dict[str, float]) -> Body:
    axle_mass = (unit.mass - unit.laden_sprung_mass) / len(unit.axles)
    first = unit is vehicle.units[0]
    beams = tuple(
        _beam(unit, group, i, axle_mass, loads[unit.group_path(group)], properties, first=first)
        for group in unit.axle_groups
        for i in range(len(group.axles))
    )
    derived = vehicle.derived()
    mass, height = unit.laden_sprung_mass, derived[f"{unit.name}.cog_height"]
    x = (unit.mass * unit.cog - sum(b.mass * b.x for b in beams)) / mass
    above = height - unit.roll_axis_height
    xx = derived[f"{unit.name}.roll_inertia"] - mass * above**2
    yaw_of_beam = _beam_inertia(beams[0], properties)[2]
    zz = unit.yaw_inertia - mass * (x - unit.cog) ** 2
    zz -= sum(b.mass * (b.x - unit.cog) ** 2 + yaw_of_beam for b in beams)
    if zz <= 0:
        raise VehicleError(
            f"{unit.name}.yaw_inertia: expected more than the axles alone have about the CoG,"
            f" {unit.yaw_inertia - zz:.4g} kg m^2, got {unit.yaw_inertia:g}; it is that of the whole unit"
        )
    product = unit.sprung.roll_yaw_product - mass * (x - unit.cog) * above
    if product**2 >= xx * zz:
        raise VehicleError(f"{unit.name}.sprung.roll_yaw_product: {product:g} kg m^2 about the CoG is not possible")
    return Body(name=unit.name, mass=mass, cog=(x, height), inertia=(xx, max(zz, xx), zz, product), beams=beams)


def _beam(
    unit: Unit, group: AxleGroup, i: int, mass: float, load: float, properties: Properties, *, first: bool
) -> Beam:
    path, n, axle = unit.group_path(group), len(group.axles), group.axles[i]
    steered = any(a.steerable for a in group.axles)
    twins = properties.twin_tyres
    twin = first and not steered if twins is None else path in twins
    on_spring = load / n - mass * GRAVITY
    if on_spring <= 0:
        raise VehicleError(f"{path}: carries {load:.0f} N, less than its own axles weigh; check cog and masses")
    natural = 2 * math.pi * properties.bounce_frequency
    spring = on_spring / GRAVITY * natural**2
    centre = unit.roll_axis_height * (1 + group.roll_stiffness / group.tyre_roll_stiffness)
    return Beam(
        name=f"{unit.name}.{axle.name}",
        group=path,
        x=axle.position,
        mass=mass,
        wheel_mass=mass * properties.wheel_mass,
        load=load / n,
        spring=spring,
        damper=2 * properties.bounce_damping * spring / natural,
        roll_spring=group.roll_stiffness / n,
        roll_damper=group.roll_damping / n,
        roll_centre=properties.roll_centre.get(path, centre),
        tyre_spring=group.tyre_roll_stiffness / n / (2 * properties.half_track**2),
        tyres=2 if twin else 1,
        cornering_stiffness=group.cornering_stiffness / n,
        driven=first and not steered,
        steered=axle.steerable,
    )


def _beam_inertia(beam: Beam, properties: Properties) -> tuple[float, float, float]:
    """xx, yy, zz of the axle with its wheels about its middle, kg m^2."""
    rod = (beam.mass - 2 * beam.wheel_mass) * (2 * properties.half_track) ** 2 / 12
    wheel = beam.wheel_mass * properties.wheel_gyration**2
    ends = 2 * beam.wheel_mass * properties.half_track**2 + wheel  # a disc has half of it about its diameter
    return rod + ends, 2 * wheel, rod + ends
