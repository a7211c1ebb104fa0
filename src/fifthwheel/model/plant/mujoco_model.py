"""The MuJoCo model of the truck in XML: units behind couplings, axles below units, wheels on axles.

The first unit has six degrees of freedom. The frame of a unit has the origin of the vehicle file and lies on the
ground. A coupling rotates in pitch, roll (with the spring K_12) and yaw; a turntable does not pitch, and the hinged
drawbar in front of it lets the eye move up and down on the dolly. An axle moves along the vertical axis of its
body and rolls about the roll centre of its suspension; its wheels spin. A raised axle is fixed to its body. The forces
of tyres, air and road come from outside, see tyre_forces.py.
"""

from xml.etree import ElementTree as Xml

from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.plant.bodies import BeamAxle, SprungBody, pitch_inertia
from fifthwheel.model.plant.properties import Properties
from fifthwheel.truck import Coupling, Vehicle

SIDES = {"left": 1.0, "right": -1.0}
"""Sign of y of the wheels."""
LIFT = 0.15
"""Of the wheels of a raised axle over the others, m."""
FRAME_SENSORS = ("framepos", "framexaxis", "frameyaxis", "framelinvel", "frameangvel")
"""MuJoCo sensors of the frame of a body, three numbers each, in world axes."""


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
    _add_hinge(body, f"{coupling.name}.yaw", "0 0 1", position)


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
