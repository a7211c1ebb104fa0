"""Static loads of a tractor-semitrailer in several conditions, and the masses and CoG positions that they determine.

A slip file has the static loads of the axle groups of a tractor-semitrailer, as masses, in up to three conditions: the
laden combination, the tractor alone (solo), and the empty combination; docs/howto/measure.md has an example.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any, Self

from fifthwheel.base.errors import FifthwheelError, VehicleError, suggestion
from fifthwheel.base.input_files import parse_toml, read_toml
from fifthwheel.base.spelling import setting
from fifthwheel.base.units import quantity
from fifthwheel.truck.quantities import quantity_of
from fifthwheel.truck.weighing import COUPLING_RANGE, EXCHANGED, MAX_SOLO

Number = tuple[float, float | None]
"""Value and standard deviation, SI; None where nothing is stated on it."""
CONDITIONS = ("laden", "solo", "empty")
ACCURACY = 0.01
"""Standard deviation of a load, as a fraction: axle by axle, with the slope of the ground and the friction of the
suspension; a weighbridge that carries the whole vehicle at once has 0.1 %."""
LOADS = (500.0, 40e3)
"""Least and largest load of an axle group, kg: the drive axle of a light tractor has 1.4 t, heavy tridems 36 t."""
CONTRADICTION = 4.0
"""Largest difference of a measured and a predicted load, in standard deviations."""
MIN_DIFFERENCE = 0.1
"""Of front and drive loads that may have been exchanged, as a fraction of their sum; others fit both ways."""


@dataclass(frozen=True, kw_only=True)
class Slip:
    """Static loads of the axle groups, kg, by their paths."""

    laden: Mapping[str, float] = field(default_factory=dict)
    solo: Mapping[str, float] = field(default_factory=dict)
    empty: Mapping[str, float] = field(default_factory=dict)
    accuracy: float = ACCURACY
    """Standard deviation of each load, as a fraction."""
    step: float = 0.0
    """The same in kg, in addition."""

    def __post_init__(self) -> None:
        if not 0 <= self.accuracy < 0.5:
            raise VehicleError(f"accuracy: expected a fraction from 0 to 0.5, got {self.accuracy:g}; such as 1 %")
        if not 0 <= self.step < LOADS[0]:
            raise VehicleError(f"accuracy: expected 0 to {LOADS[0]:g} kg, got {self.step:g} kg; correct it")
        for condition in CONDITIONS:
            for path, load in getattr(self, condition).items():
                if not LOADS[0] <= load <= LOADS[1]:
                    raise VehicleError(
                        f"{condition}.{path}: expected a load of {LOADS[0]:g} to {LOADS[1]:g} kg, got {load:g} kg;"
                        " correct it"
                    )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a slip file.

        A VehicleError if the file is not readable or not TOML, or has another key or a load that is no mass.
        """
        try:
            table = parse_toml(read_toml(Path(path)))
            accuracy, step = accuracy_of(table.pop("accuracy", ACCURACY))
            for key in table:
                if key not in CONDITIONS:
                    raise VehicleError(f"{key}: no such key; {suggestion(key, ('accuracy', *CONDITIONS))}")
            loads = {key: dict(_loads(value, key)) for key, value in table.items()}
            return cls(accuracy=accuracy, step=step, **loads)
        except FifthwheelError as error:
            raise VehicleError(f"{path}: {error}") from None

    def sigma(self, load: float) -> float:
        """Standard deviation of a load, kg."""
        return math.hypot(self.accuracy * load, self.step)


def accuracy_of(value: object) -> tuple[float, float]:
    """Accuracy and step of a `Slip` from a fraction such as 0.01 or "1 %", or a mass such as "20 kg"."""
    text = str(value).strip().removeprefix("+-").strip()
    try:
        number = float(text.removesuffix("%"))
        return number / (100 if text.endswith("%") else 1), 0.0
    except ValueError:
        pass
    try:
        return 0.0, quantity(text, "kg")
    except FifthwheelError:
        raise VehicleError(f"accuracy: expected '1 %' or '20 kg', got {value!r}; correct it") from None


def _loads(value: Any, condition: str, *keys: str) -> Iterator[tuple[str, float]]:
    """Loads in nested tables by their paths, without the name of the condition."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _loads(inner, condition, *keys, key)
        return
    try:
        yield ".".join(keys), quantity(value, "kg")
    except FifthwheelError as error:
        raise VehicleError(f"{'.'.join((condition, *keys))}: {error}; give the load as a mass") from None


@dataclass(frozen=True, kw_only=True)
class Lengths:
    """What the loads act on, m, each positive to the rear."""

    wheelbase: float
    """From the tractor's first axle to the middle of its other axles."""
    coupling: Number | None
    """From the tractor's first axle to the kingpin; None if it is not known, then the slips determine it."""
    trailer: Number
    """From the kingpin to the middle of the trailer's axles."""


def weigh(lengths: Lengths, slip: Slip, groups: tuple[str, str, str], tares: Mapping[str, Number]) -> dict[str, Number]:
    """Masses and CoG positions, from moments of the loads; Cheng and Cebon (2011), section 2.2.

    The groups are the paths of the tractor's two axle groups and of the trailer. The tares are "tractor.mass", kg, and
    "tractor.cog", m behind the first axle, where there is no solo slip, and "trailer.mass" without load, kg, where
    there is no empty slip. Without a solo slip, the laden loads inform the tractor's CoG too if the kingpin is known.
    The result has "tractor.mass", "tractor.cog", "trailer.mass", "trailer.cog", "payload.mass" and "coupling", with
    standard deviations; distances are behind the first axle and the kingpin. What does not follow is absent. A
    VehicleError if a load is missing or unknown, or the loads contradict each other.
    """
    _check_slip(slip, groups)
    _check_order(lengths, slip, groups, tares)
    inputs = _inputs(slip, groups)
    if lengths.coupling is not None:
        x, sigma = lengths.coupling
        inputs["coupling"] = x, quantity_of("coupling").sigma * lengths.wheelbase if sigma is None else sigma
    x, sigma = lengths.trailer
    inputs["trailer"] = x, quantity_of("axle_positions").sigma if sigma is None else sigma
    if not slip.solo:
        inputs |= {key: tares[key] for key in ("tractor.mass", "tractor.cog")}
    if not slip.empty and "trailer.mass" in tares:
        inputs["unladen"] = tares["trailer.mass"]
    if lengths.coupling is None and not slip.solo:
        raise VehicleError(
            "solo: expected the loads of the tractor alone, because the position of the fifth wheel is not known; give"
            f" them ({setting('solo')}), or the distance from the front axle to the kingpin ({setting('fifth_wheel')})"
        )
    results = propagate(lambda values: _solve(values, lengths), inputs)
    if results["hitch"][0] <= 0:
        raise VehicleError(
            f"laden: expected more on {groups[0]} and {groups[1]} than the tractor's {results['tractor.mass'][0]:.0f}"
            " kg; check the slip, or the tractor's mass"
        )
    difference, sigma = results.pop("front")
    if abs(difference) > CONTRADICTION * (sigma or 0.0) + 1e-6 * results["hitch"][0]:
        where = _kingpin({key: value for key, (value, _) in inputs.items()}, lengths)["kingpin"]
        raise VehicleError(
            f"laden: expected a kingpin {inputs['coupling'][0]:.2f} m behind the front axle, got {where:.2f} m by the"
            f" loads ({groups[0]} differs by {difference:+.0f} kg with a sigma of {sigma:.0f} kg); measure the position"
            " of the fifth wheel, or weigh again on level ground with released brakes"
        )
    if not slip.solo:
        results["tractor.cog"] = joined(results["tractor.cog"], results["cog by moments"])
    return {key: number for key, number in results.items() if key not in ("hitch", "cog by moments")}


def weigh_solo(lengths: Lengths, slip: Slip, groups: tuple[str, str, str]) -> dict[str, Number]:
    """The results "tractor.mass" and "tractor.cog" of `weigh`, from the loads of the tractor alone.

    A VehicleError if a load is missing or unknown, or front and drive loads seem exchanged.
    """
    _check_slip(slip, groups, "solo")
    _check_order(lengths, slip, groups, {})
    return propagate(lambda values: _tractor(values, lengths), _inputs(slip, groups))


def _inputs(slip: Slip, groups: tuple[str, str, str]) -> dict[str, Number]:
    """Every load of a slip with its standard deviation, kg, by condition and number of the group."""
    return {
        f"{condition}.{groups.index(path)}": (load, slip.sigma(load))
        for condition in CONDITIONS
        for path, load in getattr(slip, condition).items()
    }


def joined(one: Number, other: Number) -> Number:
    """The mean of two independent numbers, weighted by their information; an exact one is kept."""
    if not one[1] or not other[1]:
        return other if one[1] else one
    weight = one[1] ** 2 / (one[1] ** 2 + other[1] ** 2)
    return one[0] + weight * (other[0] - one[0]), math.hypot(weight * other[1], (1 - weight) * one[1])


def contradict(one: Number, other: Number) -> bool:
    """Whether two independent numbers differ by more than their standard deviations explain."""
    scale = 1e-4 * abs(one[0])  # of exact numbers, which are rounded
    return abs(one[0] - other[0]) > CONTRADICTION * math.hypot(one[1] or 0.0, other[1] or 0.0) + scale


def _check_order(lengths: Lengths, slip: Slip, groups: tuple[str, str, str], tares: Mapping[str, Number]) -> None:
    """Refuse a slip that contradicts the statics of the tractor, and does not with exchanged front and drive loads."""
    front, drive, _ = groups
    stated = _statics(lengths, slip, groups, tares)
    wrong = [condition for condition, (_, fits) in stated.items() if not fits]
    different = {
        condition
        for condition, loads in ((condition, getattr(slip, condition)) for condition in stated)
        if abs(loads[front] - loads[drive]) > MIN_DIFFERENCE * (loads[front] + loads[drive])
    }
    for count in range(1, len(stated) + 1) if wrong else ():
        for conditions in combinations(stated, count):
            if not different & {*conditions}:
                continue
            other = _statics(lengths, _exchanged(slip, conditions, groups), groups, tares)
            if all(fits for _, fits in other.values()):
                loads = getattr(slip, conditions[0])
                one = f"write {loads[drive]:g} kg for {front} and {loads[front]:g} kg for {drive}"
                cure = one if count == 1 else "exchange them in each"
                as_stated, exchanged = (found[wrong[0]][0] for found in (stated, other))
                raise VehicleError(
                    f"{' and '.join(conditions)}: {EXCHANGED}; {cure}. As stated, {as_stated}; exchanged, {exchanged}"
                )


def _exchanged(slip: Slip, conditions: Iterable[str], groups: tuple[str, str, str]) -> Slip:
    """The slip with exchanged loads of the tractor's groups in some conditions."""
    front, drive, _ = groups
    for condition in conditions:
        given = getattr(slip, condition)
        loads: dict[str, Any] = {condition: {**given, front: given[drive], drive: given[front]}}
        slip = replace(slip, **loads)
    return slip


def _statics(
    lengths: Lengths, slip: Slip, groups: tuple[str, str, str], tares: Mapping[str, Number]
) -> dict[str, tuple[str, bool]]:
    """What the loads of each condition say of the tractor, and whether it is possible."""
    front, drive, _ = groups
    found, weighed = dict[str, tuple[str, bool]](), _inputs(slip, groups)
    inputs = {key: tares[key] for key in ("tractor.mass", "tractor.cog") if key in tares}
    if slip.solo:
        fraction = slip.solo[drive] / (slip.solo[front] + slip.solo[drive])
        text = f"{fraction:.0%} of the tractor's mass are on {drive} (expected: at most {MAX_SOLO:.0%})"
        found["solo"] = text, fraction <= MAX_SOLO
        inputs = {key: weighed[key] for key in ("solo.0", "solo.1")}
    if not inputs:
        return found
    for condition in ("laden", "empty"):
        if getattr(slip, condition):
            of_slip = {f"laden.{k}": weighed[f"{condition}.{k}"] for k in range(3)}
            where, sigma = propagate(lambda values: _kingpin(values, lengths), {**inputs, **of_slip})["kingpin"]
            low, high = (ratio * lengths.wheelbase for ratio in COUPLING_RANGE)
            expected = f"{low:.2f} to {high:.2f} m"
            if lengths.coupling is not None:
                margin = CONTRADICTION * (sigma or 0.0) + 1e-6
                low, high = lengths.coupling[0] - margin, lengths.coupling[0] + margin
                expected = f"{lengths.coupling[0]:.2f} m"
            text = f"the kingpin is {where:.2f} m behind the front axle (expected: {expected})"
            found[condition] = text, low <= where <= high
    return found


def _kingpin(values: Mapping[str, float], lengths: Lengths) -> dict[str, float]:
    """Position of the kingpin behind the front axle by the loads, m; infinite if it carries nothing."""
    return {"kingpin": _solve(values, replace(lengths, coupling=None))["coupling"]}


def propagate(
    function: Callable[[Mapping[str, float]], dict[str, float]], inputs: Mapping[str, Number]
) -> dict[str, Number]:
    """Results of a function, with standard deviations to first order from those of its independent inputs."""
    values = {key: value for key, (value, _) in inputs.items()}
    centre = function(values)
    variance = dict.fromkeys(centre, 0.0)
    for key, (value, sigma) in inputs.items():
        if sigma:
            high, low = (function({**values, key: value + step}) for step in (sigma / 2, -sigma / 2))
            for name in centre:
                variance[name] += (high[name] - low[name]) ** 2
    return {name: (centre[name], math.sqrt(variance[name])) for name in centre}


def _solve(x: Mapping[str, float], lengths: Lengths) -> dict[str, float]:
    """Masses, CoG positions, kingpin load and error of the front load, kg and m, from the loads."""
    result = _tractor(x, lengths) if "solo.0" in x else {key: x[key] for key in ("tractor.mass", "tractor.cog")}
    tractor, cog = result["tractor.mass"], result["tractor.cog"]
    hitch = x["laden.0"] + x["laden.1"] - tractor
    moment = lengths.wheelbase * x["laden.1"] - cog * tractor
    result |= {"hitch": hitch, "front": 0.0}
    if lengths.coupling is None:
        result["coupling"] = moment / hitch if hitch > 0 else math.inf
    else:
        kingpin = x.get("coupling", lengths.coupling[0])
        result["front"] = (kingpin * hitch - moment) / lengths.wheelbase
        result["cog by moments"] = (lengths.wheelbase * x["laden.1"] - kingpin * hitch) / tractor
    trailer = hitch + x["laden.2"]
    result |= {"trailer.mass": trailer, "trailer.cog": x.get("trailer", lengths.trailer[0]) * x["laden.2"] / trailer}
    if "empty.0" in x:
        result["payload.mass"] = trailer - (x["empty.0"] + x["empty.1"] - tractor + x["empty.2"])
    elif "unladen" in x:
        result["payload.mass"] = trailer - x["unladen"]
    return result


def _tractor(x: Mapping[str, float], lengths: Lengths) -> dict[str, float]:
    """Mass, kg, and CoG, m, of the tractor from its solo loads."""
    mass = x["solo.0"] + x["solo.1"]
    return {"tractor.mass": mass, "tractor.cog": lengths.wheelbase * x["solo.1"] / mass}


def _check_slip(slip: Slip, groups: tuple[str, ...], required: str = "laden") -> None:
    for condition, expected in (("laden", groups), ("solo", groups[:2]), ("empty", groups)):
        loads = getattr(slip, condition)
        for path in loads:
            if path not in expected:
                raise VehicleError(f"{condition}.{path}: no such axle load; {suggestion(path, expected)}")
        missing = [path for path in expected if path not in loads]
        if missing and (loads or condition == required):
            raise VehicleError(f"{condition}.{missing[0]}: expected a load, got none; weigh every axle group")
