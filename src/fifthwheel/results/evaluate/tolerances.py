"""Tolerances of a validation: relative, absolute, or the sum of both, by measure and curve."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fifthwheel.base.errors import SignalError, UnitError, suggestion
from fifthwheel.base.names import begins_with, split_kind
from fifthwheel.base.units import quantity, uncertain_quantity

DEFAULTS: Mapping[str, str] = {
    "understeer_gradient": "10 % + 0.1 deg/g",
    "sideslip_gradient": "10 % + 0.1 deg/g",
    "roll_gradient": "10 % + 0.1 deg/g",
    "gain": "10 %",
    "bandwidth": "10 %",
    "steady_gain": "10 %",
    "response_time": "10 % + 50 ms",
    "peak_response_time": "10 % + 50 ms",
    "overshoot": "0.05",
    "rearward_amplification_yaw_rate": "10 %",
    "rearward_amplification_lateral_acceleration": "10 %",
    "yaw_damping": "0.05",
    "yaw_rate_ratio_1000ms": "0.05",
    "yaw_rate_ratio_1750ms": "0.05",
    "steer_less_ackermann": "10 % + 0.05 deg",
    "steer": "5 % + 0.1 deg",
    "yaw_rate": "10 % + 0.2 deg/s",
    "articulation": "10 % + 0.2 deg",
    "roll": "10 % + 0.1 deg",
    "sideslip": "10 % + 0.1 deg",
    "lateral_acceleration": "10 % + 0.1 m/s^2",
    "lateral_velocity": "10 % + 0.05 m/s",
    "phase": "10 deg",
}
"""By the first word of a measure or curve. They are ours, and those of no standard."""


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """Half of the width of a tolerance band: relative * size + absolute."""

    text: str
    """As it was stated."""
    relative: float
    absolute: float
    """SI."""

    @classmethod
    def parse(cls, key: str, text: str, unit: str) -> "Tolerance":
        """A tolerance such as "5 %", "0.1 deg/g" or "5 % + 0.1 deg/g" of a quantity in the SI unit `unit`.

        Raises:
            SignalError: the text is no tolerance of such a quantity, negative or 0.

        Example:
            >>> Tolerance.parse("response_time", "5 % + 20 ms", "s")
            Tolerance(text='5 % + 20 ms', relative=0.05, absolute=0.02)
        """
        sums = {True: 0.0, False: 0.0}
        try:
            for part in str(text).split("+"):
                is_relative = part.rstrip().endswith("%")
                value = quantity(part, "1") if is_relative else _absolute(part, unit)
                sums[is_relative] += value if value > 0 else float("nan")
        except UnitError as error:
            raise SignalError(
                f"tolerance {key}={text}: {error}; give percent, a value in {unit}, or a sum such as '5 % + 0.1 {unit}'"
            ) from None
        if not sum(sums.values()) < np.inf:
            raise SignalError(f"tolerance {key}={text}: expected finite numbers above 0; correct it")
        return cls(text=str(text), relative=sums[True], absolute=sums[False])


def tolerance_of(name: str, unit: str, stated: Mapping[str, str]) -> Tolerance:
    """The stated tolerance whose key is the longest beginning of a name, whole words between dots; else the default."""
    key = max((key for key in stated if begins_with(name, key)), key=len, default=None)
    if key is None:
        return Tolerance.parse(name, DEFAULTS[split_kind(name)[0]], unit)
    return Tolerance.parse(key, stated[key], unit)


def require_used(stated: Mapping[str, str], names: list[str]) -> None:
    """Raise a SignalError for a tolerance that belongs to nothing that is compared."""
    for key in stated:
        if not any(begins_with(name, key) for name in names):
            raise SignalError(f"tolerance {key}: nothing with this name is compared; {suggestion(str(key), names)}")


def _absolute(text: str, unit: str) -> float:
    return uncertain_quantity(text, unit, strict=True, unit_needed=unit != "1")[0]
