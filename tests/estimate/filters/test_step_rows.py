"""Rows of a compiled step from a record."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fifthwheel import truck as vehicle
from fifthwheel.base.errors import SignalError
from fifthwheel.base.options import TyreLaw
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.step_rows import (
    SMALLEST_PLAY,
    WIDTH,
    StepRows,
    corrected_inputs,
    play_contact,
    step_rows,
)
from fifthwheel.model import dynamics
from fifthwheel.model.simulate import simulate
from tests.estimate.observe.conftest import STEER, YAWS, put, rows

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
    assert np.isfinite(actual[:]).all()
    weights = actual[:][actual.sample_indices][:, -3:]
    np.testing.assert_array_equal(weights[:, 0], np.isfinite(with_gap.signals[YAWS[0]]))
    assert (weights[:, 1] == 1).all()
    assert (weights[:, 2] == 0).all()  # the record has no articulation angle
    np.testing.assert_allclose(
        actual[:][actual.sample_indices][:, 3:5], np.c_[record.signals["speed"], record.signals[STEER]], atol=1e-12
    )
    assert actual[:][:, 0].sum() == pytest.approx(record.time[-1] - record.time[0])
    first = {name: record.signals[name][0] for name in ("speed", STEER)}
    assert actual.first == pytest.approx(first, rel=1e-12)
    assert actual.steer_sigma == pytest.approx(np.std(record.signals[STEER]))


def test_low_sampling_rate_gives_additional_rows(record: Record) -> None:
    coarse = rows(record, np.arange(0, len(record), 20))
    actual = rows_of(coarse)
    assert len(actual[:]) > 2 * len(coarse)
    between = np.setdiff1d(np.arange(len(actual[:])), actual.sample_indices)
    assert (actual[:][between, -3:] == 0).all()  # without measurements
    np.testing.assert_allclose(actual[:][:, 4], np.interp(actual.time, coarse.time, coarse.signals[STEER]), atol=1e-15)


def test_delay_shifts_an_input(record: Record) -> None:
    actual = rows_of(record, delay=0.1)
    shifted = np.interp(record.time + 0.1, record.time, record.signals[STEER])
    np.testing.assert_allclose(actual[:][actual.sample_indices][:, 4], shifted, atol=2e-5)  # by a spline


def test_gap_in_an_input(record: Record) -> None:
    assert np.isfinite(rows_of(put(record, STEER, 3, 3.4, np.nan))[:]).all()
    for name in (STEER, "speed"):
        with pytest.raises(SignalError, match=rf"^{name}: "):
            rows_of(put(record, name, 3, 4, np.nan))


steer_angles = st.lists(st.floats(-0.05, 0.05), min_size=2, max_size=40).map(np.array)
plays = st.integers(4, 40).map(lambda n: n * 0.0005)


def backlash(steer: np.ndarray, play: float) -> np.ndarray:
    """Angle of the wheels behind a play, by its definition: they move only as far as a contact pushes them."""
    wheels = [steer[0]]
    for angle in steer[1:]:
        wheels.append(min(max(wheels[-1], angle - play / 2), angle + play / 2))
    return np.array(wheels)


@given(steer_angles, plays)
def test_play_is_a_backlash(steer: np.ndarray, play: float) -> None:
    contact = play_contact(steer, play)
    assert contact[0] == 0.0
    assert np.abs(contact).max() <= 0.5
    np.testing.assert_allclose(steer - play * contact, backlash(steer, play), atol=1e-12)


@given(steer_angles, plays)
def test_play_does_not_depend_on_the_sampling_rate(steer: np.ndarray, play: float) -> None:
    """Samples between the extremes of the steer angle change nothing."""
    finer = np.interp(np.arange(5 * len(steer) - 4) / 5, np.arange(len(steer)), steer)
    np.testing.assert_allclose(play_contact(finer, play)[::5], play_contact(steer, play), atol=1e-9)


@given(plays, st.floats(0.02, 0.05))
def test_contact_changes_sides_after_a_reversal(play: float, angle: float) -> None:
    """The wheels stand still until the steering has turned back by the whole play."""
    steer = np.array([0.0, angle, angle - play / 2, angle - play, angle - 1.5 * play])
    np.testing.assert_allclose(play_contact(steer, play), [0.0, 0.5, 0.0, -0.5, -0.5], atol=1e-9)


def test_the_contact_of_a_small_play_does_not_follow_the_noise() -> None:
    noisy = 0.0001 * np.random.default_rng(1).normal(size=1000)
    np.testing.assert_array_equal(play_contact(noisy, 0.0), play_contact(noisy, SMALLEST_PLAY))
    assert np.abs(play_contact(noisy, 1e-5)).max() < 0.5
    # small changes of an estimated play do not change the contact, so that a search does not stop there
    np.testing.assert_array_equal(play_contact(20 * noisy, 0.0051), play_contact(20 * noisy, 0.0049))


def test_delay_and_play_of_an_input(record: Record) -> None:
    """The wheels follow gain times the angle of the sensor, behind a play, and the log is late."""
    steer, play, gain, delay = record.signals[STEER], 0.005, 1.25, 0.07
    errors = {f"{STEER}.{kind}": value for kind, value in (("delay", delay), ("play", play), ("gain", gain))}
    actual = corrected_inputs(record, MODEL.inputs, errors)
    wheels = np.interp(record.time + delay, record.time, backlash(gain * steer, play))
    np.testing.assert_allclose(gain * actual[STEER], wheels, atol=0.02 * play)
    extended = dynamics.model(TRUCK, YAWS, roll=False, extended=True)
    inputs = corrected_inputs(record, extended.inputs, errors)
    assert set(inputs) == set(extended.inputs)
    contact, rate = (inputs[name(STEER)] for name in (dynamics.contact_input, dynamics.rate_input))
    np.testing.assert_allclose(inputs[STEER] - play / gain * contact, actual[STEER], atol=1e-12)
    expected = np.gradient(actual[STEER], record.time)
    starts = np.flatnonzero(np.diff(np.abs(expected) > 1e-9))  # there the rate jumps, which a difference smooths
    inside = np.abs(np.arange(len(rate))[:, None] - starts).min(axis=1) > 3
    assert inside.mean() > 0.9
    inside[0] = inside[-20:] = False  # the input is constant beyond the end of the log
    np.testing.assert_allclose(rate[inside], expected[inside], atol=0.1 * np.abs(rate).max())


@pytest.mark.parametrize("tyres", ["linear", "saturating"])
@pytest.mark.parametrize("delay", [0.0, 0.3])
def test_speed_and_its_derivative_are_late_by_its_delay(record: Record, tyres: TyreLaw, delay: float) -> None:
    """The grade acts as a deceleration, and is not late; the steps do not depend on the delay."""
    wave, grade = np.sin(0.5 * record.time), 0.03 * np.cos(record.time)
    changed = record.with_signals({"speed": 20.0 + wave, "grade": grade})
    model = dynamics.model(TRUCK, YAWS, roll=False, tyres=tyres, braking=True)
    assert model.inputs == ("speed", STEER, dynamics.SPEED_RATE)
    actual = step_rows(model, TRUCK, changed, errors={dynamics.SPEED_DELAY: delay})
    speed, steer, rate = actual[:][actual.sample_indices][150:-150, 4:7].T
    late, along = 0.5 * (record.time + delay)[150:-150], STANDARD_GRAVITY * np.sin(np.arctan(grade))[150:-150]
    np.testing.assert_allclose(speed, 20.0 + np.sin(late), atol=1e-3)
    np.testing.assert_allclose(rate, 0.5 * np.exp(-((0.5 * WIDTH) ** 2) / 2) * np.cos(late) + along, atol=1e-3)
    np.testing.assert_array_equal(steer, record.signals[STEER][150:-150])
    assert actual.steer_sigma == pytest.approx(np.std(record.signals[STEER]))


def test_the_delay_of_the_speed_does_not_change_the_steps(record: Record) -> None:
    """Else the cost of a search along it would jump."""
    coarse = rows(record, np.arange(0, len(record), 10))
    coarse = coarse.with_signals({"speed": np.linspace(5.0, 30.0, len(coarse))})
    times = [step_rows(MODEL, TRUCK, coarse, errors={dynamics.SPEED_DELAY: delay}).time for delay in (0.0, 0.4)]
    assert len(times[0]) > len(coarse)
    np.testing.assert_array_equal(times[0], times[1])


@pytest.mark.parametrize("count", [3, 4, 40])
def test_an_input_of_few_samples_is_shifted_too(record: Record, count: int) -> None:
    """A straight line, with its rate; constant outside of the log, where the rate is 0 or not known."""
    few = rows(record, np.arange(count))
    few = few.with_signals({STEER: 0.01 + 0.2 * few.time})
    names = ("speed", STEER, dynamics.contact_input(STEER), dynamics.rate_input(STEER))
    shifted = corrected_inputs(few, names, {f"{STEER}.delay": 0.01})
    np.testing.assert_allclose(shifted[STEER], 0.01 + 0.2 * np.minimum(few.time + 0.01, few.time[-1]))
    expected = 0.2 * (few.time + 0.01 <= few.time[-1] + 1e-12) if count > 3 else np.zeros(count)
    np.testing.assert_allclose(shifted[dynamics.rate_input(STEER)], expected, atol=1e-9)
