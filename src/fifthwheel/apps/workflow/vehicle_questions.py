"""The questions whose answers describe a tractor-semitrailer, as data, and the description from the answers."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fifthwheel.apps.workflow.new_vehicle import TARE_SIGMA, TRACTOR, TRAILER, Description
from fifthwheel.base.errors import FifthwheelError, VehicleError, suggestion
from fifthwheel.base.options import TruckOptions
from fifthwheel.base.settings import options_of
from fifthwheel.base.units import quantity, uncertain_quantity
from fifthwheel.truck.classes import CLASSES, TYRES
from fifthwheel.truck.slip import ACCURACY, CONDITIONS, Slip, fraction

GROUPS = (f"{TRACTOR}.front", f"{TRACTOR}.drive", TRAILER)


@dataclass(frozen=True, kw_only=True)
class Question:
    """A question; the answer is a choice, a quantity in a unit or, without both, the loads of a slip."""

    key: str
    """Field of `Description`, or of `Slip`."""
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


SPREADS = (0.8, 3.5)
"""Between neighbouring axles, m: from a tyre's diameter to the 3.1 m of North American spread axles."""
QUESTIONS = (
    Question(key="tractor", choices=tuple(name for name in CLASSES if name.startswith(TRACTOR)), required=True),
    Question(key="trailer", choices=tuple(name for name in CLASSES if name.startswith(TRAILER)), required=True),
    Question(key="wheelbase", unit="m", limits=(2, 8), example="3.7 m +- 2 cm", required=True),
    Question(key="tractor_spread", unit="m", limits=SPREADS, example="1.35 m +- 1 cm", unused=_one_axle(TRACTOR)),
    Question(key="fifth_wheel", unit="m", limits=(1, 9), example="3.1 m +- 3 cm"),
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


def describe(answers: Mapping[str, str], *, slip: Path | None = None, accuracy: str | None = None) -> Description:
    """The description by answers.

    Args:
        answers: text by the key of the question; those that are not known are absent.
        slip: file with the loads, instead of the answers on loads.
        accuracy: of the loads, such as "1 %".

    Raises:
        VehicleError: an answer is not valid or has no use, or a required one is missing.
    """
    values: dict[str, Any] = {}
    for question in QUESTIONS:
        if question.key in answers:
            values[question.key] = question.parse(answers[question.key])
        elif question.required:
            option = question.key.replace("_", "-")
            raise VehicleError(f"{question.key}: expected a value, got none; give --{option}, or answer on a terminal")
    loads = {key: values.pop(key) for key in CONDITIONS if key in values}
    if slip is not None and (twice := [*loads, *(["accuracy"] if accuracy else [])]):
        raise VehicleError(f"{twice[0]}: given, and {slip} too; keep one of them")
    if accuracy and not (slip or loads):
        raise VehicleError("accuracy: expected loads too, got none; give --laden, or remove --accuracy")
    weighed = Slip.load(slip) if slip is not None else Slip(**loads, accuracy=fraction(accuracy or ACCURACY))
    given = {**dict.fromkeys(conditions(slip), ""), **answers}
    for question in QUESTIONS:
        if question.key in given and (reason := question.unused(given)):
            raise VehicleError(f"{question.key}: has no use, because {reason}; remove it")
    return Description(**values, slip=weighed)


def conditions(slip: Path | None) -> tuple[str, ...]:
    """The conditions of which a slip file has the loads; a VehicleError if it cannot be read."""
    weighed = Slip.load(slip) if slip is not None else Slip()
    return tuple(condition for condition in CONDITIONS if getattr(weighed, condition))
