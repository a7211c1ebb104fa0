"""Sensors: each effect alone, their order, statistics, and that no sensor's noise depends on another."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.errors import SignalError
from fifthwheel.logs.noise import article_gyros
from fifthwheel.plant.sensors import Sensor, article, load, observe
from fifthwheel.vehicle import get

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


def read(name: str, *, seed: int = 0, **effects) -> np.ndarray:
    return observe(TIME, TRUTH, {name: Sensor(**effects)}, seed=seed)[name]


def test_a_perfect_sensor_reads_the_truth():
    found = observe(TIME, TRUTH, dict.fromkeys(TRUTH, Sensor()), seed=3)
    assert list(found) == list(TRUTH)
    for name, values in TRUTH.items():
        np.testing.assert_array_equal(found[name], values)
        assert not np.shares_memory(found[name], values)


def test_noise_is_white_and_as_large_as_asked():
    noise = read(YAW, variance=1.52e-5) - TRUTH[YAW]
    assert noise.var() == pytest.approx(1.52e-5, rel=0.04)
    assert noise.mean() == pytest.approx(0, abs=4 * math.sqrt(1.52e-5 / len(TIME)))
    assert np.corrcoef(noise[1:], noise[:-1])[0, 1] == pytest.approx(0, abs=0.03)


@settings(deadline=None, max_examples=20)
@given(bias=st.floats(-1, 1), scale=st.floats(0.5, 2), latency=st.floats(0, 0.5))
def test_bias_scale_and_latency(bias, scale, latency):
    found = read(YAW, bias=bias, scale=scale, latency=latency)
    old = 0.1 * np.sin(np.clip(TIME - latency, 0, None))  # the truth itself, not interpolated
    np.testing.assert_allclose(found, scale * old + bias, atol=1e-5)


@pytest.mark.parametrize("angle", [-0.2, 0.05])
def test_a_misaligned_gyro_reads_some_of_the_other_rate(angle):
    """A turn about y, as a rotation matrix."""
    c, s = math.cos(angle), math.sin(angle)
    turned = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]) @ np.array([TRUTH[ROLL], 0 * TIME, TRUTH[YAW]])
    np.testing.assert_allclose(read(ROLL, misalignment=angle), turned[0])
    np.testing.assert_allclose(read(YAW, misalignment=angle), turned[2])


def test_quantisation():
    found = read(YAW, quantisation=0.003)
    np.testing.assert_allclose(found / 0.003, np.round(found / 0.003), atol=1e-9)
    assert np.abs(found - TRUTH[YAW]).max() <= 0.0015 + 1e-12


@settings(deadline=None, max_examples=30)
@given(rate=st.floats(2, 300), start=st.floats(-100, 1e6), step=st.sampled_from([0.001, 0.01, 0.02]))
def test_a_slow_sensor_misses_what_is_between(rate, start, step):
    time = start + step * np.arange(2000)
    found = observe(time, {YAW: time}, {YAW: Sensor(rate=rate)})[YAW]
    seen = time[~np.isnan(found)]
    np.testing.assert_array_equal(found[~np.isnan(found)], seen)
    assert seen[0] == time[0]
    assert np.diff(seen).min() > max(1 / rate - step, 0) - 1e-6
    assert np.diff(seen, append=time[-1]).max() < max(1 / rate, step) + step + 1e-6
    assert len(seen) == pytest.approx(min(rate, 1 / step) * step * len(time), abs=2)


@pytest.mark.parametrize("rate", [100.0, 50.0, 20.0, 10.0])
def test_rates_that_divide_take_every_so_many_th(rate):
    every = round(100 / rate)
    assert np.flatnonzero(~np.isnan(read(YAW, rate=rate))).tolist() == list(range(0, len(TIME), every))


@pytest.mark.parametrize("name", ["speed", "steer.tractor.front"])
def test_an_input_is_there_at_both_ends(name):
    assert np.flatnonzero(~np.isnan(read(name, rate=7.0)))[[0, -1]].tolist() == [0, len(TIME) - 1]
    assert np.isnan(read(YAW, rate=7.0)[-1])


@pytest.mark.parametrize(("part", "length"), [(0.05, 0.5), (0.5, 0.2), (0.8, 1.0)])
def test_dropouts_are_as_many_and_as_long_as_asked(part, length):
    time = np.arange(400_000) / 100
    missing = np.isnan(observe(time, {YAW: time}, {YAW: Sensor(dropout=part, dropout_length=length)}, seed=2)[YAW])
    stretches = np.flatnonzero(np.diff(missing.astype(int)) == 1)
    count = len(stretches)
    spread = math.sqrt(2 / count)  # of the mean of so many exponential lengths, with some to spare
    assert missing.mean() == pytest.approx(part, rel=4 * spread * (1 - part))
    assert missing.sum() / 100 / count == pytest.approx(length, rel=4 * spread + 0.03)


def test_effects_come_in_the_order_of_the_fields():
    """Noise and bias are added after the gain and before the steps, and the steps are even."""
    noise = read(YAW, variance=1e-4) - TRUTH[YAW]
    found = read(
        YAW, misalignment=0.1, latency=0.1, scale=1.1, bias=0.02, variance=1e-4, quantisation=0.01, rate=20, dropout=0.1
    )
    turned = TRUTH[YAW] * math.cos(0.1) + TRUTH[ROLL] * math.sin(0.1)
    before = 1.1 * np.concatenate([np.full(10, turned[0]), turned[:-10]]) + 0.02 + noise
    seen = ~np.isnan(found)
    off = np.abs(found[seen] - np.round(before[seen] / 0.01) * 0.01)
    assert (off > 1e-9).mean() < 1e-3  # rounding may fall to either side
    assert np.flatnonzero(seen).max() % 5 == 0
    assert 0.8 < seen[::5].mean() < 1


def test_the_same_seed_gives_the_same_whoever_else_is_there():
    """And dropouts do not change with the noise."""
    both = {YAW: Sensor(variance=1e-4, dropout=0.1), ROLL: Sensor(variance=1e-4, dropout=0.1)}
    one, other = observe(TIME, TRUTH, both, seed=1), observe(TIME, TRUTH, dict(reversed(both.items())), seed=1)
    for name in both:
        np.testing.assert_array_equal(one[name], other[name])
        np.testing.assert_array_equal(one[name], read(name, seed=1, variance=1e-4, dropout=0.1))
    assert not np.array_equal(one[YAW], read(YAW, seed=2, variance=1e-4, dropout=0.1), equal_nan=True)
    noise = {name: read(name, seed=1, variance=1e-4) - TRUTH[name] for name in both}
    assert np.corrcoef(noise[YAW], noise[ROLL])[0, 1] == pytest.approx(0, abs=0.03)
    np.testing.assert_array_equal(np.isnan(one[YAW]), np.isnan(read(YAW, seed=1, dropout=0.1)))
    assert (np.isnan(one[YAW]) != np.isnan(one[ROLL])).any()


@pytest.mark.parametrize("name", ["cheng_cebon_2011", "auburn_6x4"])
def test_the_articles_sensors(name):
    found = article(get(name))
    gyros = article_gyros(["tractor", "semitrailer"])
    assert set(found) == {"speed", "steer.tractor.front", *gyros}
    assert {n: found[n].variance for n in gyros} == gyros
    assert found["speed"] == found["steer.tractor.front"] == Sensor()


def test_a_file_of_sensors(tmp_path):
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
        [articulation.semitrailer]
    """)
    degree = math.pi / 180
    found = load(file)
    assert list(found) == ["speed", "yaw_rate.tractor", "yaw_rate.semitrailer", "articulation.semitrailer"]
    assert (found["speed"].variance, found["speed"].rate) == pytest.approx((0.01, 10))
    assert found["yaw_rate.semitrailer"] == Sensor(variance=1.1e-5, rate=50)
    assert found["articulation.semitrailer"] == Sensor()
    assert vars(found["yaw_rate.tractor"]) == pytest.approx(
        {
            "misalignment": degree,
            "latency": 0.02,
            "scale": 1.02,
            "bias": -0.1 * degree,
            "variance": (0.2 * degree) ** 2,
            "quantisation": 0.01 * degree,
            "rate": None,
            "dropout": 0.02,
            "dropout_length": 0.5,
        }
    )
    assert np.isfinite(observe(TIME, TRUTH, found)["speed"]).sum() == 2001


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[yaw_rat.tractor]\nbias = 1", r"sensors\.toml: yaw_rat\.tractor: .* did you mean 'yaw_rate\.tractor'"),
        ("[yaw_rate.tractor]\nbais = 1", r"yaw_rate\.tractor\.bais: no such key; did you mean 'bias'"),
        (
            "[yaw_rate.tractor]\nbias = '1 m/s'",
            r"yaw_rate\.tractor\.bias: unit 'm/s' does not fit: expected one of rad/s",
        ),
        ("[yaw_rate.tractor]\nbias = 'soon'", r"yaw_rate\.tractor\.bias: 'soon' is not a number"),
        ("[yaw_rate.tractor]\nbias = true", r"yaw_rate\.tractor\.bias: expected a number, or a text .* got True"),
        ("[yaw_rate.tractor]\nnoise = 1\nvariance = 1", "noise and variance say the same thing; keep one"),
        ("[yaw_rate.tractor]\nnoise = '-1 deg/s'", r"yaw_rate\.tractor\.noise: expected a standard deviation of 0"),
        ("[yaw_rate.tractor]\nrate = '10 ms'", r"yaw_rate\.tractor\.rate"),
        ("[speed]\nmisalignment = 0.1", "speed: misalignment is of yaw_rate and roll_rate only"),
        ("[speed]\nlatency = '-1 s'", r"speed\.latency: got -1\.0, expected 0 s or more"),
        ("speed = 3", "speed: expected a table for each signal, got 3"),
        ("speed = [", r"sensors\.toml: not TOML"),
    ],
)
def test_a_file_that_cannot_be(tmp_path, text, message):
    file = tmp_path / "sensors.toml"
    file.write_text(text)
    with pytest.raises(SignalError, match=message):
        load(file)


def test_no_file(tmp_path):
    with pytest.raises(SignalError, match="cannot be read"):
        load(tmp_path / "sensors.toml")


@pytest.mark.parametrize(
    ("effects", "message"),
    [
        ({"variance": -1.0}, "variance: got -1"),
        ({"bias": math.nan}, "bias: got nan, expected a finite number"),
        ({"scale": 0.0}, "scale: got 0"),
        ({"misalignment": 5.0}, "misalignment: got 5.0, .* is it in degrees"),
        ({"rate": 0.0}, "rate: got 0"),
        ({"rate": math.inf}, "rate: got inf"),
        ({"latency": -0.1}, "latency: got -0.1"),
        ({"quantisation": -1.0}, "quantisation: got -1"),
        ({"dropout": 1.0}, "dropout: got 1"),
        ({"dropout_length": 0.0}, "dropout_length: got 0"),
    ],
)
def test_no_such_sensor(effects, message):
    with pytest.raises(SignalError, match=message):
        Sensor(**effects)


@pytest.mark.parametrize(
    ("sensors", "message"),
    [
        ({"yaw_rate.semitrailr": Sensor()}, r"the truth does not have it; did you mean 'yaw_rate\.semitrailer'"),
        ({"yawrate.tractor": Sensor()}, r"not the name of a signal; did you mean 'yaw_rate\.tractor'"),
        ({"yaw_rate.semitrailer": Sensor(misalignment=0.1)}, r"roll_rate\.semitrailer: the truth does not have it"),
        ({"articulation.semitrailer": Sensor(misalignment=0.1)}, "misalignment is of yaw_rate and roll_rate only"),
    ],
)
def test_what_cannot_be_sensed(sensors, message):
    with pytest.raises(SignalError, match=message):
        observe(TIME, TRUTH, sensors)


def test_what_cannot_be_observed():
    with pytest.raises(SignalError, match="seed: expected 0 or more, got -1"):
        observe(TIME, TRUTH, {}, seed=-1)
    with pytest.raises(SignalError, match=r"yaw_rate\.tractor: expected 20000 values"):
        observe(TIME, {YAW: TRUTH[YAW][1:]}, {YAW: Sensor()})
