"""Spoken names of parameters, sensor errors and signals: "Trailer, yaw inertia" for semitrailer.yaw_inertia."""

from fifthwheel.channels import SensorErrorName, SignalName, channel_of
from fifthwheel.names import ParameterPath, split_log
from fifthwheel.vehicle.uncertainty import MASS_SCALE

FIRST_UNITS = ("tractor", "truck")
"""Units of which an axle group needs no name of the unit: "front tyres"."""
ORDINALS = ("first", "second", "third", "lead")
"""Names of trailers that are an adjective."""
PARTS = {
    **dict.fromkeys(("cornering_stiffness", "relaxation_length", "pneumatic_trail", "softening"), "tyres"),
    "tyre_roll_stiffness": "tyres",
    "relative_friction": "tyres",
    **dict.fromkeys(("roll_stiffness", "roll_damping"), "suspension"),
    **dict.fromkeys(("static_load", "self_steering", "command_steering"), "axle"),
}
"""Quantity -> the part of an axle group that has it."""
COMPONENTS = {"sprung": "body", "accelerometer": "accelerometer"}
QUANTITIES = {
    "cog": "CoG position",
    "cog_height": "CoG height",
    "coupling": "coupling position",
    "tyre_roll_stiffness": "roll stiffness",
    "roll_yaw_product": "roll-yaw product of inertia",
    "steer": "steer angle",
    "articulation": "articulation angle",
    "roll": "roll angle",
    "sideslip": "sideslip angle",
}
"""Quantities whose name is more than its words."""
WHOLES = {
    MASS_SCALE: ("", "scale of all masses"),
    "tyre.shape": ("tyres", "shape of the force curve"),
    "time_base": ("time base", "rate"),
    "time_base.scale": ("time base", "rate"),
}
COUPLINGS = ("wheel", "drawbar", "coupling", "hitch", "turntable")
"""A word with one of these ends the name of a coupling."""


def spoken(path: str) -> str:
    """A path as the words of a table: what it belongs to, and the quantity.

    >>> spoken("tractor.front.cornering_stiffness"), spoken("semitrailer.cog_height")
    ('Front tyres, cornering stiffness', 'Trailer, CoG height')
    >>> spoken("yaw_rate.semitrailer"), spoken("steer.tractor.front.gain@bend")
    ('Trailer, yaw rate', 'Front axle, steer angle gain, bend')
    """
    base, log = split_log(path)
    text = ", ".join(filter(None, (*_owner_and_quantity(base), log)))
    return text[:1].upper() + text[1:]


def named(path: str) -> str:
    """A path as the words of a sentence.

    >>> named("semitrailer.yaw_inertia"), named("mass_scale")
    ('the yaw inertia of the trailer', 'the scale of all masses')
    """
    base, log = split_log(path)
    owner, quantity = _owner_and_quantity(base)
    return f"the {quantity}" + (f" of the {owner}" if owner else "") + (f" in {log}" if log else "")


def named_unit(unit: str) -> str:
    """A unit in words: "semitrailer" -> "trailer", "first" -> "first trailer"."""
    words = unit.replace("semitrailer", "trailer").replace("_", " ")
    return f"{words} trailer" if words in ORDINALS else words


def named_axle(group: str) -> str:
    """The path of an axle group in words: "tractor.drive" -> "drive axle", "semitrailer" -> "trailer axle"."""
    unit, _, part = group.partition(".")
    return _within(unit, f"{part.replace('_', ' ')} axle".lstrip())


def _owner_and_quantity(path: str) -> tuple[str, str]:
    if path in WHOLES:
        return WHOLES[path]
    error = SensorErrorName.of(path)
    if error:
        owner, quantity = _owner_and_quantity(error.signal)
        return owner, " ".join(filter(None, (quantity, error.kind.replace("_", " "))))
    if channel := channel_of(path):
        signal = SignalName.of(path)
        part = signal.part.replace("_", " ").replace(".", " ") + " axle" * (channel.of == "part" and bool(signal.part))
        return _within(signal.unit, part) if part else named_unit(signal.unit), _quantity(signal.quantity)
    unit, component, quantity = ParameterPath.of(path)
    if not quantity:
        return "", unit.replace("_", " ")
    part = "" if unit.endswith(COUPLINGS) else PARTS.get(quantity, "")
    group = " ".join(filter(None, (COMPONENTS.get(component, component), part))).replace("_", " ").replace(".", " ")
    return _within(unit, group) if component and part else f"{named_unit(unit)} {group}".rstrip(), _quantity(quantity)


def _within(unit: str, part: str) -> str:
    """A part of an axle group; that of the first unit needs no name of the unit."""
    return (
        part
        if unit in FIRST_UNITS and part.endswith((" axle", " tyres", " suspension"))
        else f"{named_unit(unit)} {part}"
    )


def _quantity(name: str) -> str:
    return QUANTITIES.get(name, name.replace("_", " "))
