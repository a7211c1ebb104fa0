"""Bodies of the nonlinear truck, SI, ISO 8855: masses, inertias, springs and positions, and the MuJoCo model in XML.

In the model, units are behind couplings, axles below units, wheels on axles. The first unit has six degrees of freedom.
The frame of a unit has the origin of the vehicle file and lies on the ground. A coupling rotates in pitch, roll (with
the spring K_12) and yaw (with a spring and damper if it has them); a turntable does not pitch, and the hinged drawbar
in front of it lets the eye move up and down on the dolly. An axle moves along the vertical axis of its body and rolls
about the roll centre of its suspension; its wheels spin. A raised axle is fixed to its body. The forces of tyres, air
and road come from outside, see tyre_forces.py.
"""

import math
from dataclasses import dataclass
from xml.etree import ElementTree as Xml

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.plant.properties import Properties
from fifthwheel.truck import AxleGroup, Coupling, Unit, Vehicle

SIDES = {"left": 1.0, "right": -1.0}
"""Sign of y of the wheels."""
LIFT = 0.15
"""Of the wheels of a raised axle over the others, m."""
FRAME_SENSORS = ("framepos", "framexaxis", "frameyaxis", "framelinvel", "frameangvel")
"""MuJoCo sensors of the frame of a body, three numbers each, in world axes."""


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
    tyres, driven = vehicle.tyres(), vehicle.driven_groups()
    axles = tuple(
        _axle(unit, group, i, axle_mass, loads[path], tyres[path], properties, driven=path in driven)
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
    driven: bool,
) -> BeamAxle:
    path, n, axle = unit.group_path(group), len(group.on_road), group.on_road[i]
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
        driven=driven,
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


def model_xml(vehicle: Vehicle, bodies: tuple[SprungBody, ...], properties: Properties, time_step: float) -> str:
    """The model in MuJoCo's XML format; time_step in s."""
    root = Xml.Element("mujoco", model=vehicle.name)
    Xml.SubElement(root, "compiler", angle="radian", inertiafromgeom="false", boundmass="0", autolimits="true")
    option = Xml.SubElement(
        root, "option", timestep=repr(time_step), gravity=f"0 0 {-GRAVITY!r}", integrator="implicitfast"
    )
    Xml.SubElement(option, "flag", contact="disable", constraint="disable", equality="disable", limit="disable")
    parent = Xml.SubElement(root, "worldbody")
    sensors = Xml.Element("sensor")
    origin = 0.0  # x of the unit's origin in the frame of the unit in front
    for i, (unit, body) in enumerate(zip(vehicle.units, bodies, strict=True)):
        element = Xml.SubElement(parent, "body", name=body.name, pos=f"{origin!r} 0 0")
        if i == 0:
            Xml.SubElement(element, "freejoint", name=body.name)
        else:
            _add_coupling(
                element, vehicle.couplings[i - 1], is_hinged=not all(c.pitches for c in vehicle.couplings[i : i + 1])
            )
        rear = element
        if i == 0 and properties.frame_torsion is not None:
            rear = _add_halves(element, body, properties.frame_torsion, unit.roll_axis_height)
        else:
            _add_inertia(element, body.mass, (body.cog[0], 0.0, body.cog[1]), body.inertia)
        place = unit.place_of_accelerometer()
        Xml.SubElement(element, "site", name=body.name, pos=f"{place.position!r} 0 {place.height!r}")
        _add_frame_sensors(sensors, body.name)
        Xml.SubElement(sensors, "accelerometer", site=body.name)
        for k, axle in enumerate(body.axles):
            _add_axle(element if k == 0 else rear, axle, properties)
        for x, mass, inertia in body.raised:
            raised = Xml.SubElement(rear, "body", pos=f"{x!r} 0 {properties.wheel_radius + LIFT!r}")
            _add_inertia(raised, mass, (0.0, 0.0, 0.0), (inertia, 1e-3 * inertia, inertia, 0.0))
        parent = rear
        if i < len(vehicle.couplings):
            origin = vehicle.couplings[i].leading_position - vehicle.couplings[i].trailing_position
    for axle in (axle for body in bodies for axle in body.axles):
        _add_frame_sensors(sensors, axle.name)
        Xml.SubElement(sensors, "jointpos", joint=f"{axle.name}.roll")
        for side in SIDES:
            Xml.SubElement(sensors, "jointvel", joint=f"{axle.name}.{side}")
    root.append(sensors)
    return Xml.tostring(root, encoding="unicode")


def _add_coupling(body: Xml.Element, coupling: Coupling, *, is_hinged: bool) -> None:
    """The joints of a unit to the unit in front; `is_hinged` for a drawbar that is hinged in pitch to its dolly."""
    position = f"{coupling.trailing_position!r} 0 {coupling.height!r}"
    if is_hinged:
        Xml.SubElement(body, "joint", name=f"{coupling.name}.lift", type="slide", axis="0 0 1")
    if coupling.pitches:
        _add_hinge(body, f"{coupling.name}.pitch", "0 1 0", position)
    _add_hinge(body, f"{coupling.name}.roll", "1 0 0", position, coupling.roll_stiffness, coupling.roll_damping)
    of_yaw = coupling.yaw_stiffness or 0.0, coupling.yaw_damping or 0.0
    _add_hinge(body, f"{coupling.name}.yaw", "0 0 1", position, *of_yaw)


def _add_axle(parent: Xml.Element, axle: BeamAxle, properties: Properties) -> None:
    element = Xml.SubElement(parent, "body", name=axle.name, pos=f"{axle.x!r} 0 {axle.roll_centre_height!r}")
    preload = -(axle.load - axle.mass * GRAVITY) / axle.vertical_stiffness
    spring = {"stiffness": axle.vertical_stiffness, "damping": axle.vertical_damping, "springref": preload}
    numbers = {key: repr(value) for key, value in spring.items()}
    Xml.SubElement(element, "joint", numbers, name=f"{axle.name}.lift", type="slide", axis="0 0 1")
    _add_hinge(element, f"{axle.name}.roll", "1 0 0", "0 0 0", axle.roll_stiffness, axle.roll_damping)
    height = properties.wheel_radius - axle.roll_centre_height  # of the wheel centres over the roll centre
    beam_mass = axle.mass - 2 * axle.wheel_mass
    beam_inertia = beam_mass * (2 * properties.half_track) ** 2 / 12
    _add_inertia(element, beam_mass, (0.0, 0.0, height), (beam_inertia, 1e-3 * beam_inertia, beam_inertia, 0.0))
    spin_inertia = axle.wheel_mass * properties.wheel_gyration**2
    for side, sign in SIDES.items():
        wheel = Xml.SubElement(
            element, "body", name=f"{axle.name}.{side}", pos=f"0 {sign * properties.half_track!r} {height!r}"
        )
        _add_hinge(wheel, f"{axle.name}.{side}", "0 1 0", "0 0 0")
        _add_inertia(wheel, axle.wheel_mass, (0.0, 0.0, 0.0), (spin_inertia / 2, spin_inertia, spin_inertia / 2, 0.0))


def _add_halves(front: Xml.Element, body: SprungBody, torsion: float, height: float) -> Xml.Element:
    """Split a body into two halves with a torsion spring, the front one into `front`; the rear half."""
    xx, yy, zz, product = body.inertia
    distance = 0.5 * (zz / body.mass) ** 0.5  # of each half from the CoG of the body, m
    yy, zz = (moment - body.mass * distance**2 for moment in (yy, zz))
    half = (xx / 2, pitch_inertia(yy, xx, zz, product) / 2, zz / 2, product / 2)
    _add_inertia(front, body.mass / 2, (body.cog[0] + distance, 0.0, body.cog[1]), half)
    rear = Xml.SubElement(front, "body", name=f"{body.name}.rear_frame", pos="0 0 0")
    _add_hinge(rear, f"{body.name}.frame", "1 0 0", f"0 0 {height!r}", torsion, 0.01 * torsion)
    _add_inertia(rear, body.mass / 2, (body.cog[0] - distance, 0.0, body.cog[1]), half)
    return rear


def _add_hinge(
    body: Xml.Element, name: str, axis: str, position: str, stiffness: float = 0.0, damping: float = 0.0
) -> None:
    spring = {"stiffness": repr(stiffness), "damping": repr(damping)}
    Xml.SubElement(body, "joint", spring, name=name, type="hinge", axis=axis, pos=position)


def _add_inertia(
    body: Xml.Element, mass: float, position: tuple[float, float, float], inertia: tuple[float, float, float, float]
) -> None:
    xx, yy, zz, product = inertia
    tensor = f"{xx!r} {yy!r} {zz!r} 0 {-product!r} 0"
    Xml.SubElement(body, "inertial", mass=repr(mass), pos=" ".join(map(repr, position)), fullinertia=tensor)


def _add_frame_sensors(sensors: Xml.Element, body: str) -> None:
    for kind in FRAME_SENSORS:
        Xml.SubElement(sensors, kind, objtype="xbody", objname=body)
