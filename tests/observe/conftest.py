"""A truck, drives of it, and ways to spoil them."""

from collections.abc import Iterator

import numpy as np
import pytest

from fifthwheel.logs import Record
from fifthwheel.observe import Observer
from fifthwheel.simulate import simulate
from fifthwheel.vehicle import Vehicle, get

STEER = "steer.tractor.front"
YAWS = ("yaw_rate.tractor", "yaw_rate.semitrailer")
ROLLS = ("roll_rate.tractor", "roll_rate.semitrailer")


@pytest.fixture(scope="session")
def truck() -> Vehicle:
    return get("cheng_cebon_2011")


@pytest.fixture(scope="session")
def drive(truck) -> Record:
    """Two lane changes, 16 s at 100 Hz."""
    return simulate(truck, count=2, seed=7)


def put(record: Record, name: str, start: float, stop: float, value: float) -> Record:
    """The record with a signal at `value` where start <= time < stop, s."""
    values = record.signals[name].copy()
    values[(record.time >= start) & (record.time < stop)] = value
    return record.with_signals({name: values})


def rows(record: Record, keep: np.ndarray) -> Record:
    """Only some rows of a record."""
    return Record(
        time=record.time[keep],
        signals={n: v[keep] for n, v in record.signals.items()},
        reference={n: v[keep] for n, v in record.reference.items()},
        name=record.name,
    )


def samples(record: Record, *, leave_out: bool = False) -> Iterator[dict[str, float]]:
    """The record sample by sample, missing values as NaN or left out."""
    for k, time in enumerate(record.time.tolist()):
        sample = {name: float(values[k]) for name, values in record.signals.items()}
        yield {"time": time} | {n: v for n, v in sample.items() if not (leave_out and np.isnan(v))}


def pushed(observer: Observer, record: Record, *, leave_out: bool = False) -> dict[str, np.ndarray]:
    """Every column of the answers to a record pushed sample by sample."""
    answers = [observer.push(sample) for sample in samples(record, leave_out=leave_out)]
    return {name: np.array([answer[name] for answer in answers]) for name in answers[0]}


def batched(observer: Observer, record: Record) -> dict[str, np.ndarray]:
    """The same columns from the record as a whole."""
    states = observer.batch(record)
    sigma = {f"{name}.sigma": values for name, values in states.sigma.items()}
    return {"time": states.time, "status": states.status, **states.values, **sigma}


def assert_same(one: dict[str, np.ndarray], other: dict[str, np.ndarray], part: slice = slice(None)) -> None:
    """Bit for bit."""
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name][part], other[name][part], err_msg=name)
