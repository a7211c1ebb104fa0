"""The lane change of SAE J2179: one period of a sine of lateral acceleration."""

from dataclasses import dataclass

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.model.manoeuvres.courses import STANDARD_SPEED, Path, arc_length_grid, require_positive


@dataclass(frozen=True, kw_only=True)
class LaneChange:
    """Lane changes along one period of a sine of lateral acceleration, to the left and to the right in turn.

    By default the lane change of SAE J2179, which Cheng and Cebon (2011) use in section 3.1: at 88 km/h 0.15 g, 0.4 Hz.
    """

    offset: float = 1.464
    """Lateral offset, m; the first lane change is to the left."""
    length: float = 61.0
    """Length along x, m."""
    rest: float = 5.5
    """Minimum time straight ahead after each lane change, s."""
    min_period: float = 8.0
    """Minimum time from the start of a lane change to the start of the next, s."""
    lead: float = 1.0
    """Time straight ahead before the first lane change, s."""

    def __post_init__(self) -> None:
        require_positive("length", self.length)
        require_positive("rest", self.rest)

    def period(self, speed: float) -> float:
        """Time from the start of a lane change to the start of the next, s."""
        return max(self.min_period, self.length / speed + self.rest)

    def acceleration(self, time: Array, speed: float, count: int) -> Array:
        """Lateral acceleration (N,), m/s^2, of `count` lane changes over time (N,), s.

        The course is taken as parallel to x, so the lane change takes length / speed.
        """
        duration = self.length / speed
        peak = 2 * np.pi * self.offset / duration**2
        result = np.zeros_like(time)
        for k in range(count):
            phase = (time - self.lead - k * self.period(speed)) / duration
            result += np.where((phase >= 0) & (phase < 1), (-1) ** k * peak * np.sin(2 * np.pi * phase), 0.0)
        return result

    def path(self, *, count: int, speed: float, name: str = "lane_changes") -> Path:
        """Path of `count` lane changes at a constant speed, m/s.

        y(x) = offset [x / length - sin(2 pi x / length) / (2 pi)].
        """
        from scipy.integrate import cumulative_simpson  # slow to import
        from scipy.interpolate import CubicSpline

        require_positive("count", count)
        require_positive("speed", speed)
        offset, length = self.offset, self.length
        x = np.linspace(0.0, length, 2001)
        slope = offset / length * (1 - np.cos(2 * np.pi * x / length))
        arc_of_x = cumulative_simpson(np.hypot(1, slope), x=x, initial=0)  # within one lane change, m
        period = max(self.min_period, arc_of_x[-1] / speed + self.rest) * speed  # m of arc
        duration = self.lead + count * period / speed
        arc = arc_length_grid(duration * speed)
        k = np.clip(np.floor((arc - self.lead * speed) / period), 0, count - 1)
        local_arc = np.clip(arc - self.lead * speed - k * period, 0, arc_of_x[-1])
        x = CubicSpline(arc_of_x, x)(local_arc)  # within lane change k
        phase = 2 * np.pi * x / length
        side = np.where(k % 2 == 0, 1.0, -1.0)
        slope = side * offset / length * (1 - np.cos(phase))
        second_derivative = side * offset / length**2 * 2 * np.pi * np.sin(phase)
        return Path(
            arc=arc,
            x=arc - local_arc + x - k * (arc_of_x[-1] - length),
            y=np.where(k % 2 == 0, 0.0, offset) + side * offset * (x / length - np.sin(phase) / (2 * np.pi)),
            heading=np.arctan(slope),
            curvature=second_derivative / (1 + slope**2) ** 1.5,
            speed=np.full_like(arc, speed),
            name=name,
            duration=duration,
        )


def lane_changes(*, count: int = 15, speed: float = STANDARD_SPEED) -> Path:
    """Path of `count` lane changes of SAE J2179, to the left and to the right in turn; speed in m/s."""
    return LaneChange().path(count=count, speed=speed)


def lane_changes_on_test_track(*, count: int = 10, speed: float = 35 / 3.6) -> Path:
    """Path of the test-track lane changes of Cheng and Cebon (2011), section 4: 4 m sideways in 30 m.

    The article does not give the speed. The default is our assumption: 35 km/h, which gives 0.27 g.
    """
    return LaneChange(offset=4.0, length=30.0).path(count=count, speed=speed, name="test_track")
