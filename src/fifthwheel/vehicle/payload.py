"""What a payload does to the sprung body: equations (8) and (9) of Cheng and Cebon (2011).

C. Cheng, D. Cebon, "Parameter and state estimation for articulated heavy vehicles", Vehicle System Dynamics 49 (2011).
Plain functions of + - * / only: floats, NumPy arrays and CasADi symbols alike.
"""

from collections.abc import Mapping
from typing import Any, Generic, NamedTuple, Protocol, Self, TypeVar

from fifthwheel.vehicle.unit import Unit


class Arithmetic(Protocol):
    """Something that adds, subtracts, multiplies and divides."""

    def __add__(self, other: Any, /) -> Self: ...
    def __sub__(self, other: Any, /) -> Self: ...
    def __mul__(self, other: Any, /) -> Self: ...
    def __truediv__(self, other: Any, /) -> Self: ...


T = TypeVar("T", bound=Arithmetic)


class Laden(NamedTuple, Generic[T]):
    """The sprung body with its payload."""

    mass: T
    """kg."""
    cog_height: T
    """Above the ground, m."""
    roll_inertia: T
    """About the roll axis, kg m^2."""


def laden_cog_height(*, mass: T, cog_height: T, payload_mass: T, payload_height: T, floor_height: T) -> T:
    """CoG height of the laden sprung body above the ground, m; equation (8).

    mass and cog_height are those of the unladen sprung body (m_se, h_se); payload_height (h_p) counts from the floor.
    """
    payload_cog = floor_height + payload_height / 2
    return (cog_height * mass + payload_cog * payload_mass) / (mass + payload_mass)


def laden_roll_inertia(
    *,
    roll_inertia: T,
    payload_mass: T,
    payload_height: T,
    payload_width: T,
    floor_height: T,
    roll_axis_height: T,
    uniform: bool = True,
) -> T:
    """Roll inertia of the laden sprung body about the roll axis, kg m^2; equation (9).

    roll_inertia is that of the unladen sprung body about the roll axis (I_sx'x'_e), not about its own CoG. A payload
    that is not uniform is a point at half its height on the centre line: the term (D_p^2 + h_p^2) / 12 falls away.
    """
    lever = floor_height + payload_height / 2 - roll_axis_height
    total = roll_inertia + payload_mass * (lever * lever)
    if not uniform:
        return total
    return total + payload_mass * (payload_width * payload_width + payload_height * payload_height) / 12


def laden(p: Mapping[str, T], unit: Unit) -> Laden[T]:
    """Laden sprung mass, CoG height and roll inertia of a unit from parameters keyed by their paths.

    The values of p may be symbols; from the unit itself come only its name and whether and how it is loaded.
    """
    mass, height = p[f"{unit.name}.sprung.mass"], p[f"{unit.name}.sprung.cog_height"]
    roll_axis = p[f"{unit.name}.roll_axis_height"]
    lever = height - roll_axis
    inertia = p[f"{unit.name}.sprung.roll_inertia"] + mass * (lever * lever)
    if unit.payload is None:
        return Laden(mass, height, inertia)
    payload_mass, payload_height, width, floor = (
        p[f"{unit.name}.payload.{word}"] for word in ("mass", "height", "width", "floor_height")
    )
    return Laden(
        mass + payload_mass,
        laden_cog_height(
            mass=mass, cog_height=height, payload_mass=payload_mass, payload_height=payload_height, floor_height=floor
        ),
        laden_roll_inertia(
            roll_inertia=inertia,
            payload_mass=payload_mass,
            payload_height=payload_height,
            payload_width=width,
            floor_height=floor,
            roll_axis_height=roll_axis,
            uniform=unit.payload.shape == "uniform",
        ),
    )
