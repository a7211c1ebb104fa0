"""How states are observed: every limit and every noise, with what it means."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from fifthwheel.errors import SignalError


@dataclass(frozen=True, kw_only=True)
class ObserverSettings:
    """How states are observed."""

    min_speed: float = 5.0
    """Below this the linear tyre model does not hold, m/s: the states are NaN and the status is TOO_SLOW."""
    hold: float = 0.5
    """A missing speed or steer angle keeps its last value for so long, s; then the status is INPUT_MISSING."""
    coast: float = 1.0
    """Without an accepted measurement for so long, s, the status is COASTING."""
    max_gap: float = 1.0
    """After a longer gap in time, s, the filter starts anew."""
    gate: float = 6.0
    """Innovations beyond so many standard deviations are not used."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """Variance of a signal's noise, SI squared; the article's R where not given."""
    process_noise: float = 1.0
    """Process noise, in units of the default (`observe.noise.OBSERVED`, the article's equation (14))."""
    bank: float | None = None
    """How far a road leans sideways, rad, one standard deviation: the bank is then a state that is found with the
    others, "bank.road". None takes every road as level."""
    zeros: Mapping[str, float] = field(default_factory=dict)
    """Zeros, gains and delays of sensors by name, such as "steer.tractor.front.offset"; none by default. A delay of the
    steer angle is taken out by its slope, which makes its noise louder: a smooth channel is worth having."""
    places: Mapping[str, float] = field(default_factory=dict)
    """Where a unit's sideslip is told, x on the unit in m, by name, such as "sideslip.semitrailer": -2.34 for a sensor
    at the landing leg; under the CoG by default."""

    def __post_init__(self) -> None:
        for name in ("min_speed", "coast", "max_gap", "gate"):
            if not getattr(self, name) > 0:
                raise SignalError(f"{name}: expected above 0, got {getattr(self, name)}")
        for name in ("hold", "process_noise"):
            if not getattr(self, name) >= 0:
                raise SignalError(f"{name}: expected 0 or more, got {getattr(self, name)}")
        if self.bank is not None and not 0 < self.bank < 1:
            raise SignalError(f"bank: expected between 0 and 1 rad, got {self.bank}; is it in degrees?")
        for name, variance in self.noise.items():
            if not 0 < variance < math.inf:
                raise SignalError(f"{name}: expected a variance above 0, got {variance}")
