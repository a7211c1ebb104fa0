"""Simulated records: the requested manoeuvre, the requested noise, and the true states as reference."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from fifthwheel.base.errors import SignalError
from fifthwheel.data.channels import ROLL_RATE, YAW_RATE
from fifthwheel.data.checks import check
from fifthwheel.data.record import Record
from fifthwheel.model import dynamics
from fifthwheel.model.manoeuvres import LINEAR_MANOEUVRES, MANOEUVRES, OpenLoop, course
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, get

KMH_88 = 88 / 3.6
G = 9.80665
STEER = "steer.tractor.front"
GYROS = {channel.quantity: channel.noise for channel in (ROLL_RATE, YAW_RATE)}
RATES = {f"{q}.{u}": GYROS[q][i] for q in GYROS for i, u in enumerate(("tractor", "semitrailer"))}
NOISELESS = {"yaw_rate.tractor": 0.0, "yaw_rate.semitrailer": 0.0}


@pytest.fixture(scope="module")
def truck() -> Vehicle:
    return get("cheng_cebon_2011")


def lateral_motion(record: Record) -> tuple[np.ndarray, np.ndarray]:
    """Lateral acceleration and position of the tractor's CoG from the true states: a = v' + u r, y'' = a."""
    speed, rate = record.signals["speed"], record.signals["yaw_rate.tractor"]
    lateral = speed * record.reference["sideslip.tractor"]
    acceleration = np.gradient(lateral, record.time) + speed * rate
    velocity = cumulative_trapezoid(acceleration, record.time, initial=0)
    return acceleration, cumulative_trapezoid(velocity, record.time, initial=0)


@pytest.mark.parametrize(("name", "roll"), [("cheng_cebon_2011", True), ("auburn_6x4", False)])
def test_the_lane_change_is_that_of_the_standard(name, roll):
    """SAE J2179: 1.464 m sideways in 61 m at 88 km/h with 0.15 g, first to the left, then back."""
    record = simulate(get(name), count=2, rate=200, sensors=NOISELESS, roll=roll)
    acceleration, offset = lateral_motion(record)
    start, end = 1.0, 1.0 + 61 / KMH_88
    first = record.time < 8.5
    assert np.abs(acceleration[first]).max() == pytest.approx(0.15 * G, rel=0.03)
    assert offset[np.searchsorted(record.time, end)] == pytest.approx(1.464, rel=0.02)
    assert offset[np.searchsorted(record.time, 8.5)] == pytest.approx(1.464, rel=0.02)
    assert offset[-1] == pytest.approx(0, abs=0.1)
    outside = first & ((record.time < start - 0.1) | (record.time > end + 0.1))
    assert np.abs(acceleration[outside]).max() < 0.02 * 0.15 * G
    assert offset[np.searchsorted(record.time, start)] == pytest.approx(0, abs=0.01)
    assert acceleration[first].argmax() < acceleration[first].argmin()
    period = np.diff(record.time[[acceleration[first].argmax(), acceleration[first].argmin()]])
    assert period[0] == pytest.approx(61 / KMH_88 / 2, rel=0.05)  # 0.4 Hz
    assert roll or not [name for name in (*record.signals, *record.reference) if "roll" in name]


@pytest.mark.parametrize(("speed", "count"), [(5.0, 1), (12.0, 1), (35.0, 2)])
def test_a_lane_change_is_complete_at_any_speed(truck, speed, count):
    record = simulate(truck, count=count, speed=speed, rate=50, sensors=NOISELESS)
    _, offset = lateral_motion(record)
    steer = record.signals[STEER]
    assert abs(steer[0]) < 0.02 * np.abs(steer).max()
    assert abs(steer[-1]) < 0.05 * np.abs(steer).max()
    assert offset.max() == pytest.approx(1.464, rel=0.02)
    assert offset[-1] == pytest.approx(1.464 * (count % 2), abs=0.02)


def test_noise_is_as_requested(truck):
    noisy, noiseless = simulate(truck, seed=11), simulate(truck, sensors=dict.fromkeys(RATES, 0.0))
    assert len(noisy) == 12_000
    assert set(noisy.signals) == {"speed", STEER, *RATES}
    for name, variance in RATES.items():
        noise = noisy.signals[name] - noiseless.signals[name]
        assert np.var(noise) == pytest.approx(variance, rel=5 * np.sqrt(2 / len(noise)))
        assert abs(noise.mean()) < 5 * np.sqrt(variance / len(noise))
        assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 5 / np.sqrt(len(noise))
    for name in ("speed", STEER):
        np.testing.assert_array_equal(noisy.signals[name], noiseless.signals[name])
    assert GYROS == {"roll_rate": (4.52e-4, 4.70e-5), "yaw_rate": (1.52e-5, 1.11e-5)}  # the article's (12)


@pytest.mark.parametrize("manoeuvre", ["lane_changes", "random"])
def test_equal_seeds_give_equal_records(truck, manoeuvre):
    record, same, other = (simulate(truck, manoeuvre=manoeuvre, duration=2.0, seed=seed) for seed in (4, 4, 5))
    assert record == same
    for name in RATES:
        difference = record.signals[name] - other.signals[name]
        assert np.std(difference) > np.sqrt(RATES[name])
    same_steering = np.array_equal(record.signals[STEER], other.signals[STEER])
    assert same_steering == (manoeuvre != "random")


def test_the_steer_angle_of_an_open_loop_is_that_of_the_plant(truck):
    record, driven = simulate(truck, manoeuvre="step", rate=20.0, sensors=NOISELESS), course("step", truck)
    assert isinstance(driven, OpenLoop)
    assert record.span == (0.0, pytest.approx(driven.duration - 1 / 20.0))
    assert record.signals[STEER] == pytest.approx(np.interp(record.time, driven.time, driven.steer), abs=1e-15)


def test_true_states_solve_the_equations_of_motion(truck):
    """Against scipy's solution of the continuous system; the steer angle is linear between samples."""
    from scipy.signal import lsim

    record = simulate(truck, count=1, rate=50, sensors=NOISELESS)
    m = dynamics.matrices(truck, KMH_88, roll=True)
    column = truck.steer_signals().index(STEER)
    _, _, x = lsim(
        (m.A, m.B[:, [column]], np.eye(len(m.A)), np.zeros((len(m.A), 1))), record.signals[STEER], record.time
    )
    truth = dict(zip(m.states, x.T, strict=True))
    for name in ("roll.tractor", "roll.semitrailer", "articulation.semitrailer"):
        np.testing.assert_allclose(record.reference[name], truth[name], atol=1e-6 * np.abs(truth[name]).max(), rtol=0)
    slip = truth["lateral_velocity.tractor"] / KMH_88
    np.testing.assert_allclose(record.reference["sideslip.tractor"], slip, atol=1e-6 * np.abs(slip).max(), rtol=0)
    rate = truth["yaw_rate.tractor"]
    np.testing.assert_allclose(record.signals["yaw_rate.tractor"], rate, atol=1e-6 * np.abs(rate).max(), rtol=0)


@pytest.mark.parametrize("manoeuvre", LINEAR_MANOEUVRES)
def test_each_manoeuvre_is_plausible_and_in_the_linear_range(truck, manoeuvre):
    record = simulate(truck, manoeuvre=manoeuvre, sensors=NOISELESS, seed=2, duration=20.0, speed=20.0, rate=50)
    assert (len(record), record.rate) == (1000, pytest.approx(50))
    assert (record.signals["speed"] == 20.0).all()
    assert check(record, wheelbase=truck.wheelbase) == ()
    states = {f"{q}.{u}" for q in ("sideslip", "roll") for u in ("tractor", "semitrailer")}
    assert set(record.reference) == states | {"articulation.semitrailer"}
    assert all(np.ptp(values) > 1e-3 for values in record.reference.values()) == (manoeuvre != "straight")
    if manoeuvre == "straight":
        assert not any(values.any() for values in (*record.reference.values(), record.signals[STEER]))
    if manoeuvre in ("sweep", "random", "bend"):
        assert 0.5 < np.abs(lateral_motion(record)[0]).max() < 3.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        *(({"speed": speed}, "speed: expected 5 to 40 m/s") for speed in (0.0, -20.0, 4.9, 41.0, np.nan, np.inf)),
        *(({"sensors": {name: 1e-4}}, f"{name}: ") for name in ("yaw_rate.lorry", "speeed.tractor")),
        ({"sensors": {"articulation.tractor": 1e-4}}, "articulation.tractor: "),
        ({"manoeuvre": "step", "count": 3}, "count: step does not have it, got 3; leave it out"),
        ({"manoeuvre": "slalom"}, "manoeuvre: 'slalom' is not known; choose one of lane_changes, single_sine"),
        *(
            ({"manoeuvre": name}, f"manoeuvre: '{name}' exists only for the nonlinear truck")
            for name in sorted(set(MANOEUVRES) - set(LINEAR_MANOEUVRES))
        ),
    ],
)
def test_what_cannot_be_simulated_is_refused(truck, arguments, message):
    with pytest.raises(SignalError, match=f"^{message}"):
        simulate(truck, **arguments)
