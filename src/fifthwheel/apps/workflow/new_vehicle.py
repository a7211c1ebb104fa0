"""A vehicle file from the answers to questions: of a brochure, a tape measure and the slips of a weighbridge."""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fifthwheel.base.errors import FifthwheelError, VehicleError, suggestion
from fifthwheel.base.options import TruckOptions
from fifthwheel.base.settings import options_of
from fifthwheel.base.spelling import front_end, setting
from fifthwheel.base.units import quantity, uncertain_quantity
from fifthwheel.truck import Vehicle
from fifthwheel.truck.catalogue import commented_toml
from fifthwheel.truck.classes import CLASSES, TYRES, complete
from fifthwheel.truck.quantities import quantity_of
from fifthwheel.truck.slip import (
    ACCURACY,
    CONDITIONS,
    Lengths,
    Number,
    Slip,
    accuracy_of,
    contradict,
    joined,
    weigh,
    weigh_solo,
)
from fifthwheel.truck.weighing import COUPLING_RANGE, MAX_SOLO

TRACTOR, TRAILER, COUPLING = "tractor", "semitrailer", "fifth_wheel"
GROUPS = (f"{TRACTOR}.front", f"{TRACTOR}.drive", TRAILER)
MEASURED, WEIGHED, BROCHURE, GIVEN = "measured", "weighbridge", "brochure", "given"
TARE_SIGMA = 0.03
"""Standard deviation of the mass in a brochure, as a fraction: equipment, driver and fuel differ. A load
without a standard deviation has it too where it is compared with slips."""
HEIGHT_SIGMA = 0.2
"""Standard deviation of a height of the load that is stated without one, as a fraction. A uniform load has its CoG at
half of its height; loads are not uniform, and the standard deviation of the CoG is 10 % of the height."""
SPREADS = (0.8, 3.5)
"""Between neighbouring axles, m: from a tyre's diameter to the 3.1 m of North American spread axles."""


@dataclass(frozen=True, kw_only=True)
class Question:
    """A question; the answer is a choice, a quantity in a unit or, without both, the loads of a slip."""

    key: str
    """Field of `TruckOptions`."""
    unit: str = ""
    limits: tuple[float, float] = (0.0, math.inf)
    """Least and largest quantity, in the unit. The ranges are wider than those of road vehicles, heavy haulage
    included: an answer outside has a wrong unit or digit."""
    choices: tuple[str, ...] = ()
    example: str = ""
    """An answer, unless there are choices."""
    required: bool = False
    sigma: float | None = None
    """Standard deviation as a fraction where the answer states none."""
    unused: Callable[[Mapping[str, str]], str] = lambda answers: ""
    """Why this answer has no use beside the others; "" if it has one."""

    @property
    def text(self) -> str:
        """As a user reads it."""
        option = options_of(TruckOptions)[self.key]
        return option.label or option.help.removesuffix(".")

    @property
    def is_slip(self) -> bool:
        """Whether the answer is the loads of a slip."""
        return not self.unit and not self.choices

    def parse(self, answer: str) -> Any:
        """The value of an answer: a choice, value and standard deviation, or loads by their paths.

        A VehicleError if the answer is not one to this question.
        """
        try:
            if self.choices:
                if answer not in self.choices:
                    raise VehicleError(f"no such choice {answer!r}; {suggestion(answer, self.choices)}")
                return answer
            if self.is_slip:
                loads: Any = _loads(answer, GROUPS[:2] if self.key == "solo" else GROUPS)
            else:
                value, sigma = uncertain_quantity(answer, self.unit, unit_needed=True)
        except FifthwheelError as error:
            raise VehicleError(f"{self.key}: {error}") from None
        if self.is_slip:
            Slip(**{self.key: loads})  # refuses loads that no axle group has
            return loads
        low, high = self.limits
        if not low <= value <= high:
            raise VehicleError(
                f"{self.key}: expected {low:g} to {high:g} {self.unit}, got {answer}; check the number and its unit"
            )
        return value, self.sigma * value if sigma is None and self.sigma else sigma


def _loads(answer: str, paths: tuple[str, ...]) -> dict[str, float]:
    if re.search(r"(?<!\d)\d{1,3},\d", answer):
        raise VehicleError(f"expected a decimal point, and no separator of thousands, got {answer!r}; correct it")
    loads = answer.replace(",", " ").replace(";", " ").split()
    if len(loads) != len(paths):
        raise VehicleError(f"expected {len(paths)} loads, of {', '.join(paths)}, got {answer!r}; give them in kg")
    return {path: quantity(load, "kg") for path, load in zip(paths, loads, strict=True)}


def _without_load(answers: Mapping[str, str]) -> str:
    return "" if uncertain_quantity(answers.get("load_mass", "1"), "kg")[0] > 0 else "load_mass is 0"


def _one_axle(unit: str) -> Callable[[Mapping[str, str]], str]:
    """Whether the last group of a unit has one axle, so that there is no distance between axles."""
    return lambda answers: "" if CLASSES[answers[unit]].axle_counts[-1] > 1 else f"{answers[unit]} has one axle there"


def _given(other: str) -> Callable[[Mapping[str, str]], str]:
    """Whether the loads of a slip give the number."""
    return lambda answers: f"{other} gives it" if other in answers else ""


def _without_laden(answers: Mapping[str, str]) -> str:
    return "" if "laden" in answers else "there are no laden loads"


def _tare(key: str, limits: tuple[float, float], example: str, *, weighed: str) -> Question:
    """The question for a mass without load by a brochure, which the slip `weighed` replaces."""
    unused = _given(weighed)
    return Question(key=key, unit="kg", limits=limits, example=example, sigma=TARE_SIGMA, unused=unused)


QUESTIONS = (
    Question(key="tractor", choices=tuple(name for name in CLASSES if name.startswith(TRACTOR)), required=True),
    Question(key="trailer", choices=tuple(name for name in CLASSES if name.startswith(TRAILER)), required=True),
    Question(key="wheelbase", unit="m", limits=(2, 8), example="3.7 m +- 2 cm", required=True),
    Question(key="tractor_spread", unit="m", limits=SPREADS, example="1.35 m +- 1 cm", unused=_one_axle(TRACTOR)),
    Question(key="fifth_wheel", unit="m", limits=(1, 9), example="3.1 m +- 3 cm"),
    Question(key="fifth_wheel_height", unit="m", limits=(0.6, 2), example="1.2 m +- 2 cm"),
    Question(key="trailer_wheelbase", unit="m", limits=(3, 15), example="7.7 m +- 2 cm", required=True),
    Question(key="trailer_spread", unit="m", limits=SPREADS, example="1.31 m +- 1 cm", unused=_one_axle("trailer")),
    Question(key="laden", example="6850 10500 22500"),
    Question(key="solo", example="5200 2000"),
    Question(key="empty", example="5800 4200 4700", unused=_without_laden),
    _tare("tractor_tare", (3e3, 2e4), "7.2 t +- 3 %", weighed="solo"),
    _tare("trailer_tare", (1.5e3, 2.5e4), "6.4 t +- 3 %", weighed="empty"),
    Question(key="load_mass", unit="kg", limits=(0, 8e4), example="21 t +- 2 %"),
    Question(key="load_height", unit="m", limits=(0.05, 4), example="2.2 m +- 20 cm", unused=_without_load),
    Question(key="load_width", unit="m", limits=(0.2, 5), example="2.4 m +- 5 cm", unused=_without_load),
    Question(key="floor_height", unit="m", limits=(0.2, 2), example="1.2 m +- 3 cm", unused=_without_load),
    Question(key="load_shape", choices=("uniform", "point"), unused=_without_load),
    Question(key="trailer_tyres", choices=tuple(TYRES)),
)


def new_vehicle(answers: Mapping[str, str], *, slip: Path | None = None, accuracy: str | None = None) -> str:
    """The text of a vehicle file, with the uncertainty and the source of each number.

    Args:
        answers: text by the key of the question; those that are not known are absent.
        slip: file with the loads, instead of the answers on loads.
        accuracy: of the loads, such as "1 %" or "20 kg".

    Raises:
        VehicleError: an answer is not valid or has no use, a required one is missing, or the slips contradict
            themselves or the other answers.
    """
    values: dict[str, Any] = {}
    for question in QUESTIONS:
        if question.key in answers:
            values[question.key] = question.parse(answers[question.key])
        elif question.required:
            asked = ", or answer on a terminal" if front_end() == "command line" else ""
            raise VehicleError(f"{question.key}: expected a value, got none; give {setting(question.key)}{asked}")
    loads = {key: values.pop(key) for key in CONDITIONS if key in values}
    if slip is not None and (twice := [*loads, *(["accuracy"] if accuracy else [])]):
        raise VehicleError(f"{twice[0]}: given, and {slip} too; keep one of them")
    if accuracy and not (slip or loads):
        laden, stated = setting("laden"), setting("accuracy")
        raise VehicleError(f"accuracy: expected loads too, got none; give {laden}, or remove {stated}")
    fraction, step = accuracy_of(accuracy or ACCURACY)
    weighed = Slip.load(slip) if slip is not None else Slip(**loads, accuracy=fraction, step=step)
    given = {**dict.fromkeys(_weighed(weighed), ""), **answers}
    for question in QUESTIONS:
        if question.key in given and (reason := question.unused(given)):
            raise VehicleError(f"{question.key}: has no use, because {reason}; remove it")
    return described_vehicle(values, weighed)


def conditions(slip: Path | None) -> tuple[str, ...]:
    """The conditions of which a slip file has the loads; a VehicleError if it cannot be read."""
    return () if slip is None else _weighed(Slip.load(slip))


def _weighed(slip: Slip) -> tuple[str, ...]:
    return tuple(condition for condition in CONDITIONS if getattr(slip, condition))


def described_vehicle(known: Mapping[str, Any], slip: Slip) -> str:
    """The text of a vehicle file from parsed answers by the keys of the questions; errors as of `new_vehicle`."""
    builder = _Builder(known, slip)
    return commented_toml(Vehicle(**complete(builder.fields())), builder.sources)


class _Builder:
    """Fields of a vehicle from what is known of it, with standard deviations and sources."""

    def __init__(self, known: Mapping[str, Any], slip: Slip) -> None:
        self.known, self.slip = known, slip
        self.stated: dict[str, float] = {}
        self.sources: dict[str, str] = {}

    def fields(self) -> dict[str, Any]:
        """Fields of the vehicle, without the numbers that its classes give."""
        known, classes = self.known, (self.known["tractor"], self.known["trailer"])
        tractor: dict[str, Any] = {"name": TRACTOR, "vehicle_class": classes[0]}
        trailer: dict[str, Any] = {"name": TRAILER, "vehicle_class": classes[1]}
        tractor["axle_groups"] = [
            {"name": "front", "axles": [self._axle(TRACTOR, "front", (0.0, None), "the origin")]},
            {"name": "drive", "axles": list(self._rear_axles())},
        ]
        trailer["axle_groups"] = [self._trailer_group()]
        coupling: dict[str, Any] = {"name": COUPLING}
        self._set(coupling, COUPLING, "trailing_position", (0.0, None), "the origin")
        self._set(coupling, COUPLING, "height", known.get("fifth_wheel_height"), MEASURED)
        if known.get("load_mass", (1.0, None))[0] > 0:
            trailer["payload"] = self._payload()
        self._masses(tractor, trailer, coupling)
        return {
            "name": "truck",
            "source": f"{' and '.join(classes)}: measured, weighed and assumed from classes",
            "units": [tractor, trailer],
            "couplings": [coupling],
            "stated": self.stated,
        }

    def _set(self, table: dict[str, Any], path: str, key: str, number: Number | None, source: str) -> None:
        if number is None:
            return
        table[key] = number[0]
        self.sources[f"{path}.{key}"] = source
        if number[1] is not None:
            self.stated[f"{path}.{key}"] = number[1]

    def _axle(self, unit: str, name: str, number: Number, source: str) -> dict[str, Any]:
        axle: dict[str, Any] = {"name": name}
        self._set(axle, f"{unit}.{name}", "position", number, source)
        return axle

    def _rear_axles(self) -> Iterator[dict[str, Any]]:
        count, spread = CLASSES[self.known["tractor"]].axle_counts[1], self.known.get("tractor_spread", (1.35, None))
        names = ("drive",) if count == 1 else tuple(f"drive_{k + 1}" for k in range(count))
        for k, name in enumerate(names):
            yield self._axle(TRACTOR, name, _position(self.known["wheelbase"], spread, k), MEASURED)

    def _trailer_group(self) -> dict[str, Any]:
        count = CLASSES[self.known["trailer"]].axle_counts[0]
        middle, spread = self.known["trailer_wheelbase"], self.known.get("trailer_spread", (1.31, None))
        names = {1: ("axle",), 2: ("front", "rear"), 3: ("front", "middle", "rear")}[count]
        positions = [_position(middle, spread, k - (count - 1) / 2) for k in range(count)]
        axles = [self._axle(TRAILER, name, x, MEASURED) for name, x in zip(names, positions, strict=True)]
        group: dict[str, Any] = {"name": "axles", "axles": axles}
        if tyres := self.known.get("trailer_tyres"):
            figure = TYRES[tyres]
            group["tyres"] = count * (4 if tyres == "twin" else 2)
            number = (count * figure.value, count * figure.sigma)
            self._set(group, TRAILER, "tyre_roll_stiffness", number, f"{tyres} tyres: {figure.source}")
        return group

    def _payload(self) -> dict[str, Any]:
        known, path = self.known, f"{TRAILER}.payload"
        payload: dict[str, Any] = {"shape": known.get("load_shape", "uniform")}
        self._set(payload, path, "mass", known.get("load_mass"), GIVEN)
        if "load_height" in known:
            height, sigma = known["load_height"]
            self._set(payload, path, "height", (height, HEIGHT_SIGMA * height if sigma is None else sigma), MEASURED)
        self._set(payload, path, "width", known.get("load_width"), MEASURED)
        self._set(payload, path, "floor_height", known.get("floor_height"), MEASURED)
        return payload

    def _masses(self, tractor: dict[str, Any], trailer: dict[str, Any], coupling: dict[str, Any]) -> None:
        """Masses, CoG positions and the position of the fifth wheel: weighed, or by the brochure."""
        known, slip, payload = self.known, self.slip, trailer.get("payload", {})
        position = known.get("fifth_wheel")
        if position is not None:
            self._set(coupling, COUPLING, "leading_position", (-position[0], position[1]), MEASURED)
        rear = [axle["position"] for axle in tractor["axle_groups"][1]["axles"]]
        lengths = Lengths(wheelbase=-sum(rear) / len(rear), coupling=position, trailer=known["trailer_wheelbase"])
        if not slip.laden:
            if slip.solo:
                results = weigh_solo(lengths, slip, GROUPS)
                _check_solo(slip.solo)
                self._weighed(tractor, TRACTOR, results["tractor.mass"], results["tractor.cog"])
            self._unweighed(tractor, trailer)
            return
        results = weigh(lengths, slip, GROUPS, self._tares(lengths))
        _check_solo(slip.solo)
        if "coupling" in results:
            _check_coupling(results["coupling"][0], lengths.wheelbase)
        if "load_mass" in known and "payload.mass" in results:
            _check_load(known["load_mass"], slip, results)
        for key, unit, name in (("tractor", tractor, TRACTOR), ("trailer", trailer, TRAILER)):
            if key == "trailer" or slip.solo:
                self._weighed(unit, name, results[f"{key}.mass"], results[f"{key}.cog"])
            else:
                cog, sigma = results["tractor.cog"]
                self._set(unit, name, "mass", known.get("tractor_tare"), BROCHURE)
                self._set(unit, name, "cog", (-cog, sigma), f"{WEIGHED}: moments of the laden tractor")
        if "coupling" in results:
            where, sigma = results["coupling"]
            self._set(coupling, COUPLING, "leading_position", (-where, sigma), f"{WEIGHED}: moments of the tractor")
        if "payload.mass" in results and payload:
            if "mass" not in payload and results["payload.mass"][0] <= 0:
                raise VehicleError(
                    f"payload.mass: expected above 0 kg, got {results['payload.mass'][0]:.0f} kg from the slips; give a"
                    " load of 0 if the trailer is unladen"
                )
            source = f"{WEIGHED}, laden less {'empty' if slip.empty else 'the unladen mass by the ' + BROCHURE}"
            number = results["payload.mass"]
            if "mass" in payload:
                number, source = joined(known["load_mass"], number), f"{GIVEN}; {source}"
            self._set(payload, f"{TRAILER}.payload", "mass", number, source)

    def _weighed(self, unit: dict[str, Any], name: str, mass: Number, cog: Number) -> None:
        """Mass, kg, and CoG behind the origin, m, of a unit."""
        self._set(unit, name, "mass", mass, WEIGHED)
        self._set(unit, name, "cog", (-cog[0], cog[1]), WEIGHED)

    def _unweighed(self, tractor: dict[str, Any], trailer: dict[str, Any]) -> None:
        """Masses by the brochure; there is none of a tractor that was weighed."""
        known = self.known
        if "fifth_wheel" not in known:
            raise VehicleError("fifth_wheel: expected its distance from the front axle, got none; measure it")
        self._set(tractor, TRACTOR, "mass", known.get("tractor_tare"), BROCHURE)
        if "payload" in trailer and "load_mass" not in known:
            raise VehicleError("load_mass: expected a mass, got none; give it or the laden slip; 0 for no load")
        if tare := known.get("trailer_tare"):
            load = known.get("load_mass", (0.0, None))
            number = (tare[0] + load[0], math.hypot(tare[1] or 0.0, load[1] or 0.0) or None)
            self._set(trailer, TRAILER, "mass", number, f"{BROCHURE} and load")

    def _tares(self, lengths: Lengths) -> dict[str, Number]:
        kind, known = CLASSES[self.known["tractor"]], self.known
        return {
            "tractor.mass": known.get("tractor_tare", (kind.tare.value, kind.tare.sigma)),
            "tractor.cog": (kind.cog.value * lengths.wheelbase, kind.cog.sigma * lengths.wheelbase),
            **({"trailer.mass": known["trailer_tare"]} if "trailer_tare" in known else {}),
        }


def _position(distance: Number, spread: Number, count: float) -> Number:
    """Position of an axle, m, so many spreads behind a distance from the origin."""
    (x, sigma), (step, sigma_step) = distance, spread
    if sigma_step is not None and sigma is None:
        sigma = quantity_of("axle_positions").sigma
    return -x - count * step, None if sigma is None else math.hypot(sigma, count * (sigma_step or 0.0))


def _check_solo(loads: Mapping[str, float]) -> None:
    front, drive, _ = GROUPS
    if {front, drive} <= loads.keys() and loads[drive] > MAX_SOLO * (loads[front] + loads[drive]):
        raise VehicleError(
            f"solo: expected less on {drive} than on {front}, got {loads[drive]:g} and {loads[front]:g} kg; correct"
            " the loads"
        )


def _check_coupling(coupling: float, wheelbase: float) -> None:
    low, high = (ratio * wheelbase for ratio in COUPLING_RANGE)
    if not low <= coupling <= high:
        raise VehicleError(
            f"laden: expected a kingpin {low:.2f} to {high:.2f} m behind the front axle, got {coupling:.2f} m from the"
            f" laden and solo loads; correct the loads ({', '.join(GROUPS)}), or the wheelbase"
        )


def _check_load(stated: Number, slip: Slip, results: Mapping[str, Number]) -> None:
    """Whether the slips less the unladen mass give the stated load."""
    (weighed, sigma_weighed), (load, sigma) = results["payload.mass"], stated
    sigma = TARE_SIGMA * load if sigma is None else sigma
    if contradict((weighed, sigma_weighed), (load, sigma)):
        mass = results["trailer.mass"][0]
        raise VehicleError(
            f"load_mass: expected {weighed:.0f} kg, because the trailer has {mass:.0f} kg by the laden slip and"
            f" {mass - weighed:.0f} kg without load by {'the empty slip' if slip.empty else 'trailer_tare'}, got"
            f" {load:.0f} kg; correct one of the three"
        )
