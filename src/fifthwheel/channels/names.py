"""Names of signals, quantity.unit[.part]; signals are in SI and ISO 8855 (y left, z up).

"yaw_rate.tractor" is the yaw rate of the unit named tractor in rad/s; "steer.tractor.front" is the road-wheel angle of
its front axle in rad. "time" and "speed" belong to the whole vehicle and have no unit name.
"""

from functools import lru_cache
from typing import NamedTuple, Self


class SignalName(NamedTuple):
    """The parts of a signal's name.

    >>> SignalName.of("steer.tractor.front")
    SignalName(quantity='steer', unit='tractor', part='front')
    """

    quantity: str
    unit: str
    """Empty for a signal of the whole vehicle, such as speed."""
    part: str
    """Axle or axle group, or which of several sensors of the quantity on a unit; may hold several words, such as
    "front.left"; empty where the name has none."""

    @classmethod
    @lru_cache(maxsize=4096)
    def of(cls, name: str) -> Self:
        """Parse a name; any text is accepted."""
        quantity, _, place = name.partition(".")
        unit, _, part = place.partition(".")
        return cls(quantity, unit, part)

    @property
    def place(self) -> str:
        """Unit and part: "tractor.front"."""
        return f"{self.unit}.{self.part}" if self.part else self.unit
