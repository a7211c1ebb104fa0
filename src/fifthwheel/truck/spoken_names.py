"""Spoken names of parameters, sensor errors and signals: "Trailer, yaw inertia" for semitrailer.yaw_inertia."""

from fifthwheel.base.names import ParameterPath, split_log
from fifthwheel.data.channels import SensorErrorName, SignalName, channel_of
from fifthwheel.truck.quantities import COUPLINGS, MASS_SCALE, quantity_of

FIRST_UNITS = ("tractor", "truck")
"""Units of which an axle group needs no name of the unit: "front tyres"."""
ORDINALS = ("first", "second", "third", "lead")
"""Names of trailers that are an adjective."""
COMPONENTS = {"sprung": "body", "accelerometer": "accelerometer"}
SIGNALS = {key: f"{key} angle" for key in ("steer", "articulation", "roll", "sideslip")}
"""Quantities of signals whose name is more than its words."""
WHOLES = {
    MASS_SCALE: ("", "scale of all masses"),
    "tyre.shape": ("tyres", "shape of the force curve"),
    "time_base": ("time base", "rate"),
    "time_base.scale": ("time base", "rate"),
}


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
        return _within(signal.unit, part) if part else named_unit(signal.unit), _signal(signal.quantity)
    unit, component, quantity = ParameterPath.of(path)
    if not quantity:
        return "", unit.replace("_", " ")
    part = "" if unit.endswith(COUPLINGS) else quantity_of(path).part
    group = " ".join(filter(None, (COMPONENTS.get(component, component), part))).replace("_", " ").replace(".", " ")
    words = quantity_of(path).words or quantity.replace("_", " ")
    return _within(unit, group) if component and part else f"{named_unit(unit)} {group}".rstrip(), words


def _within(unit: str, part: str) -> str:
    """A part of an axle group; that of the first unit needs no name of the unit."""
    return (
        part
        if unit in FIRST_UNITS and part.endswith((" axle", " tyres", " suspension"))
        else f"{named_unit(unit)} {part}"
    )


def _signal(name: str) -> str:
    return SIGNALS.get(name, name.replace("_", " "))
