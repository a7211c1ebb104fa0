"""Mass, CoG height and roll inertia of the laden sprung body: equations (8) and (9) of Cheng and Cebon (2011).

C. Cheng, D. Cebon, "Parameter and state estimation for articulated heavy vehicles", Vehicle System Dynamics 49 (2011).
The functions use only + - * /, so they accept floats, NumPy arrays and CasADi symbols.
"""

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from fifthwheel.base.names import ParameterPath
from fifthwheel.truck.unit import Unit


class Laden(NamedTuple):
    """The sprung body with its payload; numbers, arrays or symbols."""

    mass: Any
    """kg."""
    cog_height: Any
    """Above the ground, m."""
    roll_inertia: Any
    """About the roll axis, kg m^2."""


def laden(p: Mapping[str, Any], unit: Unit) -> Laden:
    """Laden sprung mass, CoG height and roll inertia of a unit: equations (8) and (9).

    The CoG of a payload is at half its height above the floor. A point mass has no term (D_p^2 + h_p^2) / 12.

    Args:
        p: parameters by path; numbers, arrays or symbols.
        unit: gives the name and the shape of the payload; its numbers are not used.
    """
    mass, cog_height = p[f"{unit.name}.sprung.mass"], p[f"{unit.name}.sprung.cog_height"]
    roll_axis = p[f"{unit.name}.roll_axis_height"]
    lever = cog_height - roll_axis
    inertia = p[f"{unit.name}.sprung.roll_inertia"] + mass * (lever * lever)
    if unit.payload is None:
        return Laden(mass, cog_height, inertia)
    load, height, width, floor = (
        p[f"{unit.name}.payload.{key}"] for key in ("mass", "height", "width", "floor_height")
    )
    cog, lever = floor + height / 2, floor + height / 2 - roll_axis
    inertia = inertia + load * (lever * lever)
    if unit.payload.shape == "uniform":
        inertia = inertia + load * (width * width + height * height) / 12
    return Laden(mass + load, (cog_height * mass + cog * load) / (mass + load), inertia)


def unit_cog_height(p: Mapping[str, Any], unit: Unit) -> Any:
    """CoG height of a laden unit above the ground, m, with its unsprung mass at the height of the roll axis.

    Arguments as of `laden`.
    """
    body = laden(p, unit)
    sprung = body.mass / p[f"{unit.name}.mass"]
    return sprung * body.cog_height + (1 - sprung) * p[f"{unit.name}.roll_axis_height"]


def lumped_sigmas(stated: Mapping[str, float], unit: str, paths: Iterable[str]) -> dict[str, float]:
    """Stated standard deviations once the payload of a unit is lumped into its sprung body; see `Vehicle.lumped`."""
    body, payload = f"{unit}.sprung", f"{unit}.payload"
    inputs = [p for p in paths if ParameterPath.of(p).owner in (body, payload) or p == f"{unit}.roll_axis_height"]
    replaced = {f"{body}.{key}" for key in ("mass", "cog_height", "roll_inertia")}
    lumped = {path: s for path, s in stated.items() if path not in replaced and ParameterPath.of(path).owner != payload}
    masses = [stated[path] for path in (f"{body}.mass", f"{payload}.mass") if path in stated]
    if len(masses) == 2:
        lumped[f"{body}.mass"] = math.hypot(*masses)
    if all(stated.get(path) == 0 for path in inputs):
        lumped |= dict.fromkeys(replaced, 0.0)
    return lumped
