"""The measures: title, unit, source and thresholds of each.

The thresholds are those of the Australian performance-based standards, whose levels 1 to 4 are classes of roads, and
the European turning circle; `EDITIONS` has their sources. A measure has thresholds only if it is defined closely enough
to that of the scheme.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from fifthwheel.base.names import split_kind
from fifthwheel.truck.spoken_names import named_axle, named_unit

Sense = Literal["at least", "at most"]
SCHEME, EUROPE = "Australian PBS", "96/53/EC"
"""Names of the schemes of the thresholds."""
EDITIONS: Mapping[str, str] = {
    SCHEME: "National Transport Commission, Performance-Based Standards Scheme, The Standards and Vehicle Assessment"
    " Rules, 10 November 2008",
    EUROPE: "Council Directive 96/53/EC of 25 July 1996, annex I, 1.5",
}
"""Source of the thresholds of each scheme, with its edition."""


@dataclass(frozen=True, kw_only=True)
class Limit:
    """A threshold of a measure: a number, or a multiple of another measure."""

    level: str
    """Level of the scheme, "1" to "4"; "all" for all levels."""
    sense: Sense
    value: float
    times: str | None = None
    """Measure that `value` multiplies; None: `value` is the threshold, SI."""
    scheme: str = SCHEME
    confirmed: bool = True
    """Whether the text of the source, or a second source, was read for this number."""

    def threshold(self, values: Mapping[str, float]) -> float:
        """The threshold, SI, for measures by name."""
        return self.value if self.times is None else self.value * values[self.times]


@dataclass(frozen=True)
class Measure:
    """The definition of a measure."""

    title: str
    unit: str
    """SI unit, "1" for a ratio, "g" for an acceleration as a fraction of gravity."""
    source: str
    limits: tuple[Limit, ...] = ()


def _levels(sense: Sense, *values: float, unconfirmed: Collection[int] = ()) -> tuple[Limit, ...]:
    """Limits of levels 1 to 4, of which some levels are not confirmed."""
    levels = enumerate(values, 1)
    return tuple(Limit(level=str(k), sense=sense, value=v, confirmed=k not in unconfirmed) for k, v in levels)


def _one(sense: Sense, value: float, **fields: Any) -> tuple[Limit, ...]:
    return (Limit(level="all", sense=sense, value=value, **fields),)


ALL = range(1, 5)

ROLLOVER = "rollover_threshold"
"""Rollover threshold of the truck."""
REAR = "rollover_threshold_rear"
"""Rollover threshold of the rearmost roll-coupled set of units, which the limit of rearward amplification follows."""
EFFECTIVE_TRACK = "rollover_threshold_effective_track"
"""Rollover threshold of the truck with tyres that yield sideways."""
STABILITY_FACTOR = "static_stability_factor"
"""Rollover threshold of a rigid truck."""
DYNAMIC = "rollover_threshold_dynamic"
"""Rollover threshold in a lane change."""
STRAIGHT, TRACKING = "straight_path_width", "tracking_ability"
"""Width swept on a straight road with a crossfall, without and with roughness."""
STOP = "stop_width"
"""Width swept in a stop on that road without roughness."""

MEASURES: Mapping[str, Measure] = {
    ROLLOVER: Measure("static rollover threshold", "g", "Winkler (2000)", _one("at least", 0.35)),
    EFFECTIVE_TRACK: Measure("static rollover threshold, effective track", "g", "ISO 22135:2023"),
    STABILITY_FACTOR: Measure("static stability factor", "g", "Winkler (2000)"),
    DYNAMIC: Measure("dynamic rollover threshold, lane change", "g", "Ervin and Guy (1986)"),
    "wheel_lift": Measure("wheel lift", "g", "Winkler (2000)"),
    "rearward_amplification_set": Measure(
        "rearward amplification, rearmost roll-coupled units", "1", "NTC (2008)", _one("at most", 5.7, times=REAR)
    ),
    "rearward_amplification": Measure("rearward amplification, lane change", "1", "ISO 14791"),
    "rearward_amplification_peak": Measure("rearward amplification, frequency response", "1", "ISO 14791"),
    "transient_off_tracking": Measure(
        "high-speed transient off-tracking", "m", "ISO 14791", _levels("at most", 0.6, 0.8, 1.0, 1.2)
    ),
    "load_transfer_ratio": Measure("load transfer ratio, lane change", "1", "Ervin and Guy (1986)"),
    "yaw_damping": Measure("yaw damping, eigenvalues", "1", "ISO 14791", _one("at least", 0.15)),
    "yaw_damping_pulse": Measure("yaw damping, pulse", "1", "ISO 14791", _one("at least", 0.15)),
    "zero_damping_speed": Measure("zero-damping speed", "m/s", "ISO 14791"),
    "understeer_gradient": Measure("understeer gradient", "rad s^2/m", "ISO 14792"),
    "steady_off_tracking": Measure("high-speed steady off-tracking", "m", "Ervin and Guy (1986)"),
    STRAIGHT: Measure("swept width on a crossfall", "m", "NTC (2008), without roughness"),
    TRACKING: Measure(
        "tracking ability on a straight path",
        "m",
        "NTC (2008)",
        _levels("at most", 2.9, 3.0, 3.1, 3.3, unconfirmed=ALL),
    ),
    STOP: Measure("swept width in a stop", "m", "conditions of our own"),
    "swept_path": Measure(
        "low-speed swept path", "m", "NTC (2008)", _levels("at most", 7.4, 8.7, 10.6, 13.7, unconfirmed=[3])
    ),
    "frontal_swing": Measure("frontal swing", "m", "NTC (2008)", _one("at most", 0.70, confirmed=False)),
    "frontal_swing_difference": Measure(
        "frontal swing of a semitrailer, largest difference", "m", "NTC (2008)", _one("at most", 0.40, confirmed=False)
    ),
    "frontal_swing_maxima": Measure(
        "frontal swing of a semitrailer, difference of maxima",
        "m",
        "NTC (2008)",
        _one("at most", 0.20, confirmed=False),
    ),
    "tail_swing": Measure("tail swing", "m", "NTC (2008)", _levels("at most", 0.30, 0.35, 0.35, 0.50)),
    "friction_demand": Measure("steer tyre friction demand", "1", "NTC (2008)", _one("at most", 0.8)),
    "turning_circle": Measure(
        "European turning circle, inner radius", "m", "96/53/EC", _one("at least", 5.3, scheme=EUROPE)
    ),
    "startability": Measure(
        "startability", "1", "NTC (2008)", _levels("at least", 0.15, 0.12, 0.10, 0.05, unconfirmed=ALL)
    ),
    "gradeability": Measure(
        "gradeability", "1", "NTC (2008)", _levels("at least", 0.20, 0.15, 0.12, 0.08, unconfirmed=ALL)
    ),
    "grade_speed": Measure(
        "speed on a grade of 1 %",
        "m/s",
        "NTC (2008)",
        _levels("at least", 80 / 3.6, 70 / 3.6, 70 / 3.6, 60 / 3.6, unconfirmed=ALL),
    ),
    "acceleration_time": Measure(
        "time for 100 m from rest", "s", "NTC (2008)", _levels("at most", 20.0, 23.0, 26.0, 29.0, unconfirmed=ALL)
    ),
    "braking_efficiency": Measure("braking efficiency at 0.4 g", "1", "Ervin and Guy (1986)"),
}
"""Measures by name; "wheel_lift" stands for "wheel_lift.<axle group>", and "rollover_threshold" also for
"rollover_threshold.<units>" of each roll-coupled set of units, such as "rollover_threshold.dolly+trailer"."""


def definition(name: str) -> Measure:
    """The definition of a measure by its full name."""
    return MEASURES[split_kind(name)[0]]


def title(name: str) -> str:
    """The title of a measure by its full name: "wheel lift, drive axle"."""
    kind, part = split_kind(name)
    words = named_axle(part) if kind == "wheel_lift" else " + ".join(map(named_unit, part.split("+")))
    return f"{definition(name).title}, {words}" if part else definition(name).title
