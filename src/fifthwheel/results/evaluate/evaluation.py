"""The result of an evaluation: measures with sigma, test conditions, and the arrays of its diagrams."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.errors import suggestion
from fifthwheel.base.formatting import shown, with_sigma
from fifthwheel.base.lazy import require
from fifthwheel.base.names import split_kind
from fifthwheel.base.pages.html import Displayed
from fifthwheel.base.plots import Axis, Band, Item, Line, Panel, Plot, Points
from fifthwheel.base.types import Array
from fifthwheel.data.channels import CHANNELS, SignalName
from fifthwheel.results.evaluate.motion import gain_unit
from fifthwheel.truck.spoken_names import spoken

if TYPE_CHECKING:
    import pandas as pd

AXES = {
    "lateral_acceleration": Axis(label="lateral acceleration", unit="m/s²"),
    "frequency": Axis(label="frequency", unit="Hz"),
    "time": Axis(label="time", unit="s"),
}
"""Of the first column of the arrays."""
TITLES = {"steer": "Steer angle", "steer_less_ackermann": "Steer angle less Ackermann angle"}


def diagram(arrays: Mapping[str, Array]) -> dict[str, Plot]:
    """Plots by their captions: over lateral acceleration, frequency or time, whichever is the first column."""
    first = next(iter(arrays))
    if first == "lateral_acceleration":
        return _characteristics(arrays)
    return _responses(arrays) if first == "frequency" else _histories(arrays)


def _characteristics(arrays: Mapping[str, Array]) -> dict[str, Plot]:
    x, axis = arrays["lateral_acceleration"], AXES["lateral_acceleration"]
    return {
        TITLES.get(name) or spoken(name): Plot(
            panels=[Panel(items=[Points(x, np.degrees(values))], x=axis, y=Axis(unit="deg"))]
        )
        for name, values in arrays.items()
        if name not in ("lateral_acceleration", "speed", "curvature")
    }


def _responses(arrays: Mapping[str, Array]) -> dict[str, Plot]:
    f, axis, plots = arrays["frequency"], AXES["frequency"], dict[str, Plot]()
    for name in [name for kind, name in map(split_kind, arrays) if kind == "gain"]:
        gain, sigma = arrays[f"gain.{name}"], arrays[f"gain_sigma.{name}"]
        gains: list[Item] = [Band(f, gain - sigma, gain + sigma), Line(f, gain)]
        plots[spoken(name)] = Plot(
            panels=[
                Panel(items=gains, x=axis, y=Axis(label="gain", unit=shown(gain_unit(name)).name), height=1.5),
                Panel(items=[Line(f, np.degrees(arrays[f"phase.{name}"]))], x=axis, y=Axis(label="phase", unit="deg")),
                Panel(items=[Line(f, arrays[f"coherence.{name}"])], x=axis, y=Axis(label="coherence", range=(0, 1.02))),
            ]
        )
    return plots


def _histories(arrays: Mapping[str, Array]) -> dict[str, Plot]:
    """Each quantity over time, one plot for all units."""
    quantities: dict[str, list[Item]] = {}
    for name, values in arrays.items():
        if name != "time":
            quantity = SignalName.of(name).quantity
            unit = shown(CHANNELS[quantity].unit)
            quantities.setdefault(quantity, []).append(Line(arrays["time"], unit.factor * values, name=spoken(name)))
    return {
        quantity.replace("_", " ").capitalize(): Plot(
            panels=[Panel(items=items, x=AXES["time"], y=Axis(unit=shown(CHANNELS[quantity].unit).name))]
        )
        for quantity, items in quantities.items()
    }


@dataclass(frozen=True)
class EvaluatedMeasure:
    """One measure of a test."""

    name: str
    """Such as "understeer_gradient" or "response_time.yaw_rate.tractor"."""
    title: str
    unit: str
    """SI unit, "1" for a ratio."""
    value: float
    sigma: float | None
    signals: tuple[str, ...]
    """Outputs from which it is computed."""
    reason: str = ""
    """Why there is no sigma, or what it does not contain."""

    def text(self) -> str:
        """Value and sigma in the unit in which it is shown."""
        return with_sigma(self.value, self.sigma, self.unit)


@dataclass(frozen=True)
class Condition:
    """A condition of ISO 15037-2 that a log shows."""

    name: str
    required: str
    found: str
    met: bool | None
    """None where it does not apply, or the log does not show it."""

    @property
    def word(self) -> str:
        """yes, no, or "–"."""
        return "–" if self.met is None else "yes" if self.met else "no"


@dataclass(frozen=True, kw_only=True)
class MethodResult:
    """What a test method finds in a motion."""

    measures: tuple[EvaluatedMeasure, ...]
    arrays: Mapping[str, Array] = field(repr=False)
    """Columns of equal length by name, SI: `pandas.DataFrame(arrays)`; the first is the x axis of the diagrams."""
    start: float | None = None
    """Time of the first steering, s; None where the method needs no straight entry."""
    noise: Mapping[str, float | Array] = field(default_factory=dict, repr=False)
    """Standard deviation of the columns by noise, one or (n,); NaN where it is not known."""
    has_constant_speed: bool = True
    """Whether the method needs a constant speed."""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Evaluation(MethodResult, Displayed):
    """A log evaluated by a test method.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> log = fw.simulate(truck, manoeuvre="sine_with_dwell", seed=1)
        >>> evaluation = fw.evaluate(log, "sine_with_dwell", vehicle=truck)
        >>> evaluation
        Evaluation(sine_with_dwell in simulated, 4 measures)
        >>> evaluation["yaw_rate_ratio_1000ms.yaw_rate.tractor"].unit
        '1'
        >>> list(evaluation.to_pandas().columns)
        ['title', 'value', 'sigma', 'unit']
    """

    log: str
    """Name of the record."""
    test: str
    title: str
    """Of the test method."""
    standard: str
    conditions: tuple[Condition, ...]

    def __getitem__(self, name: str) -> EvaluatedMeasure:
        """A measure by name; KeyError if the log does not give it."""
        for measure in self.measures:
            if measure.name == name:
                return measure
        raise KeyError(f"{name}: not a measure of this test; {suggestion(name, [m.name for m in self.measures])}")

    def __iter__(self) -> Iterator[EvaluatedMeasure]:
        return iter(self.measures)

    def __len__(self) -> int:
        return len(self.measures)

    def __repr__(self) -> str:
        return f"Evaluation({self.test} in {self.log}, {len(self)} measures)"

    def to_pandas(self) -> "pd.DataFrame":
        """The measures by name: title, value and sigma in SI, unit.

        Raises:
            FifthwheelError: pandas is not installed.
        """
        columns = ("title", "value", "sigma", "unit")
        rows = {measure.name: [getattr(measure, column) for column in columns] for measure in self}
        frame: pd.DataFrame = require("pandas", "pandas").DataFrame.from_dict(rows, orient="index", columns=columns)
        return frame

    def plots(self) -> dict[str, Plot]:
        """The diagrams of the test by their captions."""
        return diagram(self.arrays)

    def as_dict(self) -> dict[str, Any]:
        """The content of evaluation.json; a value that is not finite is null."""
        arrays = {name: [v if np.isfinite(v) else None for v in col.tolist()] for name, col in self.arrays.items()}
        return {
            "log": self.log,
            "test": self.test,
            "standard": self.standard,
            "measures": [asdict(measure) for measure in self.measures],
            "conditions": [asdict(condition) for condition in self.conditions],
            "arrays": arrays,
            "notes": list(self.notes),
        }

    def table(self) -> pages.Table:
        """Measures with sigma."""
        columns = 3 if any(m.reason for m in self) else 2
        rows = [(m.title, m.text(), m.reason)[:columns] for m in self]
        return pages.Table(("Measure|name", "Value ± sigma>", "Remark")[:columns], rows, label="Measures")

    def condition_table(self) -> pages.Table:
        """Conditions of the test."""
        rows = [(c.name, c.required, c.found, c.word) for c in self.conditions]
        return pages.Table(("Condition|name", "Required", "Found", "Met"), rows, label="Conditions")

    def _document(self) -> pages.Document:
        blocks: list[pages.Block] = [self.table(), self.condition_table(), pages.Items(self.notes)]
        return pages.Document(f"{self.title}, {self.log}", blocks)
