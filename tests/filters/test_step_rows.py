"""Rows of a compiled step from a record."""

import numpy as np
import pytest

from fifthwheel import dynamics, vehicle
from fifthwheel.errors import SignalError
from fifthwheel.filters.step_rows import StepRows, step_rows
from fifthwheel.record import Record
from fifthwheel.simulate import simulate
from tests.observe.conftest import STEER, YAWS, put, rows

TRUCK = vehicle.get("cheng_cebon_2011").with_logged_steering({STEER}, "the test")
MODEL = dynamics.model(TRUCK, (*YAWS, "articulation.semitrailer"), roll=False)


@pytest.fixture(scope="module")
def record() -> Record:
    """Two lane changes, 16 s at 100 Hz, without an articulation angle."""
    return simulate(TRUCK, count=2, seed=7)


def rows_of(record: Record, delay: float = 0.0) -> StepRows:
    return step_rows(MODEL, TRUCK, record, errors={f"{STEER}.delay": delay})


def test_rows_contain_inputs_and_measurements(record: Record) -> None:
    with_gap = put(record, YAWS[0], 3, 4, np.nan)
    actual = rows_of(with_gap)
    assert len(actual.sample_indices) == len(record)
    np.testing.assert_array_equal(actual.time[actual.sample_indices], record.time)
    assert np.isfinite(actual.rows).all()
    weights = actual.rows[actual.sample_indices][:, -3:]
    np.testing.assert_array_equal(weights[:, 0], np.isfinite(with_gap.signals[YAWS[0]]))
    assert (weights[:, 1] == 1).all()
    assert (weights[:, 2] == 0).all()  # the record has no articulation angle
    np.testing.assert_array_equal(
        actual.rows[actual.sample_indices][:, 3:5], np.c_[record.signals["speed"], record.signals[STEER]]
    )
    assert actual.rows[:, 0].sum() == pytest.approx(record.time[-1] - record.time[0])
    assert actual.first == {"speed": record.signals["speed"][0], STEER: record.signals[STEER][0]}
    assert actual.steer_sigma == pytest.approx(np.std(record.signals[STEER]))


def test_low_sampling_rate_gives_additional_rows(record: Record) -> None:
    coarse = rows(record, np.arange(0, len(record), 20))
    actual = rows_of(coarse)
    assert len(actual.rows) > 2 * len(coarse)
    between = np.setdiff1d(np.arange(len(actual.rows)), actual.sample_indices)
    assert (actual.rows[between, -3:] == 0).all()  # without measurements
    np.testing.assert_allclose(
        actual.rows[:, 4], np.interp(actual.time, coarse.time, coarse.signals[STEER]), atol=1e-15
    )


def test_delay_shifts_an_input(record: Record) -> None:
    actual = rows_of(record, delay=0.1)
    shifted = np.interp(record.time + 0.1, record.time, record.signals[STEER])
    np.testing.assert_allclose(actual.rows[actual.sample_indices][:, 4], shifted, atol=2e-5)  # by a spline


def test_gap_in_an_input(record: Record) -> None:
    assert np.isfinite(rows_of(put(record, STEER, 3, 3.4, np.nan)).rows).all()
    for name in (STEER, "speed"):
        with pytest.raises(SignalError, match=rf"^{name}: "):
            rows_of(put(record, name, 3, 4, np.nan))
