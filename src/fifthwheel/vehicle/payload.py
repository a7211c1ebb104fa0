"""Mass, CoG height and roll inertia of the laden sprung body: equations (8) and (9) of Cheng and Cebon (2011).

C. Cheng, D. Cebon, "Parameter and state estimation for articulated heavy vehicles", Vehicle System Dynamics 49 (2011).
The functions use only + - * /, so they accept floats, NumPy arrays and CasADi symbols.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from fifthwheel.vehicle.unit import Unit


class Laden(NamedTuple):
    """The sprung body with its payload; numbers, arrays or symbols."""

    mass: Any
    """kg."""
    cog_height: Any
    """Above the ground, m."""
    roll_inertia: Any
    """About the roll axis, kg m^2."""


def laden_cog_height(*, mass: Any, cog_height: Any, payload_mass: Any, payload_height: Any, floor_height: Any) -> Any:
    """CoG height of the laden sprung body above the ground, m; equation (8).

    Args:
        mass, cog_height: of the unladen sprung body, m_se in kg and h_se in m.
        payload_mass: kg.
        payload_height: h_p, from the floor to the top of the load, m.
        floor_height: h_f, above the ground, m.
    """
    payload_cog = floor_height + payload_height / 2
    return (cog_height * mass + payload_cog * payload_mass) / (mass + payload_mass)


def laden_roll_inertia(
    *,
    roll_inertia: Any,
    payload_mass: Any,
    payload_height: Any,
    payload_width: Any,
    floor_height: Any,
    roll_axis_height: Any,
    uniform: bool = True,
) -> Any:
    """Roll inertia of the laden sprung body about the roll axis, kg m^2; equation (9).

    Args:
        roll_inertia: of the unladen sprung body about the roll axis (I_sx'x'_e), not about its own CoG, kg m^2.
        payload_mass: kg.
        payload_height, payload_width: h_p and D_p, m.
        floor_height, roll_axis_height: h_f and h_r, above the ground, m.
        uniform: False for a point mass at half the height on the centre line, without the term (D_p^2 + h_p^2) / 12.
    """
    lever = floor_height + payload_height / 2 - roll_axis_height
    total = roll_inertia + payload_mass * (lever * lever)
    if not uniform:
        return total
    return total + payload_mass * (payload_width * payload_width + payload_height * payload_height) / 12


def laden(p: Mapping[str, Any], unit: Unit) -> Laden:
    """Laden sprung mass, CoG height and roll inertia of a unit.

    Args:
        p: parameters by path; numbers, arrays or symbols.
        unit: gives the name and the shape of the payload; its numbers are not used.
    """
    mass, height = p[f"{unit.name}.sprung.mass"], p[f"{unit.name}.sprung.cog_height"]
    roll_axis = p[f"{unit.name}.roll_axis_height"]
    lever = height - roll_axis
    inertia = p[f"{unit.name}.sprung.roll_inertia"] + mass * (lever * lever)
    if unit.payload is None:
        return Laden(mass, height, inertia)
    payload_mass, payload_height, width, floor = (
        p[f"{unit.name}.payload.{key}"] for key in ("mass", "height", "width", "floor_height")
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


def unit_cog_height(p: Mapping[str, Any], unit: Unit) -> Any:
    """CoG height of a laden unit above the ground, m, with its unsprung mass at the height of the roll axis.

    Arguments as of `laden`.
    """
    body = laden(p, unit)
    sprung = body.mass / p[f"{unit.name}.mass"]
    return sprung * body.cog_height + (1 - sprung) * p[f"{unit.name}.roll_axis_height"]


def lumped_sigmas(stated: Mapping[str, float], unit: str, paths: Iterable[str]) -> dict[str, float]:
    """Stated standard deviations once the payload of a unit is lumped into its sprung body; see `Vehicle.lumped`."""
    body, payload = f"{unit}.sprung.", f"{unit}.payload."
    inputs = [path for path in paths if path.startswith((body, payload)) or path == f"{unit}.roll_axis_height"]
    replaced = {f"{body}{key}" for key in ("mass", "cog_height", "roll_inertia")}
    lumped = {path: s for path, s in stated.items() if path not in replaced and not path.startswith(payload)}
    masses = [stated[path] for path in (f"{body}mass", f"{payload}mass") if path in stated]
    if len(masses) == 2:
        lumped[f"{body}mass"] = math.hypot(*masses)
    if all(stated.get(path) == 0 for path in inputs):
        lumped |= dict.fromkeys(replaced, 0.0)
    return lumped
