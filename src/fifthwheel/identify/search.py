"""All drives that a plan chooses from, each with what it would tell."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fifthwheel.errors import SignalError
from fifthwheel.identify.echo import Echo
from fifthwheel.identify.forecast import Forecast
from fifthwheel.identify.information import Verdict
from fifthwheel.identify.manoeuvres import Manoeuvre, candidates, lateral
from fifthwheel.identify.stage import Progress

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Planning:
    """Which drives are tried, and how one is chosen."""

    speeds: tuple[float, ...] = (50 / 3.6, 65 / 3.6, 80 / 3.6, 88 / 3.6)
    """m/s."""
    frequencies: tuple[float, ...] = (0.3, 0.4, 0.5, 0.6)
    """Of lane changes, Hz."""
    accelerations: tuple[float, ...] = (0.5, 1.0, 1.5, 2.0)
    """Largest lateral acceleration of any unit's CoG, m/s^2."""
    max_acceleration: float = 1.5
    """The most of it that is allowed, which is tried too: tyres shall stay linear, and wheels on the road."""
    max_steer_rate: float = 0.3
    """Of the road wheels, rad/s: the steering wheel once round in a second."""
    repetitions: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 10, 12)
    """How often a manoeuvre is driven, to the left and to the right in turn."""
    rate: float = 100.0
    """Samples a second, Hz."""
    near: float = 1.05
    """Where no drive tells enough, the shortest is taken whose worst sigma beside what is wanted is within this factor
    of the least that any drive brings."""
    alternatives: int = 3
    """At most so many other drives, each with another kind of manoeuvre."""

    def __post_init__(self) -> None:
        for name in ("max_acceleration", "max_steer_rate", "rate"):
            if not getattr(self, name) > 0:
                raise SignalError(f"{name}: expected above 0, got {getattr(self, name)}")
        for name in ("speeds", "frequencies", "accelerations", "repetitions"):
            if not getattr(self, name) or not min(getattr(self, name)) > 0:
                raise SignalError(f"{name}: expected one or more, all above 0, got {getattr(self, name)}")
        if not 5 <= min(self.speeds) <= max(self.speeds) <= 40:
            raise SignalError("speed: expected 18 to 144 km/h; the linear model holds at road speeds")

    @property
    def sizes(self) -> tuple[float, ...]:
        """Accelerations to be tried, the limit among them, m/s^2."""
        return (*[a for a in self.accelerations if a < self.max_acceleration], self.max_acceleration)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tried:
    """One drive."""

    manoeuvre: Manoeuvre
    count: int
    size: float  # largest lateral acceleration of the first unit's CoG, m/s^2
    acceleration: float  # of any unit's, m/s^2
    steer: Array = field(repr=False)  # of one manoeuvre of unit size, rad
    sigma: Mapping[str, float]  # of all that is sought, as a part of its value
    verdicts: Mapping[str, Verdict]
    worst: float  # the largest sigma beside the one that is wanted

    @property
    def duration(self) -> float:
        """s."""
        return self.count * self.manoeuvre.period

    @property
    def offset(self) -> float | None:
        """How far a lane change goes sideways, m."""
        frequency = self.manoeuvre.frequency
        return None if frequency is None else self.size / (2 * np.pi * frequency**2)


def search(
    forecast: Forecast,
    speeds: Sequence[float],
    wants: Mapping[str, float],
    noise: Mapping[str, float],
    planning: Planning,
    progress: Progress = lambda *_: None,
) -> Iterator[Tried]:
    """Every drive within the limits.

    Args:
        forecast: of the truck, stable at all speeds.
        speeds: to be tried, m/s.
        wants: sigma by parameter, as a part of its value.
        noise: variance of each channel that will be logged, SI squared.
    """
    drives = [(speed, one) for speed in speeds for one in candidates(speed, planning.frequencies)]
    echoes: dict[float, Echo] = {}
    for i, (speed, manoeuvre) in enumerate(drives):
        progress("plan", i, len(drives))
        if speed not in echoes:
            echoes = {speed: Echo(forecast, speed, rate=planning.rate, noise=noise)}
        yield from _sizes(forecast, echoes[speed], manoeuvre, wants, noise, planning)
    progress("plan", len(drives), len(drives))


def _sizes(
    forecast: Forecast,
    echo: Echo,
    manoeuvre: Manoeuvre,
    wants: Mapping[str, float],
    noise: Mapping[str, float],
    planning: Planning,
) -> Iterator[Tried]:
    """One manoeuvre, as hard and as often as it may be."""
    steer = manoeuvre.steer(forecast.vehicle, planning.rate)
    most = float(np.abs(lateral(forecast.vehicle, manoeuvre.speed, steer, planning.rate)).max())
    fastest = float(np.abs(np.diff(steer)).max() * planning.rate)
    sizes = sorted({min(a / most, planning.max_steer_rate / fastest) for a in planning.sizes})
    shares = echo.of(steer, round(manoeuvre.period * planning.rate), max(planning.repetitions))
    values = forecast.vehicle.parameters()
    for size in sizes:
        for count in planning.repetitions:
            found = forecast.judge(echo.names, shares[count - 1].at(size), noise)
            sigma = {n: found.sigma(n) * forecast.prior(n) / abs(values[n]) for n in forecast.sought}
            yield Tried(
                manoeuvre=manoeuvre,
                count=count,
                size=size,
                acceleration=size * most,
                steer=steer,
                sigma=sigma,
                verdicts={n: found.idle.get(n, Verdict.CONVERGED) for n in forecast.sought},
                worst=max(sigma[name] / part for name, part in wants.items()),
            )
