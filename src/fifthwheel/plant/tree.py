"""The truck as a MuJoCo tree: bodies hang behind fifth wheels, axles below bodies, wheels on axles.

The first unit is free in six degrees of freedom. A unit's frame has the origin of the vehicle file and lies on the
ground. A coupling turns in pitch, roll (a spring, K_12) and yaw. An axle slides along its body's vertical axis and
turns about the suspension's roll centre; its wheels spin. Tyres, air and road act from outside, see tyres.py.
"""

from xml.etree import ElementTree as Xml

from fifthwheel.plant.body import Beam, Body
from fifthwheel.plant.properties import Properties
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.statics import STANDARD_GRAVITY as GRAVITY

SIDES = {"left": 1.0, "right": -1.0}
FRAME = ("framepos", "framexaxis", "frameyaxis", "framelinvel", "frameangvel")
"""What is sensed of a body's frame, three numbers each, in the world's axes."""


def xml(vehicle: Vehicle, bodies: tuple[Body, ...], properties: Properties, step: float) -> str:
    """The model in MuJoCo's XML."""
    root = Xml.Element("mujoco", model=vehicle.name)
    Xml.SubElement(root, "compiler", angle="radian", inertiafromgeom="false", boundmass="0", autolimits="true")
    option = Xml.SubElement(root, "option", timestep=repr(step), gravity=f"0 0 {-GRAVITY!r}", integrator="implicitfast")
    Xml.SubElement(option, "flag", contact="disable", constraint="disable", equality="disable", limit="disable")
    parent = Xml.SubElement(root, "worldbody")
    sensors = Xml.Element("sensor")
    at = 0.0  # x of the unit's origin in the frame of the body it hangs on
    for i, (unit, body) in enumerate(zip(vehicle.units, bodies, strict=True)):
        here = Xml.SubElement(parent, "body", name=body.name, pos=f"{at!r} 0 0")
        if i == 0:
            Xml.SubElement(here, "freejoint", name=body.name)
        else:
            coupling = vehicle.couplings[i - 1]
            place = f"{coupling.trailing_position!r} 0 {coupling.height!r}"
            _hinge(here, f"{coupling.name}.pitch", "0 1 0", place)
            _hinge(here, f"{coupling.name}.roll", "1 0 0", place, coupling.roll_stiffness, coupling.roll_damping)
            _hinge(here, f"{coupling.name}.yaw", "0 0 1", place)
        rear = here
        if i == 0 and properties.frame_torsion is not None:
            rear = _halved(here, body, properties.frame_torsion, unit.roll_axis_height)
        else:
            _inertial(here, body.mass, (body.cog[0], 0.0, body.cog[1]), body.inertia)
        mark = Xml.SubElement(here, "site", name=body.name, pos=f"{unit.cog!r} 0 {unit.roll_axis_height!r}")
        _sense(sensors, "xbody", body.name)
        Xml.SubElement(sensors, "accelerometer", site=mark.get("name", ""))
        for k, beam in enumerate(body.beams):
            _axle(here if k == 0 else rear, beam, properties)
        parent = rear
        if i < len(vehicle.couplings):
            at = vehicle.couplings[i].leading_position - vehicle.couplings[i].trailing_position
    for beam in (beam for body in bodies for beam in body.beams):
        _sense(sensors, "xbody", beam.name)
        Xml.SubElement(sensors, "jointpos", joint=f"{beam.name}.roll")
        for side in SIDES:
            Xml.SubElement(sensors, "jointvel", joint=f"{beam.name}.{side}")
    root.append(sensors)
    return Xml.tostring(root, encoding="unicode")


def _axle(parent: Xml.Element, beam: Beam, properties: Properties) -> None:
    axle = Xml.SubElement(parent, "body", name=beam.name, pos=f"{beam.x!r} 0 {beam.roll_centre!r}")
    preload = -(beam.load - beam.mass * GRAVITY) / beam.spring
    Xml.SubElement(
        axle,
        "joint",
        name=f"{beam.name}.lift",
        type="slide",
        axis="0 0 1",
        stiffness=repr(beam.spring),
        damping=repr(beam.damper),
        springref=repr(preload),
    )
    _hinge(axle, f"{beam.name}.roll", "1 0 0", "0 0 0", beam.roll_spring, beam.roll_damper)
    down = properties.wheel_radius - beam.roll_centre
    rod = beam.mass - 2 * beam.wheel_mass
    across = rod * (2 * properties.half_track) ** 2 / 12
    _inertial(axle, rod, (0.0, 0.0, down), (across, 1e-3 * across, across, 0.0))
    spin = beam.wheel_mass * properties.wheel_gyration**2
    for side, sign in SIDES.items():
        wheel = Xml.SubElement(
            axle, "body", name=f"{beam.name}.{side}", pos=f"0 {sign * properties.half_track!r} {down!r}"
        )
        _hinge(wheel, f"{beam.name}.{side}", "0 1 0", "0 0 0")
        _inertial(wheel, beam.wheel_mass, (0.0, 0.0, 0.0), (spin / 2, spin, spin / 2, 0.0))


def _halved(front: Xml.Element, body: Body, torsion: float, height: float) -> Xml.Element:
    """The body as two halves in a row with a torsion spring between them; together they have its mass and inertia."""
    xx, yy, zz, product = body.inertia
    apart = 0.5 * (zz / body.mass) ** 0.5
    half = (xx / 2, (yy - body.mass * apart**2) / 2, (zz - body.mass * apart**2) / 2, product / 2)
    _inertial(front, body.mass / 2, (body.cog[0] + apart, 0.0, body.cog[1]), half)
    rear = Xml.SubElement(front, "body", name=f"{body.name}.rear_frame", pos="0 0 0")
    _hinge(rear, f"{body.name}.frame", "1 0 0", f"0 0 {height!r}", torsion, 0.01 * torsion)
    _inertial(rear, body.mass / 2, (body.cog[0] - apart, 0.0, body.cog[1]), half)
    return rear


def _hinge(body: Xml.Element, name: str, axis: str, place: str, stiffness: float = 0.0, damping: float = 0.0) -> None:
    Xml.SubElement(
        body,
        "joint",
        name=name,
        type="hinge",
        axis=axis,
        pos=place,
        stiffness=repr(stiffness),
        damping=repr(damping),
    )


def _inertial(
    body: Xml.Element,
    mass: float,
    place: tuple[float, float, float],
    inertia: tuple[float, float, float, float],
) -> None:
    xx, yy, zz, product = inertia
    Xml.SubElement(
        body,
        "inertial",
        mass=repr(mass),
        pos=" ".join(map(repr, place)),
        fullinertia=f"{xx!r} {yy!r} {zz!r} 0 {-product!r} 0",
    )


def _sense(sensors: Xml.Element, kind: str, name: str) -> None:
    for what in FRAME:
        Xml.SubElement(sensors, what, objtype=kind, objname=name)
