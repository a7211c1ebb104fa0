"""Units of columns without one, by the physics between the channels: the likeliest of all units together.

In a turn the size of each signal follows from the yaw rate and the speed (`checks.kinematics`), apart from factors of
the truck that are uncertain, such as how far it rolls. Rates, angles and accelerations of one log mostly have one unit.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from fifthwheel.base.formatting import enumerated
from fifthwheel.base.units import factor
from fifthwheel.data.channels import ROLL, ROLL_RATE, STEER, YAW_RATE, SignalName, is_of, limit_of, si_unit
from fifthwheel.data.checks.findings import Fault, Finding, warning
from fifthwheel.data.checks.kinematics import Relation, relations
from fifthwheel.data.checks.plausibility import MIN_SPEED
from fifthwheel.data.record.record import Record

_UNITS = {"m/s": ("m/s", "km/h", "mph"), "rad/s": ("rad/s", "deg/s"), "rad": ("rad", "deg"), "m/s^2": ("m/s^2", "g")}
"""By SI unit, what a log without units may have."""
_UNUSUAL = {"mph": 3.0, "g": 0.5, "km/h": 0.5}
"""Minus the logarithm of how usual a unit is."""
_NOT_STATED = 8.0
"""The same of a unit that is not the one that the log states."""
_STYLE = 2.0
"""Of each column whose unit is not that of other columns of the same quantity, or of degrees with radians."""
TYPICAL_STEERING_RATIO = 19.0
"""Of heavy trucks; 15 to 25 are common."""
RATIO_SIGMA = 0.2
"""Standard deviation of its logarithm."""
_WHEEL, _WHEEL_IN_RAD = 4.0, 1.5
"""Costs of a steering wheel that is not the one of the name, and of one in rad."""
_SPREAD = {"roll_rate": 0.25, "roll": 0.25, "yaw_rate": 0.3, "lateral_acceleration": 0.3}
"""Standard deviation of the logarithm of the ratio of a signal to the expected one; of others:"""
_OTHER_SPREAD = 0.4
_ROLL = 0.9
"""The same of how far bodies roll, which all rolls share."""
_USUAL_SPEED, _SPEED = 18.0, 0.5
"""m/s; and standard deviation of its logarithm, of the median speed."""
_USUAL_TURN, _TURN, _STRAIGHT = 0.7, 1.2, 4.0
"""m/s^2; the same of the standard deviation of the lateral acceleration, if it is larger and if it is smaller."""
_UNSEEN = 1.5
"""Cost of a signal that is not compared with others, because the vehicle would be too slow."""
_IMPOSSIBLE = 15.0
"""Cost of a value beyond what a truck can do."""
CLOSE = 3.0
"""Margin below which the user is asked: odds of 20 to 1."""


@dataclass(frozen=True, kw_only=True)
class ColumnReading:
    """One way to read a column."""

    unit: str
    scale: float
    """SI value of a column value of one."""
    wheel: bool = False
    """Whether it is the steering-wheel angle."""
    cost: float = 0.0
    """Minus the logarithm of its prior probability."""

    @property
    def words(self) -> str:
        return f"{self.unit}{' at the steering wheel' * self.wheel}"


@dataclass(frozen=True, kw_only=True)
class LikelyUnits:
    """The likeliest reading of every column, and what else explains the log."""

    readings: Mapping[str, ColumnReading]
    """By signal."""
    gains: Mapping[str, tuple[float, float]]
    """By signal: its size over that expected, with this reading, and the standard deviation of the logarithm by its
    lag."""
    findings: tuple[Finding, ...]
    """A caution on each that another reading explains nearly as well."""


def readings(signal: str, stated: str | None, wheel: bool | None) -> tuple[ColumnReading, ...]:
    """The ways to read a column; `wheel`: whether its name is that of a steering wheel (True) or of a road wheel."""
    si = si_unit(signal) or "1"
    units = {stated or si: factor(stated or si, si)}
    for unit in _UNITS.get(si, ()) if stated is None or signal != "speed" else ():
        if all(abs(factor(unit, si) / known - 1) > 1e-6 for known in units.values()):
            units[unit] = factor(unit, si)
    found = []
    for (unit, scale), of_wheel in product(units.items(), (False, True) if is_of(signal, STEER) else (False,)):
        cost = _UNUSUAL.get(unit, 0.0) if stated is None else _NOT_STATED * (unit != stated)
        cost += _WHEEL * (wheel is not None and of_wheel != wheel) + _WHEEL_IN_RAD * (of_wheel and unit == "rad")
        found.append(ColumnReading(unit=unit, scale=scale, wheel=of_wheel, cost=cost))
    return tuple(found)


def likely_units(
    record: Record, options: Mapping[str, tuple[ColumnReading, ...]], stated: Mapping[str, bool], wheelbase: float
) -> LikelyUnits:
    """The likeliest readings of the signals of a record, each with samples, whose columns are read by the first of
    their options.

    `stated`: whether the log has a unit for the signal; only then is a close alternative no question.
    """
    search = _Search(record, options, stated, wheelbase)
    best = min(search.costs, key=lambda chosen: search.costs[chosen])
    chosen = dict(zip(options, (options[n][k] for n, k in zip(options, best, strict=True)), strict=True))
    gains = {r.signal: (float(np.exp(off)), r.gain_sigma) for r, off in search.deviations(chosen)}
    close: dict[tuple[ColumnReading, ColumnReading], list[str]] = {}
    for place, name in enumerate(options):
        taken = chosen[name]
        rivals = {
            (of := options[name][numbers[place]]): cost
            for numbers, cost in sorted(search.costs.items(), key=lambda item: -item[1])
            if (of := options[name][numbers[place]]).wheel != taken.wheel
            or (of.scale != taken.scale and not stated[name])
        }
        other = min(rivals, key=lambda reading: rivals[reading], default=None)
        if other is not None and rivals[other] - search.costs[best] < CLOSE:
            close.setdefault((taken, other), []).append(name)
    findings = tuple(_question(record, names, options, *pair) for pair, names in close.items())
    return LikelyUnits(readings=chosen, gains=gains, findings=findings)


def _question(
    record: Record,
    names: list[str],
    options: Mapping[str, tuple[ColumnReading, ...]],
    taken: ColumnReading,
    other: ColumnReading,
) -> Finding:
    """The caution on signals that another reading explains nearly as well."""
    first, *others = names
    size = float(np.nanquantile(np.abs(record.signals[first]), 0.99)) / options[first][0].scale
    si = si_unit(first) or ""
    largest = [f"{size * reading.scale:.2g} {si}" for reading in (taken, other)]
    also = f", like that of {enumerated(others)}" if others else ""
    problem = (
        f"its unit is not clear{also}: {taken.words} is assumed, {other.words} explains the other signals nearly as "
        f"well; it reaches {largest[0]} in the first and {largest[1]} in the second; set what the data sheet of the "
        "sensor or the log of a known turn shows in signals.toml"
    )
    return warning(first, Fault.UNIT, problem, others=tuple(others))


class _Search:
    """The costs of combinations of readings: from the usual ones, each change that makes a combination likelier."""

    def __init__(
        self,
        record: Record,
        options: Mapping[str, tuple[ColumnReading, ...]],
        stated: Mapping[str, bool],
        wheelbase: float,
    ) -> None:
        self.options, self.names = options, tuple(options)
        self.costs: dict[tuple[int, ...], float] = {}
        """Minus the logarithm of the posterior, by the numbers of the readings."""
        self._stated = stated
        self._largest = {name: float(np.nanquantile(np.abs(record.signals[name]), 0.99)) for name in options}
        self._relations: dict[float, list[Relation]] = {}
        speeds = options.get("speed", ())
        self._speed = float(np.nanmedian(record.signals["speed"])) if speeds else 0.0
        for reading in speeds:
            scaled = record.with_signals({"speed": record.signals["speed"] * (reading.scale / speeds[0].scale)})
            every = relations(scaled, wheelbase=wheelbase, min_speed=MIN_SPEED)
            self._relations[reading.scale] = [r for r in every if r.signal in options]
        self._turns = {name: float(np.nanstd(record.signals[name])) for name in options if is_of(name, YAW_RATE)}
        for start in self._starts():
            self._descend(start)

    def _starts(self) -> Iterator[tuple[int, ...]]:
        """All unstated columns of an SI unit with one unit each, and the stated ones as stated."""
        free = {name: len(options) for name, options in self.options.items() if not self._stated[name]}
        groups = dict.fromkeys(si_unit(name) for name in free)
        most = {si: max(n for name, n in free.items() if si_unit(name) == si) for si in groups}
        for numbers in product(*(range(n) for n in most.values())):
            by_si = dict(zip(most, numbers, strict=True))
            yield tuple(min(by_si[si_unit(name)], free[name] - 1) if name in free else 0 for name in self.names)

    def _descend(self, at: tuple[int, ...]) -> None:
        while True:
            moves = (
                (*at[:k], number, *at[k + 1 :])
                for k, name in enumerate(self.names)
                for number in range(len(self.options[name]))
            )
            best = min((at, *moves), key=self._cost)
            if best == at:
                return
            at = best

    def _cost(self, at: tuple[int, ...]) -> float:
        if at not in self.costs:
            chosen = {name: self.options[name][k] for name, k in zip(self.names, at, strict=True)}
            self.costs[at] = self._prior(chosen) + self._misfit(chosen)
        return self.costs[at]

    def _prior(self, chosen: Mapping[str, ColumnReading]) -> float:
        cost = sum(reading.cost for reading in chosen.values())
        for name, reading in chosen.items():
            limit, scale = limit_of(name), reading.scale / self.options[name][0].scale
            ratio = TYPICAL_STEERING_RATIO if reading.wheel else 1.0
            if limit is not None and self._largest[name] * scale > limit.magnitude * ratio:
                cost += _IMPOSSIBLE
        angular = [
            reading.unit.startswith("rad") for name, reading in chosen.items() if si_unit(name) in ("rad", "rad/s")
        ]
        accelerations = [reading.unit == "g" for name, reading in chosen.items() if si_unit(name) == "m/s^2"]
        return cost + _STYLE * sum(min(sum(same), len(same) - sum(same)) for same in (angular, accelerations))

    def deviations(self, chosen: Mapping[str, ColumnReading]) -> list[tuple[Relation, float]]:
        """Relations, with the logarithm of the size of the signal over the expected one."""

        def change(name: str) -> float:
            return float(np.log(chosen[name].scale / self.options[name][0].scale))

        every = self._relations.get(chosen["speed"].scale, []) if "speed" in chosen else []
        return [(r, float(np.log(max(r.gain, 1e-9))) + change(r.signal) - change(r.own or r.leading)) for r in every]

    def _misfit(self, chosen: Mapping[str, ColumnReading]) -> float:
        """Half the square of the deviations over their standard deviations."""
        speed = self._speed * chosen["speed"].scale / self.options["speed"][0].scale if "speed" in chosen else 0.0
        cost = 0.5 * (np.log(speed / _USUAL_SPEED) / _SPEED) ** 2 if speed > 0 else 0.0
        if speed > 0 and self._turns:
            name = next(iter(self._turns))
            turn = speed * self._turns[name] * chosen[name].scale / self.options[name][0].scale
            cost += 0.5 * (np.log(max(turn, 1e-6) / _USUAL_TURN) / (_TURN if turn > _USUAL_TURN else _STRAIGHT)) ** 2
        found = self.deviations(chosen)
        cost += _UNSEEN * (max(map(len, self._relations.values()), default=0) - len(found))
        if not found:
            return float(cost)
        off = np.array([x for _, x in found])
        sigma = np.array([_SPREAD.get(SignalName.of(r.signal).quantity, _OTHER_SPREAD) for r, _ in found])
        for k, (r, _) in enumerate(found):
            if chosen[r.signal].wheel:
                off[k] -= np.log(TYPICAL_STEERING_RATIO)
                sigma[k] = np.hypot(sigma[k], RATIO_SIGMA)
            sigma[k] = np.hypot(sigma[k], np.log(max(abs(r.correlation), 0.02)))
        rolls = np.array([is_of(r.signal, ROLL, ROLL_RATE) for r, _ in found], dtype=float)
        covariance = np.diag(sigma**2) + _ROLL**2 * np.outer(rolls, rolls)
        return float(cost + 0.5 * off @ np.linalg.solve(covariance, off))
