"""Settings of the combination of trips."""

from dataclasses import asdict, dataclass
from typing import Any

from fifthwheel.errors import FifthwheelError


@dataclass(frozen=True, kw_only=True)
class FleetSettings:
    """How trips combine to histories, and when a history shows a change."""

    tyre_walk: float = 0.005
    """Standard deviation by which the cornering stiffness of an axle group drifts in a day, as a fraction; in n days it
    drifts by sqrt(n) times as much. The default is 10 % in a year, as by wear."""
    false_alarms: float = 0.05
    """Probability that a change is reported in a fleet without any change, at most; the tests of all trips share it."""
    height_limit: float | None = None
    """Payload height beyond which a trip needs attention, m; None for no limit."""
    wear: float = 0.15
    """Change of a cornering stiffness since its first estimate, as a fraction, from which tyres need attention."""

    def __post_init__(self) -> None:
        if not 0 <= self.tyre_walk < 1:
            raise FifthwheelError(f"tyre_walk: expected a fraction from 0 to below 1, got {self.tyre_walk}")
        if not 0 < self.false_alarms < 1:
            raise FifthwheelError(f"false_alarms: expected a probability between 0 and 1, got {self.false_alarms}")
        if not 0 < self.wear < 1:
            raise FifthwheelError(f"wear: expected a fraction between 0 and 1, got {self.wear}")
        if self.height_limit is not None and not self.height_limit > 0:
            raise FifthwheelError(f"height_limit: expected a height above 0 m, got {self.height_limit}")

    def as_dict(self) -> dict[str, Any]:
        """All fields by name."""
        return asdict(self)
