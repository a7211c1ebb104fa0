"""A vehicle, a record of it, and functions that damage a record."""

from collections.abc import Iterator

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import Observer, Status
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, get

STEER = "steer.tractor.front"
YAWS = ("yaw_rate.tractor", "yaw_rate.semitrailer")
EXACT = {"bank": 0.0, "steer_offset": 0.0}
"""Settings of an observer on a level road without an offset of the steering."""
ROLLS = ("roll_rate.tractor", "roll_rate.semitrailer")


@pytest.fixture(scope="session")
def truck() -> Vehicle:
    return get("cheng_cebon_2011")


@pytest.fixture(scope="session")
def lane_changes(truck) -> Record:
    """Two lane changes, 16 s at 100 Hz."""
    return simulate(truck, count=2, seed=7)


def put(record: Record, name: str, start: float, stop: float, value: float) -> Record:
    """The record with a signal set to `value` where start <= time < stop, s."""
    values = record.signals[name].copy()
    values[(record.time >= start) & (record.time < stop)] = value
    return record.with_signals({name: values})


def rows(record: Record, keep: np.ndarray) -> Record:
    """Some samples of a record."""
    return Record(
        time=record.time[keep],
        signals={n: v[keep] for n, v in record.signals.items()},
        reference={n: v[keep] for n, v in record.reference.items()},
        name=record.name,
    )


def but_settling(status: np.ndarray) -> np.ndarray:
    """Statuses with OK in place of SETTLING."""
    return np.where(status == Status.SETTLING, Status.OK, status)


def samples(record: Record, *, omit_missing: bool = False) -> Iterator[dict[str, float]]:
    """The samples of a record; missing values are NaN or omitted."""
    for k, time in enumerate(record.time.tolist()):
        sample = {name: float(values[k]) for name, values in record.signals.items()}
        yield {"time": time} | {n: v for n, v in sample.items() if not (omit_missing and np.isnan(v))}


def pushed(observer: Observer, record: Record, *, omit_missing: bool = False) -> dict[str, np.ndarray]:
    """Every column of the answers to the pushed samples of a record."""
    answers = [observer.push(sample) for sample in samples(record, omit_missing=omit_missing)]
    return {name: np.array([answer[name] for answer in answers]) for name in answers[0]}


def batched(observer: Observer, record: Record) -> dict[str, np.ndarray]:
    """The same columns from `Observer.batch`."""
    states = observer.batch(record)
    sigma = {f"{name}.sigma": values for name, values in states.sigma.items()}
    return {"time": states.time, "status": states.status, "nis": states.nis, **states.values, **sigma}


def assert_same(actual: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> None:
    """All columns are equal, bit for bit."""
    assert actual.keys() == expected.keys()
    for name in actual:
        np.testing.assert_array_equal(actual[name], expected[name], err_msg=name)
