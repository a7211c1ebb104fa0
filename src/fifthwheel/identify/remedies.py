"""What would help: changes to what is known, driven or logged, and the sigma that each would bring, reckoned."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fifthwheel.identify.forecast import Forecast, Foreseen, Told
from fifthwheel.identify.stage import Log
from fifthwheel.logs import Record
from fifthwheel.simulate import LaneChange, steer_for

AGAIN, LANE_CHANGE = "again", "lane_change"


@dataclass(frozen=True, kw_only=True)
class Remedy:
    """One change, or two together; and what a parameter's sigma would become."""

    known: tuple[str, ...] = ()
    """Parameters, or sensors' zeros, gains and delays, that would be known."""
    drive: str | None = None
    """`AGAIN`: the same drives once more; `LANE_CHANGE`: one SAE J2179 lane change besides."""
    channel: str | None = None
    """A signal that would be logged."""
    sigma: float = float("nan")
    """SI."""

    @property
    def kind(self) -> str:
        """What is to be done: know, log or drive something."""
        return "know" if self.known else "log" if self.channel else "drive"


class Remedies:
    """All changes that can be reckoned for some drives.

    Args:
        forecast: of the truck.
        drives: what they tell.
        extra: what one lane change with the same channels tells.
        measurable: whether only that counts as knowable which the fit does not seek.
    """

    def __init__(self, forecast: Forecast, drives: Sequence[Told], extra: Told, *, measurable: bool = False) -> None:
        self.forecast, self.drives = forecast, drives
        self.knowable = [u.name for u in forecast.unknowns if not (measurable and u.name in forecast.sought)]
        logged = {name for drive in drives for name in drive.logged}
        missing = [name for name in forecast.channels if name not in logged]
        more = [*drives, extra]
        self.single = [
            (Remedy(drive=AGAIN), forecast.fit([*drives, *drives])),
            (Remedy(drive=LANE_CHANGE), forecast.fit(more)),
            *self._known(()),
            *[(Remedy(channel=name), forecast.fit(drives, added=[name])) for name in missing],
        ]
        self.double = [(Remedy(drive=LANE_CHANGE, channel=name), forecast.fit(more, added=[name])) for name in missing]

    def best(self, name: str, sigma: float, *, enough: float, worth: float, most: int) -> tuple[Remedy, ...]:
        """The changes that bring a parameter's sigma down by the part `worth` or more, the best of each kind.

        Two changes together only where no single one does, and two unknowns to be known where one alone does not
        bring what is enough.

        Args:
            sigma: that the drives tell it to, as they are, SI.
            enough: sigma that is wanted, SI.
            most: at most so many changes.
        """
        found = self._best(self.single, name, (1 - worth) * sigma) or self._best(self.double, name, (1 - worth) * sigma)
        for remedy in [one for one in found if one.kind == "know" and one.sigma > enough and len(found) < most]:
            found += self._best(self._known(remedy.known), name, (1 - worth) * remedy.sigma)
        return tuple(sorted(found, key=lambda remedy: (len(remedy.known), remedy.sigma))[:most])

    def _known(self, besides: tuple[str, ...]) -> list[tuple[Remedy, Foreseen]]:
        """What each unknown would bring if it were known, besides those that are."""
        sets = [(*besides, name) for name in self.knowable if name not in besides]
        return [(Remedy(known=names), self.forecast.fit(self.drives, known=names)) for names in sets]

    def _best(self, changes: Sequence[tuple[Remedy, Foreseen]], name: str, limit: float) -> list[Remedy]:
        """Of each kind the change that brings most, if it brings the sigma down to the limit."""
        prior, found = self.forecast.prior(name), dict[str, Remedy]()
        reckoned = [
            replace(change, sigma=then.sigma(name) * prior) for change, then in changes if name not in change.known
        ]
        for remedy in sorted(reckoned, key=lambda remedy: remedy.sigma):
            if remedy.sigma <= limit:
                found.setdefault(remedy.kind, remedy)
        return list(found.values())


def lane_change(
    forecast: Forecast, *, speed: float, rate: float, channels: Sequence[str], noise: Mapping[str, float]
) -> Told:
    """What one SAE J2179 lane change tells.

    Args:
        speed: m/s.
        rate: samples a second, Hz.
        channels: that are logged.
        noise: variance of their noise, SI squared.
    """
    lane = LaneChange()
    time = np.arange(round(lane.period(speed) * rate)) / rate
    steer = steer_for(forecast.steadied, speed, time, lane.acceleration(time, speed, 1))
    first, *others = forecast.vehicle.steer_signals()
    signals = {"speed": np.full_like(time, speed), first: steer, **{name: np.zeros_like(time) for name in others}}
    record = Record(time=time, signals=signals, name="one more lane change")
    return forecast.drive(Log(name=record.name, sections=[record], noise=dict(noise)), channels)
