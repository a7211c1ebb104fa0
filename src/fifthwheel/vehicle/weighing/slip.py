"""Masses and CoG positions of a tractor-semitrailer from the slips of a weighbridge, with their standard deviations.

A slip file has the static loads of the axle groups, as masses, in up to three conditions: the laden combination, the
tractor alone (solo), and the empty combination; docs/howto/weigh.md has an example.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from fifthwheel.errors import FifthwheelError, VehicleError, suggestion
from fifthwheel.input_files import parse_toml, read_toml
from fifthwheel.units import quantity

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


@dataclass(frozen=True, kw_only=True)
class Slip:
    """Static loads of the axle groups, kg, by their paths."""

    laden: Mapping[str, float] = field(default_factory=dict)
    solo: Mapping[str, float] = field(default_factory=dict)
    empty: Mapping[str, float] = field(default_factory=dict)
    accuracy: float = ACCURACY
    """Standard deviation of each load, as a fraction."""

    def __post_init__(self) -> None:
        if not 0 <= self.accuracy < 0.5:
            raise VehicleError(f"accuracy: expected a fraction from 0 to 0.5, got {self.accuracy:g}; such as 1 %")
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

        Raises:
            VehicleError: the file is not readable or not TOML, or has another key or a load that is no mass.
        """
        try:
            table = parse_toml(read_toml(Path(path)))
            accuracy = fraction(table.pop("accuracy", ACCURACY))
            for key in table:
                if key not in CONDITIONS:
                    raise VehicleError(f"{key}: no such key; {suggestion(key, ('accuracy', *CONDITIONS))}")
            return cls(accuracy=accuracy, **{key: dict(_loads(value, key)) for key, value in table.items()})
        except FifthwheelError as error:
            raise VehicleError(f"{path}: {error}") from None


def fraction(value: object) -> float:
    """A fraction such as 0.01 or "1 %"."""
    text = str(value).strip()
    try:
        return float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        raise VehicleError(f"accuracy: expected a fraction such as '1 %', got {value!r}; correct it") from None


def _loads(value: Any, path: str) -> Iterator[tuple[str, float]]:
    """Loads in nested tables by their paths, without the name of the condition."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _loads(inner, f"{path}.{key}")
        return
    try:
        yield path.partition(".")[2], quantity(value, "kg")
    except FifthwheelError as error:
        raise VehicleError(f"{path}: {error}; give the load as a mass") from None


@dataclass(frozen=True, kw_only=True)
class Lengths:
    """What the loads act on, m, each positive to the rear."""

    wheelbase: float
    """From the tractor's first axle to the middle of its other axles."""
    coupling: float | None
    """From the tractor's first axle to the kingpin; None if it is not known, then the slips determine it."""
    trailer: float
    """From the kingpin to the middle of the trailer's axles."""


def weigh(lengths: Lengths, slip: Slip, groups: tuple[str, str, str], tares: Mapping[str, Number]) -> dict[str, Number]:
    """Masses and CoG positions, from moments of the loads; Cheng and Cebon (2011), section 2.2.

    Args:
        lengths: of tractor and trailer.
        slip: laden loads of all groups, and what else there is.
        groups: paths of the tractor's two axle groups and of the trailer.
        tares: "tractor.mass", kg, and "tractor.cog", m behind the first axle, where there is no solo slip;
            "trailer.mass" without load, kg, where there is no empty slip.

    Returns:
        "tractor.mass", "tractor.cog", "trailer.mass", "trailer.cog", "payload.mass" and "coupling", with standard
        deviations; distances are behind the first axle and the kingpin. What does not follow from the slips is absent.

    Raises:
        VehicleError: a load is missing or unknown, or the loads contradict each other.
    """
    _check(slip, groups)
    inputs: dict[str, Number] = {}
    for condition in CONDITIONS:
        for path, load in getattr(slip, condition).items():
            inputs[f"{condition}.{groups.index(path)}"] = (load, slip.accuracy * load)
    if not slip.solo:
        inputs |= {key: tares[key] for key in ("tractor.mass", "tractor.cog")}
    if not slip.empty and "trailer.mass" in tares:
        inputs["unladen"] = tares["trailer.mass"]
    if lengths.coupling is None and not slip.solo:
        raise VehicleError(
            "solo: expected the loads of the tractor alone, because the position of the fifth wheel is not known; give"
            " them (--solo), or the distance from the front axle to the kingpin (--fifth-wheel)"
        )
    results = propagate(lambda values: _solve(values, lengths), inputs)
    if results["hitch"][0] <= 0:
        raise VehicleError(
            f"laden: expected more on {groups[0]} and {groups[1]} than the tractor's {results['tractor.mass'][0]:.0f}"
            " kg; check the slip, or the tractor's mass"
        )
    difference, sigma = results.pop("front")
    if abs(difference) > CONTRADICTION * (sigma or 0.0) + 1e-6 * results["hitch"][0]:
        raise VehicleError(
            f"laden.{groups[0]}: differs by {difference:+.0f} kg from the prediction with a sigma of {sigma:.0f} kg;"
            " check the position of the fifth wheel, and weigh again on level ground with released brakes"
        )
    return {key: number for key, number in results.items() if key != "hitch"}


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
    if "solo.0" in x:
        tractor = x["solo.0"] + x["solo.1"]
        cog = lengths.wheelbase * x["solo.1"] / tractor
    else:
        tractor, cog = x["tractor.mass"], x["tractor.cog"]
    hitch = x["laden.0"] + x["laden.1"] - tractor
    moment = lengths.wheelbase * x["laden.1"] - cog * tractor
    result = {"tractor.mass": tractor, "tractor.cog": cog, "hitch": hitch, "front": 0.0}
    if lengths.coupling is None:
        result["coupling"] = moment / hitch
    else:
        result["front"] = (lengths.coupling * hitch - moment) / lengths.wheelbase
    trailer = hitch + x["laden.2"]
    result |= {"trailer.mass": trailer, "trailer.cog": lengths.trailer * x["laden.2"] / trailer}
    if "empty.0" in x:
        result["payload.mass"] = trailer - (x["empty.0"] + x["empty.1"] - tractor + x["empty.2"])
    elif "unladen" in x:
        result["payload.mass"] = trailer - x["unladen"]
    return result


def _check(slip: Slip, groups: tuple[str, ...]) -> None:
    for condition, expected in (("laden", groups), ("solo", groups[:2]), ("empty", groups)):
        loads = getattr(slip, condition)
        for path in loads:
            if path not in expected:
                raise VehicleError(f"{condition}.{path}: no such axle load; {suggestion(path, expected)}")
        missing = [path for path in expected if path not in loads]
        if missing and (loads or condition == "laden"):
            raise VehicleError(f"{condition}.{missing[0]}: expected a load, got none; weigh every axle group")
