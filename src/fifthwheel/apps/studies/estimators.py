"""What a study runs: an estimator of parameters, of states, or of both.

A study calls any object that fits `Estimator`. Settings of this package (`OneStage`, `TwoStage`, `LearnerSettings`)
become estimators by `as_estimator`, and functions that make an `Observer` by `StatesOf`. An own filter that fits
`StateEstimator` can take the place of `Observer`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import CommonSettings, OneStage, identify
from fifthwheel.estimate.observe import Observer
from fifthwheel.estimate.online import Learner, LearnerSettings
from fifthwheel.truck import Vehicle


class ParameterEstimate(Protocol):
    """One parameter, such as `identify.Estimate`."""

    @property
    def name(self) -> str:
        """Path of the parameter, or name of a quantity in `Vehicle.derived`."""

    @property
    def value(self) -> float:
        """SI."""

    @property
    def sigma(self) -> float | None:
        """Standard deviation, SI; None if there is none."""

    @property
    def verdict(self) -> str:
        """A `Verdict`, or any text."""


class StateHistory(Protocol):
    """States over a record of N samples, such as `observe.States`."""

    @property
    def values(self) -> Mapping[str, Array]:
        """(N,) each, by signal, SI; NaN where there is no estimate."""


class StateEstimator(Protocol):
    """States of a known vehicle, such as `Observer`.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> record = fw.simulate(truck, count=1)
        >>> estimator: fw.StateEstimator = fw.Observer(truck, record.signals)
        >>> estimator.batch(record).values["sideslip.semitrailer"].shape == record.time.shape
        True
    """

    def batch(self, record: Record, /) -> StateHistory:
        """The states at every sample of a record."""


@dataclass(frozen=True, kw_only=True)
class Estimates:
    """What an estimator returns.

    Example:
        >>> import fifthwheel as fw
        >>> fw.Estimates().parameters
        ()
    """

    parameters: Sequence[ParameterEstimate] = ()
    states: Mapping[str, Array] = field(default_factory=dict)
    """(N,) each, by signal, SI."""


@runtime_checkable
class Estimator(Protocol):
    """Parameters and states from one record. An estimator that runs in several processes can be pickled.

    Example:
        >>> import fifthwheel as fw
        >>> def yaw_rate(record, vehicle):
        ...     return fw.Estimates(states={"yaw_rate.tractor": record.signals["yaw_rate.tractor"]})
        >>> isinstance(yaw_rate, fw.Estimator)
        True
    """

    def __call__(self, record: Record, vehicle: Vehicle, /) -> Estimates:
        """Estimate from measured signals, without the truth, and the vehicle as known before.

        The values of the parameters to estimate are initial values.
        """


@dataclass(frozen=True)
class Identified:
    """`identify`, and the states that an `Observer` of the identified vehicle gives."""

    settings: CommonSettings = field(default_factory=OneStage)

    def __call__(self, record: Record, vehicle: Vehicle, /) -> Estimates:
        """Parameters, derived quantities and states."""
        result = identify([record], vehicle, self.settings)
        observer = Observer(result.vehicle, record.signals, result.observer_settings(record.name))
        return Estimates(parameters=(*result.parameters, *result.derived), states=observer.batch(record).values)


@dataclass(frozen=True)
class Learned:
    """A recursive `Learner`: its parameters at the end, and its states at each sample."""

    settings: OneStage = field(default_factory=OneStage)
    learner: LearnerSettings = field(default_factory=LearnerSettings)

    def __call__(self, record: Record, vehicle: Vehicle, /) -> Estimates:
        """Parameters and states."""
        learner = Learner(vehicle, record.signals, self.settings, learner=self.learner)
        signals = {"time": record.time, **record.signals}
        rows = np.column_stack(list(signals.values())).tolist()
        samples = [learner.push(dict(zip(signals, row, strict=True))) for row in rows]
        names = [name for name in samples[0] if f"{name}.sigma" in samples[0]]
        states = {name: np.array([sample[name] for sample in samples]) for name in names}
        return Estimates(parameters=learner.parameters, states=states)


@dataclass(frozen=True)
class StatesOf:
    """The states of a vehicle as it is, without identification.

    Example:
        >>> import fifthwheel as fw
        >>> kalman_filter = fw.StatesOf(lambda vehicle, record: fw.Observer(vehicle, record.signals))
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> sorted(kalman_filter(fw.simulate(truck, count=1), truck).states)[:2]
        ['articulation.semitrailer', 'load_transfer.semitrailer']
    """

    make: Callable[[Vehicle, Record], StateEstimator]
    """Makes the state estimator of a vehicle for the signals of a record."""

    def __call__(self, record: Record, vehicle: Vehicle, /) -> Estimates:
        """The states."""
        return Estimates(states=self.make(vehicle, record).batch(record).values)


def observer(vehicle: Vehicle, record: Record) -> Observer:
    """The Kalman filter of this package, for `StatesOf`."""
    return Observer(vehicle, record.signals)


Settings = CommonSettings | LearnerSettings
"""Settings that `as_estimator` accepts."""


def as_estimator(given: Estimator | Settings) -> Estimator:
    """An estimator from itself, or from settings of `identify` or of a `Learner`; FifthwheelError for anything else."""
    if isinstance(given, CommonSettings):
        return Identified(given)
    if isinstance(given, LearnerSettings):
        return Learned(learner=given)
    if not callable(given) or (isinstance(given, type) and issubclass(given, Settings)):
        cure = f"write {given.__name__}()" if isinstance(given, type) else "give one of them"
        raise FifthwheelError(
            "estimator: expected OneStage, TwoStage, LearnerSettings or a function of a record and a vehicle, got"
            f" {given!r}; {cure}"
        )
    return given
