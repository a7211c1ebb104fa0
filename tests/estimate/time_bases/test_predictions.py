"""Predicted channels and their lags."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.time_bases.predictions import RATE, lag_curve, predict_channels
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.estimate.time_bases.examples import SOURCES, TIME, WHITE, YAW, YAW2, excitation, late, shifted, slow_noise

TRUCK = get("cheng_cebon_2011")
RECORD = simulate(TRUCK, count=1, seed=3)
STEER = "steer.tractor.front"


def changed(factors):
    """The truck with factors of all parameters whose path matches."""
    values = TRUCK.parameters()
    return TRUCK.replace(
        {n: factor * v for n, v in values.items() for (unit, end), factor in factors.items() if matches(n, unit, end)}
    )


def matches(name, unit, end):
    return name.startswith(f"{unit}.") and name.rpartition(".")[2] == end


def response(vehicle, name, time):
    """Of a channel to speed and steer angle of the record at its own rate, then at other instants."""
    steered = vehicle.with_logged_steering(RECORD.signals, RECORD.name)
    model, n = dynamics.model(steered, (name,), roll=True), len(dynamics.state_names(steered, roll=True))
    inputs = {signal: RECORD.signals[signal] for signal in ("speed", STEER)}
    values = dynamics.all_parameters(steered, (name,))
    return np.interp(time, RECORD.time, free_response(model, values, RECORD.time, inputs, np.zeros(n))[1][:, 0])


def assert_close(predicted, expected, known):
    """Within the error of inputs that are linear between samples at 25 Hz."""
    assert np.abs(predicted - expected)[known].max() < 0.01 * np.abs(expected).max()


def test_variants_of_a_known_vehicle_have_other_stiffness():
    """Its own, 0.7 and 1.4 of all axles, and of the towed units only."""
    prediction = predict_channels(RECORD, TRUCK)
    assert not prediction.generic
    assert (prediction.steer, prediction.leading) == (STEER, "yaw_rate.tractor")
    assert set(prediction.names) == {n for n in RECORD.signals if "rate" in n}
    i = prediction.names.index(YAW2)
    for response_of, (leading, towed) in zip(
        prediction.predicted, [(1, 1), (0.7, 0.7), (1.4, 1.4), (1, 0.7), (1, 1.4)], strict=True
    ):
        stiffness = {("tractor", "cornering_stiffness"): leading, ("semitrailer", "cornering_stiffness"): towed}
        known = np.isfinite(response_of[:, i])
        assert np.flatnonzero(known)[0] == 25  # the first second depends on the initial state
        assert_close(response_of[:, i], response(changed(stiffness), YAW2, prediction.time), known)


def test_of_other_units_only_the_tractor_is_predicted_without_a_vehicle():
    double = get("b_double")
    record = simulate(double, count=1, seed=3)
    assert {name.rpartition(".")[2] for name in predict_channels(record).names} == {"tractor"}
    assert {name.rpartition(".")[2] for name in predict_channels(record, double).names} > {"lead", "semitrailer"}


def test_variants_of_an_unknown_vehicle_have_other_stiffness_and_length():
    """Tractor and semitrailer with 0.6, 1 and 1.7 of the stiffness and 0.8 to 1.7 of the length of the trailer."""
    prediction = predict_channels(RECORD)
    assert prediction.generic
    i, predicted = prediction.names.index(YAW2), iter(prediction.predicted)
    for stiffness in (0.6, 1.0, 1.7):
        for length in (0.8, 1.0, 1.3, 1.7):
            vehicle = changed(
                {
                    ("tractor", "cornering_stiffness"): stiffness,
                    ("semitrailer", "cornering_stiffness"): stiffness,
                    ("semitrailer", "position"): length,
                    ("semitrailer", "cog"): length,
                    ("semitrailer", "yaw_inertia"): length**2,
                }
            )
            channel = next(predicted)[:, i]
            assert_close(channel, response(vehicle, YAW2, prediction.time), np.isfinite(channel))
    assert next(predicted, None) is None


def test_measured_channels_on_the_grid():
    """At multiples of 1/25 s; NaN where the vehicle is too slow or a channel has no samples."""
    values = RECORD.signals[YAW2].copy()
    values[400:500] = np.nan
    speed = RECORD.signals["speed"].copy()
    speed[300:360] = 4.0
    prediction = predict_channels(RECORD.with_signals({YAW2: values, "speed": speed}), TRUCK)
    i = prediction.names.index(YAW2)
    np.testing.assert_allclose(prediction.time * 25, np.rint(prediction.time * 25))
    measured = prediction.measured[:, i]
    gap = (prediction.time > 4.1) & (prediction.time < 4.9)
    assert np.isnan(measured[gap]).all()
    assert np.isfinite(measured[np.abs(prediction.time - 2) < 1.5]).all()
    present = np.isfinite(measured)
    truth = np.interp(prediction.time, RECORD.time, RECORD.signals[YAW2])
    assert np.corrcoef(measured[present], truth[present])[0, 1] > 0.99
    slow = (prediction.time > 3.0) & (prediction.time < 4.6)  # one more second from the new start
    assert np.isnan(prediction.predicted[0, slow, i]).all()
    assert np.isfinite(prediction.predicted[0, np.abs(prediction.time - 6.0) < 1.3, i]).all()


def test_a_wheel_speed_difference_needs_the_model_with_roll():
    name = "wheel_speed_difference.semitrailer"
    record = simulate(TRUCK, count=1, sensors={"yaw_rate.tractor": 1.5e-5, name: 1e-6})
    prediction = predict_channels(record, TRUCK)
    assert prediction.names == ("yaw_rate.tractor", name)
    predicted, measured = prediction.predicted[0, :, 1], prediction.measured[:, 1]
    known = np.isfinite(predicted + measured)
    assert np.corrcoef(predicted[known], measured[known])[0, 1] > 0.9


def test_records_that_cannot_be_predicted():
    other = {"speed": RECORD.signals["speed"], STEER: RECORD.signals[STEER]}
    for names in ((), (f"{YAW2}2",), ("articulation.tractor",), ("lateral_velocity.tractor",)):
        nothing = replace(RECORD, signals=other | dict.fromkeys(names, RECORD.signals[YAW2]))
        assert predict_channels(nothing, TRUCK) is None
    for quantity in ("articulation.semitrailer", "roll.semitrailer", "lateral_acceleration.tractor"):
        one = replace(RECORD, signals=other | {quantity: RECORD.signals[YAW2]})
        assert predict_channels(one, TRUCK).names == (quantity,)
    fast = RECORD.with_signals({"speed": RECORD.signals["speed"] + 21.0})
    assert fast.signals["speed"].max() > 45
    assert predict_channels(fast, TRUCK) is None
    assert predict_channels(replace(RECORD.cut(0, 0.235), name="short"), TRUCK) is None


def test_only_stable_variants_are_used():
    """A truck with soft drive axles is unstable at the highest speed of the record, in some of its variants."""
    drive = "tractor.drive.cornering_stiffness"
    soft = TRUCK.replace({drive: 0.7 * TRUCK.parameters()[drive]})
    speed, stable = float(RECORD.signals["speed"].max()), 0
    for leading, towed in ((1, 1), (0.7, 0.7), (1.4, 1.4), (1, 0.7), (1, 1.4)):
        stiffness = {n: v for n, v in soft.parameters().items() if n.endswith("cornering_stiffness")}
        factors = {n: leading if n.startswith("tractor") else towed for n in stiffness}
        variant = soft.replace({n: factors[n] * v for n, v in stiffness.items()})
        A = dynamics.matrices(variant.with_logged_steering(RECORD.signals, "a"), speed, roll=True).A
        stable += np.linalg.eigvals(A).real.max() < 0
    assert 0 < stable < 5
    assert len(predict_channels(RECORD, soft).predicted) == stable


def test_of_a_long_gap_ten_seconds_remain():
    half = RECORD.time > RECORD.time.mean()
    paused = Record(time=RECORD.time + 100.0 * half, signals=RECORD.signals, name=RECORD.name)
    prediction, whole = predict_channels(paused, TRUCK), predict_channels(RECORD, TRUCK)
    assert abs(len(prediction.time) - len(whole.time) - 10 * 25) <= 1
    assert abs(np.diff(prediction.time).max() - 90) < 0.1
    assert prediction.time[-1] == whole.time[-1] + 100


# Lags


def test_lag_and_gain() -> None:
    """Also where samples are missing. An inverted signal has no lag, and of several maxima the smallest lag counts."""
    predicted = excitation(1)
    for lag in (-0.6, 0.0, 0.3, 1.6):
        measured = 0.3 + 1.4 * np.interp(TIME - lag, TIME, predicted)
        measured[200:400] = np.nan
        curve = lag_curve(measured, predicted)
        assert curve.best()[0] == pytest.approx(lag, abs=0.002)
        assert curve.gain()[0] == pytest.approx(1.4, rel=0.02)
        assert curve.gain()[2] == pytest.approx(1.0, abs=0.01)
    wave = np.sin(np.pi * TIME)  # 0.1 and -1.9 s late explain the same, apart from the noise
    for seed in range(5):
        noisy = np.sin(np.pi * (TIME - 0.1)) + 0.2 * slow_noise(seed, 0.02)
        assert lag_curve(noisy, wave).best()[0] == pytest.approx(0.1, abs=0.03)
    inverted = lag_curve(-wave - 0.3 * predicted, wave + 0.3 * predicted)
    assert inverted.explained.max() > 0.5  # half a period later or earlier
    assert inverted.best() is None


def test_too_few_samples_and_maxima_at_the_ends():
    predicted = SOURCES[YAW]
    few = np.full(TIME.size, np.nan)
    few[200:299] = predicted[200:299]
    assert lag_curve(few, predicted) is None
    few[299] = predicted[299]
    assert lag_curve(few, predicted).rows.size == 100
    assert lag_curve(predicted, np.ones(TIME.size)).best() is None
    beyond = lag_curve(shifted(predicted, 2.6), predicted)
    assert beyond.explained.argmax() != 110 or beyond.gain() is None


def test_the_curve_equals_correlations_one_by_one():
    predicted, measured = SOURCES[YAW].copy(), late({YAW: 0.3}, noise=0.5)[YAW]
    measured[300:350] = np.nan
    predicted[:40] = np.nan
    curve = lag_curve(measured, predicted)
    for k, (lag, explained) in enumerate(zip(curve.lags, curve.explained, strict=True)):
        steps = k - 55
        assert lag == pytest.approx(steps / RATE)
        r = np.corrcoef(measured[curve.rows], predicted[curve.rows - steps])[0, 1]
        assert explained == pytest.approx(max(r, 0) ** 2, abs=1e-12)
    possible = [k for k in range(TIME.size) if k - 56 >= 40 and k + 56 < TIME.size and np.isfinite(measured[k])]
    assert curve.rows.tolist() == possible
    negative = [np.corrcoef(measured[curve.rows], predicted[curve.rows - k])[0, 1] for k in range(-8, 9)]
    assert curve.inverted == pytest.approx(max(-min(negative), 0) ** 2)
    upside_down = lag_curve(-measured, predicted)
    assert upside_down.inverted == pytest.approx(max(negative) ** 2)
    gain, sigma, explained = curve.gain()
    best = int(curve.explained.argmax()) - 55
    p, m = predicted[curve.rows - best], measured[curve.rows]
    slope, bias = np.polyfit(p, m, 1)
    assert gain == pytest.approx(slope)
    assert explained == pytest.approx(1 - np.var(m - slope * p - bias) / np.var(m))
    assert 0.5 < sigma / (0.5 / np.sqrt(((p - p.mean()) ** 2).sum())) < 2  # of white noise


@pytest.mark.parametrize("missing", [0, 300])
def test_sigma_is_that_of_scores_in_blocks_of_four_seconds(missing):
    """The equation of `LagCurve.best`, with least squares by NumPy; of few blocks wider by sqrt(B / (B - 3))."""
    predicted = SOURCES[YAW2]
    measured = 1.3 * shifted(predicted, 0.2) + 0.4 * WHITE[YAW2]
    measured[400 : 400 + missing] = np.nan
    curve = lag_curve(measured, predicted)
    lag, sigma = curve.best()
    k, rows = int(curve.explained.argmax()) - 55, curve.rows
    assert lag == pytest.approx(k / RATE, abs=0.5 / RATE)
    p = predicted[rows - k]
    slope = (predicted[rows - k + 1] - predicted[rows - k - 1]) / (2 / RATE)
    regressors = np.column_stack([p, np.ones(rows.size)])
    (gain, _), *_ = np.linalg.lstsq(regressors, measured[rows], rcond=None)
    slope = slope - regressors @ np.linalg.lstsq(regressors, slope, rcond=None)[0]
    every = np.column_stack([regressors, slope])
    residual = measured[rows] - every @ np.linalg.lstsq(every, measured[rows], rcond=None)[0]
    blocks = {}
    for row, score in zip(rows, gain * slope * residual, strict=True):
        blocks[row // 100] = blocks.get(row // 100, 0.0) + score
    few = len(blocks) / (len(blocks) - 3)
    variance = few * sum(score**2 for score in blocks.values()) / (gain**2 * (slope @ slope)) ** 2
    assert sigma == pytest.approx(np.sqrt(variance))
    assert len(blocks) == 15 - missing // 100
