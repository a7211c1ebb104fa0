"""Wrong samples at a start: no state is OK until several samples agree."""

from dataclasses import replace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.estimate.observe.monitor import SETTLED
from fifthwheel.truck import Vehicle

FAULTS = [
    ("yaw_rate.semitrailer", 0.1),
    ("yaw_rate.tractor", 0.5),
    ("roll_rate.semitrailer", 0.1),
    ("steer.tractor.front", 0.1),
]
"""Errors of one sample that gave states 7 to 128 sigma off with status OK."""


@pytest.fixture(scope="module")
def record(truck: Vehicle) -> fw.Record:
    return fw.simulate(truck, count=1, seed=2)


@pytest.fixture(scope="module")
def observer(truck: Vehicle, record: fw.Record) -> fw.Observer:
    return fw.Observer(truck, record.signals)


def with_error(record: fw.Record, signal: str, error: float, sample: int) -> fw.Record:
    signals = {name: values.copy() for name, values in record.signals.items()}
    signals[signal][sample] += error
    return replace(record, signals=signals)


def with_gap(record: fw.Record) -> fw.Record:
    """Its first half, and its second one 5 s later."""
    return replace(record, time=record.time + np.where(np.arange(len(record.time)) < 400, 0.0, 5.0))


def deviation(found: fw.States, clean: fw.States) -> float:
    """The largest one of a state with status OK from that without errors, in sigmas."""
    ok = found.status == fw.Status.OK
    return max(np.max(np.abs(values - clean.values[n])[ok] / found.sigma[n][ok]) for n, values in found.values.items())


@pytest.mark.parametrize(("signal", "error"), FAULTS)
@pytest.mark.parametrize("sample", [0, 3])
def test_a_wrong_sample_after_a_start_or_a_gap_gives_no_wrong_state_that_is_ok(
    observer: fw.Observer, record: fw.Record, signal: str, error: float, sample: int
) -> None:
    clean, late = observer.batch(record), with_gap(record)
    assert deviation(observer.batch(with_error(record, signal, error, sample)), clean) < 5
    assert deviation(observer.batch(with_error(late, signal, error, 400 + sample)), observer.batch(late)) < 5


def test_a_clean_start_settles_at_once(observer: fw.Observer, record: fw.Record) -> None:
    clean = observer.batch(with_gap(record))
    settling = np.flatnonzero(clean.status == fw.Status.SETTLING)
    np.testing.assert_array_equal(settling, [*range(SETTLED), *range(400, 400 + SETTLED)])
    assert (np.delete(clean.status, settling) == fw.Status.OK).all()


def test_a_wrong_sample_in_a_run_does_not_start_the_filter_again(observer: fw.Observer, record: fw.Record) -> None:
    found = observer.batch(with_error(record, "yaw_rate.tractor", 0.5, 300))
    assert (found.status[SETTLED:] == fw.Status.OK).all()


def test_single_samples_settle_as_a_record_does(observer: fw.Observer, record: fw.Record) -> None:
    wrong = with_error(record, "yaw_rate.semitrailer", 0.1, 0)
    expected = observer.batch(wrong)
    observer.reset()
    for i, time in enumerate(wrong.time[:60].tolist()):
        answer = observer.push({"time": time} | {name: values[i] for name, values in wrong.signals.items()})
        assert answer["status"] == expected.status[i]
        assert answer["sideslip.semitrailer"] == expected.values["sideslip.semitrailer"][i]
