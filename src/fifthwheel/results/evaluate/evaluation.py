"""The result of an evaluation: measures with sigma, test conditions, and the arrays of its diagrams."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from fifthwheel.base import pages
from fifthwheel.base.errors import suggestion
from fifthwheel.base.formatting import with_sigma
from fifthwheel.base.lazy import require
from fifthwheel.base.pages.html import Displayed
from fifthwheel.base.plots import Plot
from fifthwheel.base.types import Array
from fifthwheel.results.evaluate.diagrams import diagram

if TYPE_CHECKING:
    import pandas as pd


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
