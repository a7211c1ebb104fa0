"""Rows of a compiled step from a record."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from fifthwheel.base.errors import SignalError
from fifthwheel.base.options import TyreLaw
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.step_rows import (
    CUT,
    SMALLEST_PLAY,
    STEP,
    WIDTH,
    SpeedCurve,
    Spline,
    StepRows,
    corrected_inputs,
    play_contact,
    step_rows,
)
from fifthwheel.model import dynamics
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.estimate.observe.conftest import STEER, YAWS, put, rows

TRUCK = get("cheng_cebon_2011").with_logged_steering({STEER}, "the test")
MODEL = dynamics.model(TRUCK, (*YAWS, "articulation.semitrailer"), roll=False)


@pytest.fixture(scope="module")
def record() -> Record:
    """Two lane changes, 16 s at 100 Hz, without an articulation angle."""
    return simulate(TRUCK, count=2, seed=7)


def rows_of(record: Record) -> StepRows:
    return step_rows(MODEL, TRUCK, record)


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
    assert np.isfinite(rows_of(put(record, STEER, 3, 3.4, np.nan))[:]).all()
    for name in (STEER, "speed"):
        with pytest.raises(SignalError, match=rf"^{name}: "):
            rows_of(put(record, name, 3, 4, np.nan))


def test_low_sampling_rate_gives_additional_rows(record: Record) -> None:
    coarse = rows(record, np.arange(0, len(record), 20))
    actual = rows_of(coarse)
    assert len(actual[:]) > 2 * len(coarse)
    between = np.setdiff1d(np.arange(len(actual[:])), actual.sample_indices)
    assert (actual[:][between, -3:] == 0).all()  # without measurements
    np.testing.assert_allclose(actual[:][:, 4], np.interp(actual.time, coarse.time, coarse.signals[STEER]), atol=1e-15)


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


@pytest.mark.parametrize("count", [4, 5, 1000])
def test_values_and_derivatives_of_the_spline_are_those_of_scipy(count: int) -> None:
    generator = np.random.default_rng(count)
    time = np.cumsum(generator.uniform(0.001, 0.02, count))  # steps of very different length
    values = np.cumsum(generator.normal(size=count))
    at = np.concatenate([time, np.sort(generator.uniform(time[0], time[-1], 3 * count))])
    expected = CubicSpline(time, values)
    shifted, rate = Spline(time, values)(at)
    np.testing.assert_allclose(shifted, expected(at), rtol=1e-12, atol=1e-12 * np.abs(values).max())
    np.testing.assert_allclose(rate, expected(at, 1), rtol=1e-10, atol=1e-11 * np.abs(expected(at, 1)).max())


def test_the_speed_curve_equals_weighted_least_squares() -> None:
    """The parabola gives the speed, the line its rate; also near the ends, where there are samples on one side only."""
    time = np.linspace(0, 99 * STEP, 100)
    speed = 20 + np.cumsum(np.random.default_rng(0).normal(0, 0.1, time.size))
    speeds, _, rates, _ = SpeedCurve(time, speed)(time)
    for k in (0, 1, 10, 50, 98, 99):
        t = time - time[k]
        near = np.abs(t) <= CUT * WIDTH
        weights = np.exp(-(t[near] ** 2) / (4 * WIDTH**2))  # of the residuals, not of their squares
        parabola, line = (np.polyfit(t[near], speed[near], degree, w=weights) for degree in (2, 1))
        np.testing.assert_allclose([speeds[k], rates[k]], [parabola[-1], line[0]], rtol=1e-9)


def test_a_constant_rate_of_the_speed_is_exact_and_noise_has_its_sigma() -> None:
    """Inside the log and outside of it, with missing samples; of the slope of a line with Gaussian weights."""
    dt, sigma = 0.01, 0.1
    time = np.arange(0, 10, dt)
    time = time[(time < 4) | (time > 4.4)]
    at = np.linspace(-0.5, 10.5, 500)
    speeds, slopes, rates, changes = SpeedCurve(time, 20 - 0.8 * time)(at)
    np.testing.assert_allclose(speeds, 20 - 0.8 * at, atol=1e-9)
    np.testing.assert_allclose([slopes, rates], -0.8, atol=1e-9)
    np.testing.assert_allclose(changes, 0.0, atol=1e-9)
    noise = np.random.default_rng(1).normal(0, sigma, 200_000)
    _, _, rates, _ = SpeedCurve(dt * np.arange(noise.size), 20 + noise)(np.arange(10, 1990, 0.5))
    assert rates.std() == pytest.approx(sigma * np.sqrt(dt / (4 * np.sqrt(np.pi) * WIDTH**3)), rel=0.03)


def test_the_speed_curve_has_no_delay_and_is_smooth() -> None:
    """Of a speed that falls, is constant and rises, and of one in steps, as on a CAN bus."""
    time = np.cumsum(np.random.default_rng(0).uniform(0.005, 0.015, 1000))
    slope = np.select([time < 3, time < 7], [-2.0, 0.0], 1.0)
    speed = 20 + np.concatenate([[0.0], np.cumsum(slope[1:] * np.diff(time))])
    speeds, _, rates, _ = SpeedCurve(time, speed)(time)
    settled = np.abs(time[:, None] - [3.0, 7.0]).min(axis=1) > CUT * WIDTH
    np.testing.assert_allclose(speeds[settled], speed[settled], atol=0.02)
    np.testing.assert_allclose(rates[settled], slope[settled], atol=0.02)
    for middle, height in ((3.0, -1.0), (7.0, 0.5)):  # half way where the slope changes
        assert np.interp(middle, time, rates) == pytest.approx(height, abs=0.03)
    steps = SpeedCurve(time, np.round(speed, 1))
    np.testing.assert_allclose(steps(time)[2][settled], slope[settled], atol=0.1)
    inside, h = np.linspace(time[0] + 0.1, time[-1] - 0.1, 300), 1e-4
    now, later, before = (steps(inside + s) for s in (0.0, h, -h))
    for value, its_slope in ((0, 1), (2, 3)):
        np.testing.assert_allclose(now[its_slope], (later[value] - before[value]) / (2 * h), atol=1e-3)
