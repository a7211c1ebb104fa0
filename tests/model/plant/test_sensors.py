"""Sensors: each effect alone, the order of the effects, their statistics, and the independence of sensors."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.base.errors import SignalError
from fifthwheel.data.record.timestamps import held_samples
from fifthwheel.model.plant.sensors import Sensor, measure, read_sensors

TIME = np.arange(20_000) / 100
TRUTH = {
    "speed": 24 + np.sin(0.1 * TIME),
    "steer.tractor.front": 0.02 * np.sin(2 * TIME),
    "yaw_rate.tractor": 0.1 * np.sin(TIME),
    "roll_rate.tractor": 0.05 * np.cos(3 * TIME),
    "yaw_rate.semitrailer": 0.1 * np.sin(TIME - 0.3),
    "articulation.semitrailer": 0.1 * np.cos(TIME),
}
YAW, ROLL = "yaw_rate.tractor", "roll_rate.tractor"


def measured(name: str, *, seed: int = 0, **effects) -> np.ndarray:
    return measure(TIME, TRUTH, {name: Sensor(**effects)}, seed=seed)[name]


@settings(deadline=None, max_examples=8)
@given(bias=st.floats(-1, 1), scale=st.floats(0.5, 2), latency=st.floats(0, 0.5))
def test_bias_scale_and_latency(bias, scale, latency):
    values = measured(YAW, bias=bias, scale=scale, latency=latency)
    delayed = 0.1 * np.sin(np.clip(TIME - latency, 0, None))  # exact, not interpolated
    np.testing.assert_allclose(values, scale * delayed + bias, atol=1e-5)
    np.testing.assert_array_equal(measured(YAW), TRUTH[YAW])


@pytest.mark.parametrize("angle", [-0.2, 0.05])
def test_a_misaligned_gyro_measures_a_component_of_the_other_rate(angle):
    """A rotation matrix about y."""
    c, s = math.cos(angle), math.sin(angle)
    rotated = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) @ np.array([TRUTH[ROLL], 0 * TIME, TRUTH[YAW]])
    np.testing.assert_allclose(measured(ROLL, misalignment=angle), rotated[0])
    np.testing.assert_allclose(measured(YAW, misalignment=angle), rotated[2])


@settings(deadline=None, max_examples=15)
@given(rate=st.floats(2, 300), start=st.floats(-100, 1e6), step=st.sampled_from([0.001, 0.01, 0.02]))
def test_a_slow_sensor_has_no_values_between_its_samples(rate, start, step):
    time = start + step * np.arange(2000)
    values = measure(time, {YAW: time}, {YAW: Sensor(rate=rate)})[YAW]
    sampled = time[~np.isnan(values)]
    np.testing.assert_array_equal(values[~np.isnan(values)], sampled)
    assert sampled[0] == time[0]
    assert np.diff(sampled).min() > max(1 / rate - step, 0) - 1e-6
    assert np.diff(sampled, append=time[-1]).max() < max(1 / rate, step) + step + 1e-6
    assert len(sampled) == pytest.approx(min(rate, 1 / step) * step * len(time), abs=2)


def test_a_held_sensor_repeats_its_samples():
    samples = measured(YAW, rate=20.0, variance=1e-6)
    held = measured(YAW, rate=20.0, variance=1e-6, held=True)
    np.testing.assert_array_equal(held, np.repeat(samples[::5], 5)[: len(TIME)])
    found = held_samples(TIME, measured(YAW, rate=20.0, variance=1e-6, held=True))
    assert found is not None
    assert found.rate == pytest.approx(20)
    assert np.isnan(measured(YAW, rate=20.0, held=True, dropout=0.1)).any()


@pytest.mark.parametrize(("fraction", "length"), [(0.05, 0.5), (0.8, 1.0)])
def test_fraction_and_length_of_dropouts(fraction, length):
    time = np.arange(400_000) / 100
    missing = np.isnan(measure(time, {YAW: time}, {YAW: Sensor(dropout=fraction, dropout_length=length)}, seed=2)[YAW])
    count = np.sum(np.diff(missing.astype(int)) == 1)
    sigma = math.sqrt(2 / count)  # upper limit of the relative sigma of the mean of so many exponential lengths
    assert missing.mean() == pytest.approx(fraction, rel=4 * sigma * (1 - fraction))
    assert missing.sum() / 100 / count == pytest.approx(length, rel=4 * sigma + 0.03)


def test_effects_apply_in_the_order_of_the_fields():
    """Noise and bias are added after the scale factor and before the quantisation, whose steps are even."""
    noise = measured(YAW, variance=1e-4) - TRUTH[YAW]
    assert noise.var() == pytest.approx(1e-4, rel=0.04)
    assert noise.mean() == pytest.approx(0, abs=4 * math.sqrt(1e-4 / len(TIME)))
    assert np.corrcoef(noise[1:], noise[:-1])[0, 1] == pytest.approx(0, abs=0.03)
    values = measured(
        YAW, misalignment=0.1, latency=0.1, scale=1.1, bias=0.02, variance=1e-4, quantisation=0.01, rate=20, dropout=0.1
    )
    rotated = TRUTH[YAW] * math.cos(0.1) + TRUTH[ROLL] * math.sin(0.1)
    unquantised = 1.1 * np.concatenate([np.full(10, rotated[0]), rotated[:-10]]) + 0.02 + noise
    finite = ~np.isnan(values)
    error = np.abs(values[finite] - np.round(unquantised[finite] / 0.01) * 0.01)
    assert (error > 1e-9).mean() < 1e-3  # a value near the middle of a step may be rounded to either side
    assert np.flatnonzero(finite).max() % 5 == 0
    assert 0.8 < finite[::5].mean() < 1


def test_a_sensor_does_not_depend_on_other_sensors():
    """The same seed gives the same values, and dropouts do not depend on the noise."""
    both = {YAW: Sensor(variance=1e-4, dropout=0.1), ROLL: Sensor(variance=1e-4, dropout=0.1)}
    signals = measure(TIME, TRUTH, both, seed=1)
    reordered = measure(TIME, TRUTH, dict(reversed(both.items())), seed=1)
    for name in both:
        np.testing.assert_array_equal(signals[name], reordered[name])
        np.testing.assert_array_equal(signals[name], measured(name, seed=1, variance=1e-4, dropout=0.1))
    assert not np.array_equal(signals[YAW], measured(YAW, seed=2, variance=1e-4, dropout=0.1), equal_nan=True)
    noise = {name: measured(name, seed=1, variance=1e-4) - TRUTH[name] for name in both}
    assert np.corrcoef(noise[YAW], noise[ROLL])[0, 1] == pytest.approx(0, abs=0.03)
    np.testing.assert_array_equal(np.isnan(signals[YAW]), np.isnan(measured(YAW, seed=1, dropout=0.1)))
    assert (np.isnan(signals[YAW]) != np.isnan(signals[ROLL])).any()


def test_read_sensors(tmp_path):
    file = tmp_path / "sensors.toml"
    file.write_text("""
        [speed]
        noise = "0.36 km/h"
        rate = "10 Hz"
        ["yaw_rate.tractor"]
        noise = "0.2 deg/s"
        bias = "-0.1 deg/s"
        misalignment = "1 deg"
        latency = "20 ms"
        quantisation = "0.01 deg/s"
        scale = 1.02
        dropout = "2 %"
        dropout_length = "500 ms"
        [yaw_rate.semitrailer]
        variance = 1.1e-5
        rate = 50
        held = true
        [articulation.semitrailer]
    """)
    degree = math.pi / 180
    sensors = read_sensors(file)
    assert list(sensors) == ["speed", "yaw_rate.tractor", "yaw_rate.semitrailer", "articulation.semitrailer"]
    assert (sensors["speed"].variance, sensors["speed"].rate) == pytest.approx((0.01, 10))
    assert sensors["yaw_rate.semitrailer"] == Sensor(variance=1.1e-5, rate=50, held=True)
    assert sensors["articulation.semitrailer"] == Sensor()
    stated = {"misalignment": degree, "latency": 0.02, "scale": 1.02, "bias": -0.1 * degree, "dropout": 0.02}
    stated |= {"variance": (0.2 * degree) ** 2, "quantisation": 0.01 * degree, "dropout_length": 0.5}
    assert vars(sensors["yaw_rate.tractor"]) == pytest.approx(stated | {"rate": None, "held": False})
    assert np.isfinite(measure(TIME, TRUTH, sensors)["speed"]).sum() == 2001


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[yaw_rat.tractor]\nbias = 1", r"sensors\.toml: yaw_rat\.tractor: .* did you mean 'yaw_rate\.tractor'"),
        ("[yaw_rate.tractor]\nbais = 1", r"yaw_rate\.tractor\.bais: no such key; did you mean 'bias'"),
        ("[yaw_rate.tractor]\nbias = '1 m/s'", r"yaw_rate\.tractor\.bias: expected rad/s or"),
        ("[yaw_rate.tractor]\nbias = true", r"yaw_rate\.tractor\.bias: expected a number, or a text .* got True"),
        ("[yaw_rate.tractor]\nheld = 'yes'", r"yaw_rate\.tractor\.held: expected true or false, got 'yes'"),
        ("[yaw_rate.tractor]\nnoise = 1\nvariance = 1", "yaw_rate.tractor: expected noise or variance, got both"),
        ("[yaw_rate.tractor]\nnoise = '-1 deg/s'", r"yaw_rate\.tractor\.noise: expected a standard deviation of 0"),
        ("[speed]\nmisalignment = 0.1", "speed: misalignment applies to yaw_rate and roll_rate only"),
        ("[speed]\nlatency = '-1 s'", r"speed\.latency: got -1\.0, expected 0 s or more"),
        ("speed = 3", "speed: expected a table for each signal, got 3"),
        ("speed = [", r"sensors\.toml: not valid TOML"),
    ],
)
def test_invalid_files_are_refused(tmp_path, text, message):
    file = tmp_path / "sensors.toml"
    file.write_text(text)
    with pytest.raises(SignalError, match=message):
        read_sensors(file)


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ({"variance": -1.0}, "variance: got -1"),
        ({"bias": math.nan}, "bias: got nan, expected a finite number"),
        ({"scale": 0.0}, "scale: got 0"),
        ({"misalignment": 5.0}, "misalignment: got 5.0, .* is it in degrees"),
        ({"rate": math.inf}, "rate: got inf"),
        ({"latency": -0.1}, "latency: got -0.1"),
        ({"quantisation": -1.0}, "quantisation: got -1"),
        ({"held": True}, "held: got True, expected a rate too"),
        ({"dropout": 1.0}, "dropout: got 1"),
        ({"dropout_length": 0.0}, "dropout_length: got 0"),
    ],
)
def test_invalid_sensors_are_refused(effects, message):
    with pytest.raises(SignalError, match=message):
        Sensor(**effects)


def test_signals_that_cannot_be_measured_are_refused():
    yaw, tilted = "yaw_rate.semitrailer", Sensor(misalignment=0.1)
    for sensors, message in (
        ({"yaw_rate.semitrailr": Sensor()}, r"missing in the true signals; did you mean 'yaw_rate\.semitrailer'"),
        ({"yawrate.tractor": Sensor()}, r"not the name of a signal; did you mean 'yaw_rate\.tractor'"),
        ({yaw: tilted}, r"roll_rate\.semitrailer: missing in the true signals"),
        ({"articulation.semitrailer": tilted}, "misalignment applies to yaw_rate and roll_rate only"),
    ):
        with pytest.raises(SignalError, match=message):
            measure(TIME, TRUTH, sensors)
    with pytest.raises(SignalError, match="seed: expected 0 or more, got -1"):
        measure(TIME, TRUTH, {}, seed=-1)
    with pytest.raises(SignalError, match=r"yaw_rate\.tractor: expected 20000 true values"):
        measure(TIME, {YAW: TRUTH[YAW][1:]}, {YAW: Sensor()})
