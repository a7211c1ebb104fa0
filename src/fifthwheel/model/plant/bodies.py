"""Masses, inertias, springs and positions of the sprung bodies and the axles. SI, ISO 8855."""

import math
from dataclasses import dataclass

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.plant.properties import Properties
from fifthwheel.truck import AxleGroup, Unit, Vehicle


@dataclass(frozen=True, kw_only=True)
class BeamAxle:
    """One axle: a beam with a wheel at each end, below its suspension and on its tyres."""

    name: str  # unit.axle: "tractor.front"
    group: str  # path of its axle group
    x: float  # m, on its unit
    mass: float  # kg, beam and both wheels
    wheel_mass: float  # kg, one side
    load: float  # N, static vertical load on the ground
    vertical_stiffness: float  # N/m, suspension
    vertical_damping: float  # N s/m, suspension
    roll_stiffness: float  # N m/rad, suspension with its auxiliary roll stiffness
    roll_damping: float  # N m s/rad, suspension
    roll_centre_height: float  # m above the ground
    tyre_stiffness: float  # N/m, vertical, one side
    tyres_per_side: int
    cornering_stiffness: float  # N/rad, of the axle at its static load
    pneumatic_trail: float | None  # m, at its static load; None: that of the tyre, times `Properties.aligning`
    driven: bool
    steered: bool
    self_steering: float
    command_steering: float


@dataclass(frozen=True, kw_only=True)
class SprungBody:
    """The sprung mass of a unit with its payload, and the axles below it."""

    name: str
    mass: float  # kg
    cog: tuple[float, float]  # x on the unit and height above the ground, m
    inertia: tuple[float, float, float, float]  # xx, yy, zz and the product, integral of x z dm, about its CoG, kg m^2
    axles: tuple[BeamAxle, ...]  # on the road
    raised: tuple[tuple[float, float, float], ...]  # x on the unit, m, mass, kg, and yaw inertia, kg m^2, of an axle


def sprung_bodies(vehicle: Vehicle, properties: Properties) -> tuple[SprungBody, ...]:
    """The sprung body of every unit, front to rear.

    A VehicleError if a property names an unknown axle group, if the masses or inertias of the axles exceed those of
    their unit, or if the first unit has no steered axle.
    """
    groups = vehicle.group_paths()
    by_group = properties.roll_centre, properties.roll_steer, properties.lash, properties.brakes
    for paths in (properties.twin_tyres or (), *by_group):
        for path in paths:
            if path not in groups:
                raise VehicleError(
                    f"{path}: {vehicle.name} has no such axle group; it has {', '.join(groups)}; correct the name"
                )
    if not any(axle.steerable for axle in vehicle.units[0].axles):
        raise VehicleError(f"{vehicle.name}: no axle of {vehicle.units[0].name} is steerable; set steerable = true")
    loads = vehicle.axle_loads()
    return tuple(_body(unit, vehicle, properties, loads) for unit in vehicle.units)


def _body(unit: Unit, vehicle: Vehicle, properties: Properties, loads: dict[str, float]) -> SprungBody:
    axle_mass = (unit.mass - unit.laden_sprung_mass) / len(unit.axles)
    is_first, tyres = unit is vehicle.units[0], vehicle.tyres()
    axles = tuple(
        _axle(unit, group, i, axle_mass, loads[path], tyres[path], properties, is_first=is_first)
        for path, group in ((unit.group_path(group), group) for group in unit.axle_groups)
        for i in range(len(group.on_road))
    )
    derived = vehicle.derived()
    mass, height = unit.laden_sprung_mass, derived[f"{unit.name}.cog_height"]
    x = (unit.mass * unit.cog - sum(axle_mass * a.position for a in unit.axles)) / mass
    height_above_roll_axis = height - unit.roll_axis_height
    xx = derived[f"{unit.name}.roll_inertia"] - mass * height_above_roll_axis**2
    axle_yaw_inertia = _axle_yaw_inertia(axles[0], properties)
    zz = unit.yaw_inertia - mass * (x - unit.cog) ** 2
    zz -= sum(axle_mass * (a.position - unit.cog) ** 2 + axle_yaw_inertia for a in unit.axles)
    if zz <= 0:
        raise VehicleError(
            f"{unit.name}.yaw_inertia: expected more than {unit.yaw_inertia - zz:.4g} kg m^2, that of the axles alone"
            f" about the CoG, got {unit.yaw_inertia:g}; give the yaw inertia of the whole unit with its payload"
        )
    product = unit.sprung.roll_yaw_product - mass * (x - unit.cog) * height_above_roll_axis
    if product**2 >= xx * zz:
        limit = math.sqrt(max(xx * zz, 0.0))
        raise VehicleError(
            f"{unit.name}.sprung.roll_yaw_product: expected a magnitude below {limit:.4g} kg m^2 about the CoG of the"
            f" sprung body, got {product:.4g}; correct it, or leave it out for 0"
        )
    return SprungBody(
        name=unit.name,
        mass=mass,
        cog=(x, height),
        inertia=(xx, pitch_inertia(max(zz, xx), xx, zz, product), zz, product),
        axles=axles,
        raised=tuple((a.position, axle_mass, axle_yaw_inertia) for a in unit.axles if a.lifted),
    )


def pitch_inertia(yy: float, xx: float, zz: float, product: float) -> float:
    """A pitch inertia, or if it is larger the least that a rigid body with these other moments can have, kg m^2: the
    difference of the principal moments in its plane of symmetry."""
    return max(yy, math.hypot(xx - zz, 2 * product) * (1 + 1e-9))


def _axle(
    unit: Unit,
    group: AxleGroup,
    i: int,
    mass: float,
    load: float,
    tyres: int,
    properties: Properties,
    *,
    is_first: bool,
) -> BeamAxle:
    path, n, axle = unit.group_path(group), len(group.on_road), group.on_road[i]
    steered = any(a.steerable for a in group.axles)
    has_twin_tyres = tyres > 2 * n if properties.twin_tyres is None else path in properties.twin_tyres
    sprung_load = load / n - mass * GRAVITY
    if sprung_load <= 0:
        raise VehicleError(
            f"{path}: expected a static load above {n * mass * GRAVITY:.0f} N, the weight of its axles, got {load:.0f};"
            f" correct mass, cog and sprung.mass of {unit.name}"
        )
    natural_frequency = 2 * math.pi * properties.bounce_frequency
    vertical_stiffness = sprung_load / GRAVITY * natural_frequency**2
    roll_centre_height = unit.roll_axis_height * (1 + group.roll_stiffness / group.tyre_roll_stiffness)
    return BeamAxle(
        name=f"{unit.name}.{axle.name}",
        group=path,
        x=axle.position,
        mass=mass,
        wheel_mass=mass * properties.wheel_mass,
        load=load / n,
        vertical_stiffness=vertical_stiffness,
        vertical_damping=2 * properties.bounce_damping * vertical_stiffness / natural_frequency,
        roll_stiffness=group.roll_stiffness / n,
        roll_damping=group.roll_damping / n,
        roll_centre_height=properties.roll_centre.get(path, roll_centre_height),
        tyre_stiffness=group.tyre_roll_stiffness / n / (2 * properties.half_track**2),
        tyres_per_side=2 if has_twin_tyres else 1,
        cornering_stiffness=group.cornering_stiffness / n,
        pneumatic_trail=group.pneumatic_trail,
        driven=is_first and not steered,
        steered=axle.steerable,
        self_steering=axle.self_steering or 0.0,
        command_steering=axle.command_steering or 0.0,
    )


def _axle_yaw_inertia(axle: BeamAxle, properties: Properties) -> float:
    """Yaw inertia of an axle with its wheels about its middle, kg m^2."""
    beam = (axle.mass - 2 * axle.wheel_mass) * (2 * properties.half_track) ** 2 / 12
    wheel = axle.wheel_mass * properties.wheel_gyration**2
    # about a diameter, a disc has half its spin inertia
    return beam + (2 * axle.wheel_mass * properties.half_track**2 + wheel)
