"""The parts of a result: estimates and their history, sensor errors, fits, and what was used of each log."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from pydantic import PlainValidator

from fifthwheel.base.formatting import relative
from fifthwheel.base.names import ParameterPath, split_log
from fifthwheel.base.types import Array, ComparedByContents
from fifthwheel.data.channels import SensorErrorName
from fifthwheel.data.checks import Finding
from fifthwheel.estimate.identify.doubts import Doubt
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.settings import CommonSettings
from fifthwheel.estimate.identify.statement import states_sigma
from fifthwheel.estimate.identify.stored import Number, Real
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.observe.uncertainty import Uncertainty
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import quantity_of, size_of

Series = Annotated[Array, PlainValidator(np.asarray)]
"""An array, which is not in the JSON file; empty without its file."""
VehicleFile = Annotated[Vehicle, PlainValidator(lambda content: Vehicle(**content))]
Joint = Annotated[Uncertainty, PlainValidator(Uncertainty.from_dict)]
LAST_FRACTION = 0.1
"""An estimate that settles only within this last fraction of its history has not settled."""


def _empty() -> Array:
    return np.zeros(0)


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """One parameter: mean and standard deviation given logs and prior. Not excited: value and sigma of the prior."""

    name: str
    value: Real  # SI
    sigma: Real | None  # None if fixed, or if no channel of the logs contains information on it
    unit: str
    initial: Real
    verdict: Verdict
    stage: int
    settling_time: Real | None = None  # s of data until it stayed within the tolerance; None if it did not
    prior: Real | None = None  # prior standard deviation, SI
    correlated_with: tuple[str, ...] = ()  # unknowns from which it is hardly separable, the strongest first

    @property
    def path(self) -> ParameterPath:
        """Its parsed name."""
        return ParameterPath.of(self.name)

    @property
    def relative_sigma(self) -> float:
        """Sigma as a fraction of the value; of a number that may be 0, of its prior sigma. 0 without sigma."""
        return self.sigma / size_of(self.name, self.value, self.prior or self.sigma) if self.sigma else 0.0

    @property
    def percent(self) -> str:
        """Sigma in per cent of the value as text; a dash for a number that may be 0 or negative."""
        error = SensorErrorName.of(split_log(self.name)[0])
        signed = not (error.row and error.row.ideal) if error else quantity_of(self.name).signed
        return "–" if signed else relative(self.value, self.sigma)


@dataclass(frozen=True, kw_only=True)
class SensorError:
    """Estimated offset, gain or delay of a sensor."""

    name: str
    value: Real
    sigma: Real
    unit: str
    log: str | None  # None if all logs share it


@dataclass(frozen=True, kw_only=True, eq=False)
class Fit(ComparedByContents):
    """One channel of one log and the free-running model: after the initial state no measurement corrects it."""

    log: str
    signal: str
    explained: Number  # fraction of variance explained: 1 - variance of the residual / variance of the signal
    rms: Number  # of the residual, SI
    time: Series = field(default_factory=_empty)  # (N,)
    measured: Series = field(default_factory=_empty)
    predicted: Series = field(default_factory=_empty)
    identified_on: bool  # False for a log that was only predicted
    whitened: Series = field(default_factory=_empty)
    """Residual at the maximum of the posterior, whitened, in standard deviations; empty if it was only predicted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LogSummary(ComparedByContents):
    """What was used of a log."""

    name: str
    span: tuple[Real, Real]  # s
    samples: int
    averaged: int  # number of samples of each mean that is used; 1 if each sample is used
    used: Real  # s of data above the minimum speed
    speed: tuple[Number, Number]  # m/s, lowest and highest in the used segments
    rejected: dict[str, Number]  # fraction of the samples of each channel that the gate rejected
    noise: dict[str, Number]  # estimated noise variance of each channel, SI squared
    notes: tuple[str, ...]
    bank: tuple[Real, Real] | None = None  # of the road in the first segment and sigma, rad, left edge higher
    drive_axle_braking: tuple[Real, Real] | None = None
    """Fraction of the braking force by engine and retarder, and its sigma."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ParameterHistory(ComparedByContents):
    """Estimates after each of N samples, all passes one after another, of n parameters."""

    names: tuple[str, ...]
    time: Series  # (N,) s, continues over logs and passes
    values: Series  # (N, n)
    sigma: Series  # (N, n), of the filter
    starts: tuple[int, ...]  # first row of each pass

    @property
    def passes(self) -> int:
        """Number of passes."""
        return len(self.starts)

    def followed_by(self, later: "ParameterHistory") -> "ParameterHistory":
        """This history followed by a later one of the same parameters."""
        return ParameterHistory(
            names=self.names,
            time=np.concatenate([self.time, self.time[-1] + later.time]),
            values=np.concatenate([self.values, later.values]),
            sigma=np.concatenate([self.sigma, later.sigma]),
            starts=(*self.starts, *[len(self.time) + start for start in later.starts]),
        )

    def settled_row(self, name: str, tolerance: float, *, first: int = 0) -> int | None:
        """The row since which a parameter stays within a fraction of its value (`settled_since`), counted from row
        `first`; None if it does not."""
        values = self.values[first:, self.names.index(name)]
        row = settled_since(values, tolerance)
        return row if is_settled(row, len(values)) else None


def settled_since(values: Array, tolerance: float) -> int:
    """The first row from which all values (N,) stay within `tolerance` of their own average (section 2.2.3 of the
    article)."""
    backwards = values[::-1]
    count = np.arange(1, len(values) + 1)
    mean = np.cumsum(backwards) / count
    deviation = np.maximum(np.maximum.accumulate(backwards) - mean, mean - np.minimum.accumulate(backwards))
    return len(values) - 1 - int(np.flatnonzero(deviation <= tolerance * np.abs(mean)).max())


def is_settled(row: int, rows: int) -> bool:
    """Whether a history of so many rows that settles at `row` does so before its last tenth."""
    return row <= (1 - LAST_FRACTION) * rows


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class IdentificationData(ComparedByContents):
    """The data of a result."""

    method: str
    vehicle: VehicleFile  # as identified, for the next command
    initial_vehicle: VehicleFile
    signals: tuple[str, ...]  # inputs and measured signals that were used
    parameters: tuple[Estimate, ...]
    derived: tuple[Estimate, ...]
    sensors: tuple[SensorError, ...]
    uncertain: tuple[Estimate, ...] = ()  # uncertain parameters of vehicle file and tyres, estimated too
    surroundings: Mapping[str, Number] = field(default_factory=dict)
    """As of `ObserverSettings`: what was estimated but has no place in a vehicle file, SI."""
    knowledge: Knowledge | None = None
    """The information of these logs and earlier ones on the truck; None in two stages."""
    covariance: Joint | None = None  # of all unknowns; the sensor errors of a log as "name@log"
    doubts: tuple[Doubt, ...] = ()  # evidence against an assumption; the estimates that it concerns are `doubtful`
    variance_budget: Mapping[str, Mapping[str, Number]] = field(default_factory=dict)
    """Of each parameter: by what fraction its variance would fall if each uncertain number were exact, the largest
    fraction first."""
    remaining_uncertainty: Mapping[str, Number] = field(default_factory=dict)
    """Of each uncertain number: the fraction of its prior standard deviation that remains after the logs."""
    histories: Mapping[str, ParameterHistory]  # "one stage", or "stage 1" and "stage 2" over all rounds
    logs: tuple[LogSummary, ...]
    fits: tuple[Fit, ...]
    log_likelihood: float | None = None
    """Of all logs at the maximum of the posterior, with the estimated noise of their residuals; None in two stages."""
    settings: CommonSettings
    rounds: int  # of both stages; one stage: steps
    findings: tuple[Finding, ...] = ()  # what is implausible in the signals
    notes: tuple[str, ...]
    version: str

    @property
    def stated_numbers(self) -> list[Estimate]:
        """The uncertain numbers whose standard deviation the settings state, as estimated."""
        return [e for e in self.uncertain if states_sigma(self.settings.given, split_log(e.name)[0])]
