"""The result of an assessment: each measure with sigma, interval and the probability that a threshold is met."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from fifthwheel.base import pages
from fifthwheel.base.errors import suggestion
from fifthwheel.base.formatting import DisplayUnit, percent, shown, with_sigma
from fifthwheel.base.pages.html import Displayed
from fifthwheel.results.assess.lane_change import LaneChangeRun
from fifthwheel.results.assess.measures import SCHEME
from fifthwheel.results.assess.propagation import Order
from fifthwheel.results.assess.truck import HALF_TRACK, Body
from fifthwheel.truck import Vehicle, unit_of
from fifthwheel.truck.spoken_names import spoken

_UNITS = {"m/s": DisplayUnit("km/h", 3.6), "s": DisplayUnit("s", 1.0)}
"""Units in which measures are shown, where others are shown otherwise."""


def display_unit(unit: str) -> DisplayUnit:
    """The unit in which a measure is shown, by its unit."""
    return _UNITS.get(unit) or shown(unit)


def in_unit(value: float, unit: str) -> str:
    """A value of a measure in its display unit."""
    return f"{display_unit(unit).factor * value:.3g} {display_unit(unit).name}".rstrip()


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """A threshold of a measure."""

    scheme: str
    level: str
    """"1" to "4", or "all"."""
    source: str
    """With its edition."""
    confirmed: bool
    """Whether the text of the source, or a second source, was read for this number."""
    sense: str
    """"at least" or "at most"."""
    value: float
    """SI; in the unit of the measure."""
    probability: float | None
    """That the truck meets it; None if the measure has no sigma."""

    def text(self, unit: str) -> str:
        """The threshold of a measure with this unit: "level 1: ≤ 0.6 m"; it names a scheme other than `SCHEME`."""
        sign = "≥" if self.sense == "at least" else "≤"
        level = "" if self.level == "all" else f"level {self.level}: "
        scheme = "" if self.scheme == SCHEME else f"{self.scheme}: "
        doubt = "" if self.confirmed else " (not confirmed)"
        return f"{scheme}{level}{sign} {in_unit(self.value, unit)}{doubt}"


@dataclass(frozen=True, kw_only=True)
class MeasureResult:
    """One measure of a truck."""

    name: str
    title: str
    unit: str
    """SI unit, "1", or "g"."""
    source: str
    value: float
    """Of the linear model."""
    sigma: float | None
    """None where the measure does not exist for all trucks within the uncertainty."""
    interval: tuple[float, float] | None
    """That contains 90 %."""
    order: Order | None
    """How sigma follows from the parameters: "linear", or "sampled" where a measure is strongly nonlinear."""
    thresholds: tuple[Threshold, ...]
    nonlinear: float | None = None
    """Of the nonlinear truck; None if it was not simulated."""

    def text(self) -> str:
        """Value, sigma and unit."""
        unit = display_unit(self.unit)
        sigma = None if self.sigma is None else unit.factor * self.sigma
        return f"{with_sigma(unit.factor * self.value, sigma, '1')} {unit.name}".rstrip()

    def best_threshold(self) -> Threshold | None:
        """The strictest threshold that is met with 50 % or more, else the mildest."""
        met = [t for t in self.thresholds if self.meets(t)]
        return met[0] if met else self.thresholds[-1] if self.thresholds else None

    def meets(self, threshold: Threshold) -> bool:
        """Whether the value meets a threshold."""
        return self.value >= threshold.value if threshold.sense == "at least" else self.value <= threshold.value


@dataclass(frozen=True, kw_only=True)
class Assessment(Displayed):
    """What a truck does: its performance-based measures, each with sigma.

    Example:
        >>> import fifthwheel as fw
        >>> assessment = fw.assess(fw.vehicle("cheng_cebon_2011"), nonlinear=False)
        >>> assessment
        Assessment(cheng_cebon_2011 at 88 km/h, 22 measures)
        >>> measure = assessment["rollover_threshold"]
        >>> measure.unit, measure.thresholds[0].value
        ('g', 0.35)
    """

    vehicle: Vehicle
    body: Body
    speed: float
    """m/s."""
    measures: tuple[MeasureResult, ...]
    uncertain: Mapping[str, float]
    """Sigma of each uncertain parameter by path, SI."""
    origin: str
    """Where the uncertainty comes from, in words."""
    unstable: float = 0.0
    """Fraction of the random trucks within the uncertainty that are unstable, 0 if none were needed; 1 if the truck
    itself is unstable."""
    notes: tuple[str, ...] = ()
    runs: Mapping[str, LaneChangeRun] = field(default_factory=dict, repr=False)
    """The lane change by model, "linear" and "nonlinear"."""

    def __getitem__(self, name: str) -> MeasureResult:
        """A measure by name; KeyError if the truck does not have it."""
        for measure in self.measures:
            if measure.name == name:
                return measure
        raise KeyError(f"{name}: not a measure of this truck; {suggestion(name, [m.name for m in self.measures])}")

    def __iter__(self) -> Iterator[MeasureResult]:
        return iter(self.measures)

    def __len__(self) -> int:
        return len(self.measures)

    @property
    def title(self) -> str:
        """Vehicle and speed."""
        return f"{self.vehicle.name} at {3.6 * self.speed:.0f} km/h"

    @property
    def instability(self) -> str:
        """A sentence on the fraction of trucks that are unstable; empty if none are."""
        if not self.unstable:
            return ""
        trucks = f"About {percent(self.unstable)} of the trucks within the uncertainty are"
        return f"{'the truck is' if self.unstable == 1 else trucks} unstable at this speed."

    def uncertain_units(self) -> Iterator[tuple[str, str, str]]:
        """Path, name in words and SI unit of each uncertain parameter."""
        for path in self.uncertain:
            yield path, spoken(path), "m" if path == HALF_TRACK else unit_of(path)

    def as_dict(self) -> dict[str, Any]:
        """The content of assessment.json: everything but time series."""
        return {
            "vehicle": self.vehicle.name,
            "units": {"speed": "m/s", "body": "m"},
            "speed": self.speed,
            "body": asdict(self.body),
            "measures": [asdict(measure) for measure in self.measures],
            "uncertain": {
                path: {"name": words, "sigma": self.uncertain[path], "unit": unit}
                for path, words, unit in self.uncertain_units()
            },
            "origin": self.origin,
            "unstable": self.unstable,
            "notes": list(self.notes),
        }

    def __repr__(self) -> str:
        return f"Assessment({self.title}, {len(self.measures)} measures)"

    def table(self) -> pages.Table:
        """Each measure with its threshold; without the column of the nonlinear truck if it was not simulated."""
        simulated = any(m.nonlinear is not None for m in self)
        heads = ("Measure|name", "Linear ± sigma>", *["Nonlinear>"] * simulated, "Threshold>", "Probability>")
        rows = []
        for measure in self:
            threshold, probability = measure.best_threshold(), ""
            if threshold and threshold.probability is not None:
                probability = percent(round(threshold.probability, 4))
            nonlinear = "" if measure.nonlinear is None else in_unit(measure.nonlinear, measure.unit)
            limit = threshold.text(measure.unit) if threshold else ""
            rows.append((measure.title, measure.text(), *[nonlinear] * simulated, limit, probability))
        return pages.Table(heads, rows)

    def _document(self) -> pages.Document:
        return pages.Document(self.title, [self.table(), pages.Items([*filter(None, [self.instability]), *self.notes])])
