"""From a record to rows of the compiled step."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel import dynamics
from fifthwheel.errors import SignalError
from fifthwheel.observe.prepare import fast_enough, prepare, steered_as_logged

from .conftest import STEER, YAWS, put, rows


def test_axles_without_a_signal_are_locked(truck, drive):
    assert len(truck.steer_signals()) == 4
    assert steered_as_logged(truck, drive).steer_signals() == (STEER,)
    both = drive.with_signals({"steer.semitrailer.rear": np.zeros(len(drive))})
    assert steered_as_logged(truck, both).steer_signals() == (STEER, "steer.semitrailer.rear")
    assert steered_as_logged(truck, drive).parameters() == truck.parameters()
    with pytest.raises(SignalError, match=r"^steer\.tractor\.front: not in simulated"):
        steered_as_logged(truck, replace(drive, signals={"speed": drive.signals["speed"]}))


def test_stretches_that_are_fast_enough(drive):
    assert [len(part) for part in fast_enough(drive, 5.0)] == [len(drive)]
    slow = put(put(drive, "speed", 3, 4, 2.0), "speed", 15, 99, 2.0)
    spans = [part.span for part in fast_enough(slow, 5.0)]
    np.testing.assert_allclose(spans, [(0, 2.99), (4, 14.99)])
    holed = rows(slow, (slow.time < 7) | (slow.time > 9.5))
    spans = [part.span for part in fast_enough(holed, 5.0)]
    np.testing.assert_allclose(spans, [(0, 2.99), (4, 6.99), (9.51, 14.99)])
    for part in fast_enough(holed, 5.0):
        assert (part.signals["speed"] >= 5).all()


def test_nowhere_fast_enough(drive):
    with pytest.raises(SignalError, match=r"^speed: at most 2\.0 m/s in simulated, 5 m/s needed"):
        fast_enough(put(drive, "speed", 0, 99, 2.0), 5.0)
    with pytest.raises(SignalError, match=r"^speed: "):
        fast_enough(put(drive, "speed", 0, 99, np.nan), 5.0)


def rows_of(truck, record, **options):
    truck = steered_as_logged(truck, record)
    return prepare(dynamics.model(truck, (*YAWS, "articulation.semitrailer"), roll=False), truck, record, **options)


def test_rows_of_a_record(truck, drive):
    thin = put(drive, YAWS[0], 3, 4, np.nan)
    found = rows_of(truck, thin)
    assert len(found.places) == len(drive)
    np.testing.assert_array_equal(found.time[found.places], drive.time)
    assert np.isfinite(found.rows).all()
    weights = found.rows[found.places][:, -3:]
    np.testing.assert_array_equal(weights[:, 0], np.isfinite(thin.signals[YAWS[0]]))
    assert (weights[:, 1] == 1).all()
    assert (weights[:, 2] == 0).all()  # no such sensor
    np.testing.assert_array_equal(found.rows[found.places][:, 3:5], np.c_[drive.signals["speed"], drive.signals[STEER]])
    assert found.rows[:, 0].sum() == pytest.approx(drive.time[-1] - drive.time[0])


def test_coarse_records_get_steps_in_between(truck, drive):
    coarse = rows(drive, np.arange(0, len(drive), 20))
    found = rows_of(truck, coarse)
    assert len(found.rows) > 2 * len(coarse)
    between = np.setdiff1d(np.arange(len(found.rows)), found.places)
    assert (found.rows[between, -3:] == 0).all()  # nothing is measured there
    np.testing.assert_allclose(found.rows[:, 4], np.interp(found.time, coarse.time, coarse.signals[STEER]), atol=1e-15)


def test_inputs_that_are_late_are_moved(truck, drive):
    found = rows_of(truck, drive, errors={f"{STEER}.delay": 0.1})
    moved = np.interp(drive.time + 0.1, drive.time, drive.signals[STEER])
    np.testing.assert_array_equal(found.rows[found.places][:, 4], moved)


def test_a_hole_in_an_input(truck, drive):
    small = rows_of(truck, put(drive, STEER, 3, 3.4, np.nan))
    assert np.isfinite(small.rows).all()
    for name in (STEER, "speed"):
        with pytest.raises(SignalError, match=rf"^{name}: "):
            rows_of(truck, put(drive, name, 3, 4, np.nan))
