"""Accuracy of the states and consistency of their sigmas."""

import numpy as np
import pytest
from scipy.signal import cont2discrete
from scipy.stats import chi2

from fifthwheel.base.errors import SignalError
from fifthwheel.data.channels import channel_of
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.filters.initial_state import TYPICAL_STEER_SIGMA, initial_state
from fifthwheel.estimate.filters.variances import OBSERVER_PROCESS_VARIANCE
from fifthwheel.estimate.observe import Observer, ObserverSettings, Status
from fifthwheel.model import dynamics
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle
from tests.estimate.observe.conftest import EXACT, ROLLS, STEER, YAWS, assert_same, batched, but_settling, pushed
from tests.model.dynamics.test_lagrangian import b_double as lagrangian_b_double

DEGREE = np.pi / 180
SEEDS = 50


@pytest.fixture(scope="module")
def b_double() -> Vehicle:
    """Three units, the last one with one group and a steered axle in it whose angle is not logged."""
    fields = lagrangian_b_double().model_dump()
    fields["units"][2]["axle_groups"] = fields["units"][2]["axle_groups"][1:]
    return Vehicle(**fields)


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def test_sideslip_roll_and_articulation_of_the_linear_truck(truck, lane_changes):
    actual = Observer(truck, lane_changes.signals).batch(lane_changes)
    assert {"sideslip.semitrailer", "roll.semitrailer", "articulation.semitrailer"} <= lane_changes.reference.keys()
    for name, truth in lane_changes.reference.items():
        assert np.ptp(truth) > 0.2 * DEGREE, name
        assert rms(actual.values[name] - truth) < 0.05 * DEGREE, name


def test_start_within_a_lane_change(truck, lane_changes):
    """For any first sample the errors agree with sigma, and few samples are rejected."""
    for start in np.arange(1.0, 4.5, 0.25):
        record = lane_changes.cut(start)
        actual = Observer(truck, record.signals).batch(record)
        for name, truth in record.reference.items():
            error = actual.values[name] - truth
            assert np.abs(error / actual.sigma[name]).max() < 4.5, (name, start)
            assert rms(error[100:]) < 0.05 * DEGREE, (name, start)
        for name, accepted in actual.accepted.items():
            assert accepted[:100].mean() > 0.95, (name, start)


def noisy_truth(o: Observer, time: np.ndarray, steer: np.ndarray, speed: float) -> tuple[np.ndarray, ...]:
    """States (SEEDS, N, n) and measurements (SEEDS, N, m) of the system that the filter assumes.

    The continuous equations are discretised with a first-order hold. Measurement noise, process noise of Q per second,
    and random starts with covariance P0 are added.
    """
    random = np.random.default_rng(42)
    m = dynamics.matrices(o.vehicle, speed, roll=o.roll)
    step = time[1] - time[0]
    identity, zero = np.eye(len(m.A)), np.zeros_like(m.B)
    F, G, _, H, _ = cont2discrete((m.A, m.B, identity, zero), step, method="foh")
    inputs = {"speed": speed} | dict.fromkeys(o.inputs[1:], steer[0])
    x0, P0 = initial_state(o.vehicle, inputs, {}, roll=o.roll, steer_sigma=TYPICAL_STEER_SIGMA)
    Q = np.diag([OBSERVER_PROCESS_VARIANCE[name.split(".")[0]] for name in m.states]) * o.settings.process_noise
    assert o.model.states[:-1] == m.states
    # the hold of scipy has another state: x = inner + H d
    x = x0 + random.normal(size=(SEEDS, len(x0))) @ np.linalg.cholesky(P0).T
    inner = x - H @ steer[:1]
    states = np.empty((SEEDS, len(time), len(x0)))
    states[:, 0] = x
    for k in range(1, len(time)):
        inner = inner @ F.T + G @ steer[k - 1 : k] + random.normal(size=x.shape) * np.sqrt(np.diag(Q) * step)
        states[:, k] = inner + H @ steer[k : k + 1]
    indices = [m.states.index(name) for name in o.outputs]
    R = np.array([channel_of(name).noise[0 if name.endswith(".tractor") else 1] for name in o.outputs])
    measured = states[:, :, indices] + random.normal(size=(SEEDS, len(time), len(indices))) * np.sqrt(R)
    return states, measured


def within(ratio: float, degrees: int, chance: float = 1e-5) -> bool:
    """Whether the mean of squares of independent standard normals is within its chi-square interval."""
    low, high = chi2.ppf([chance / 2, 1 - chance / 2], degrees) / degrees
    return bool(low < ratio < high)


@pytest.mark.slow
@pytest.mark.parametrize("process_noise", [1.0, 1e-6])
def test_errors_agree_with_sigma(truck, process_noise):
    """Errors over sigma are standard normal over 50 seeds at each instant, and innovations over all samples."""
    settings = ObserverSettings(process_noise=process_noise, gate=1e6, **EXACT)
    o = Observer(truck, {"speed", STEER, *YAWS, *ROLLS}, settings)
    speed, time = 88 / 3.6, np.arange(600) / 100
    steer = 0.02 * np.sin(2 * np.pi * 0.4 * time) * (time < 5)
    states, measured = noisy_truth(o, time, steer, speed)
    names = o.model.states[:-1]  # without the offset of the steering
    error: dict[str, list[np.ndarray]] = {}
    innovations = []
    for x, y in zip(states, measured, strict=True):
        signals = {"speed": np.full(len(time), speed), STEER: steer}
        signals |= {name: y[:, i] for i, name in enumerate(o.outputs)}
        actual = o.batch(Record(time=time, signals=signals))
        assert (but_settling(actual.status) == Status.OK).all()
        truth = {name: x[:, i] for i, name in enumerate(names)}
        truth["sideslip.tractor"] = truth.pop("lateral_velocity.tractor") / speed
        for name, values in truth.items():
            if name.startswith("slip_angle."):
                continue  # not reported
            error.setdefault(name, []).append((actual.values[name] - values) / actual.sigma[name])
        innovations.append([actual.innovation[n] / actual.innovation_sigma[n] for n in o.outputs])
    assert len(error) == len(names) - 3 == 8
    for name, runs in error.items():
        for k in (0, 50, 200, 599):  # 50 independent runs
            assert within(float(np.mean(np.array(runs)[:, k] ** 2)), SEEDS), (name, k)
            assert abs(np.mean(np.array(runs)[:, k])) * np.sqrt(SEEDS) < 4.5, (name, k)
    squares = np.array(innovations) ** 2  # independent in time and over channels
    assert within(float(squares.mean()), squares.size)
    for i, name in enumerate(o.outputs):
        assert within(float(squares[:, i].mean()), squares[:, i].size), name
    autocorrelation = np.mean(np.array(innovations)[..., 1:] * np.array(innovations)[..., :-1])
    assert abs(autocorrelation) * np.sqrt(squares.size) < 4.5


def test_sigma_is_larger_than_errors_without_process_noise(truck):
    """Without process noise in the simulation, errors are smaller than the sigmas, which assume it."""
    squares = []
    for seed in range(8):
        record = simulate(truck, count=1, seed=seed)
        actual = Observer(truck, record.signals).batch(record)
        squares += [((actual.values[n] - x) / actual.sigma[n]) ** 2 for n, x in record.reference.items()]
    assert np.mean(squares) < 1.0
    assert np.max(squares) < 9.0


@pytest.mark.slow
def test_three_units(b_double):
    record = simulate(b_double, count=2, seed=1)
    assert "steer.last.steered" not in record.signals
    o = Observer(b_double, record.signals)
    assert o.inputs == ("speed", "steer.tractor.front")
    assert o.reported == (
        *(
            f"{quantity}.{unit}"
            for quantity in ("sideslip", "yaw_rate", "articulation", "roll", "roll_rate")
            for unit in ("tractor", "lead", "last")
            if (quantity, unit) != ("articulation", "tractor")
        ),
        *(
            f"{quantity}.{group}"
            for quantity in ("load_transfer", "predicted_load_transfer")
            for group in ("tractor.front", "tractor.drive", "lead", "last")
        ),
    )
    actual = o.batch(record)
    assert (but_settling(actual.status) == Status.OK).all()
    assert len(record.reference) == 8
    for name, truth in record.reference.items():
        assert rms(actual.values[name] - truth) < 0.1 * DEGREE, name
        assert np.abs((actual.values[name] - truth) / actual.sigma[name]).max() < 4, name
    assert_same(pushed(o, record), batched(o, record))


@pytest.mark.slow
def test_logged_steer_angle_of_a_trailer_axle(b_double):
    record = simulate(b_double, count=1, roll=False)
    straight = record.with_signals({"steer.last.steered": np.zeros(len(record))})
    turned = record.with_signals({"steer.last.steered": np.full(len(record), 0.02)})
    locked, zero_angle, steered = (
        Observer(b_double, r.signals, ObserverSettings(**EXACT)).batch(r) for r in (record, straight, turned)
    )
    for name in locked.values:
        np.testing.assert_allclose(zero_angle.values[name], locked.values[name], rtol=0, atol=1e-12)
    assert np.abs(steered.values["articulation.last"] - locked.values["articulation.last"])[0] > 0.01


def test_yaw_model_without_roll_signals(truck):
    record = simulate(truck, count=2, roll=False, seed=2)
    assert not any("roll" in name for name in (*record.signals, *record.reference))
    o = Observer(truck, record.signals)
    assert not o.roll
    assert o.reported == (
        "sideslip.tractor",
        "sideslip.semitrailer",
        "yaw_rate.tractor",
        "yaw_rate.semitrailer",
        "articulation.semitrailer",
    )
    actual = o.batch(record)
    for name, truth in record.reference.items():
        assert rms(actual.values[name] - truth) < 0.05 * DEGREE, name
    assert o.batch(record).innovation.keys() == set(YAWS)


@pytest.mark.slow
def test_articulation_sensor_is_used(truck):
    sensors = article_gyro_variance(["tractor", "semitrailer"]) | {"articulation.semitrailer": 0.005**2}
    record = simulate(truck, count=2, sensors=sensors)
    with_sensor = Observer(truck, record.signals)
    without = Observer(truck, set(record.signals) - {"articulation.semitrailer"})
    assert "articulation.semitrailer" in with_sensor.outputs
    with_states, without_states = with_sensor.batch(record), without.batch(record)
    assert (
        with_states.sigma["articulation.semitrailer"][-1] < 0.9 * without_states.sigma["articulation.semitrailer"][-1]
    )
    for actual, limit in ((with_states, 0.1), (without_states, 0.12)):  # 0.07 on average over seeds
        for name, truth in record.reference.items():
            assert rms(actual.values[name] - truth) < limit * DEGREE, name


@pytest.mark.slow
def test_roll_angle_sensors_are_used(truck):
    record = simulate(truck, count=1, sensors={YAWS[0]: 1.5e-5, "roll.tractor": 1e-6, "roll.semitrailer": 1e-6})
    o = Observer(truck, record.signals)
    assert o.roll
    assert o.outputs == (YAWS[0], "roll.tractor", "roll.semitrailer")
    assert (o.batch(record).sigma["roll.tractor"] < 0.005).all()


@pytest.mark.slow
def test_unused_signals_have_no_effect(truck, lane_changes):
    more = lane_changes.with_signals(
        {"lateral_acceleration.tractor": np.full(len(lane_changes), np.nan), "yaw.tractor": lane_changes.time}
    )
    one, other = (Observer(truck, record.signals).batch(record) for record in (lane_changes, more))
    for name in one.values:  # to rounding: the second model has a channel more, which is never measured
        np.testing.assert_allclose(one.values[name], other.values[name], rtol=0, atol=1e-14)


def test_sensor_errors_are_corrected(truck, lane_changes):
    errors = {f"{STEER}.offset": 0.01, f"{STEER}.gain": 1.1} | {
        f"{name}.offset": offset for name, offset in zip((*YAWS, *ROLLS), (0.02, -0.015, 0.03, -0.01), strict=True)
    }
    measured = {name: lane_changes.signals[name] + errors[f"{name}.offset"] for name in (*YAWS, *ROLLS)}
    measured[STEER] = lane_changes.signals[STEER] / 1.1 + 0.01
    record = lane_changes.with_signals(measured)
    expected = Observer(truck, lane_changes.signals).batch(lane_changes)
    corrected = Observer(truck, record.signals, ObserverSettings(sensor_errors=errors)).batch(record)
    wrong, tolerance = Observer(truck, record.signals).batch(record), 1e-5
    for name in expected.values:
        # the initial state depends on the logged steer angle
        np.testing.assert_allclose(corrected.values[name][400:], expected.values[name][400:], rtol=0, atol=tolerance)
        # the least effect is that on the trailer's sideslip, 0.96e-3 rad
        assert np.abs(wrong.values[name] - expected.values[name])[400:].mean() > 90 * tolerance, name
    start = record.cut(0, 2)
    streamed = pushed(Observer(truck, record.signals, ObserverSettings(sensor_errors=errors)), start)
    np.testing.assert_array_equal(
        streamed["sideslip.semitrailer"], corrected.values["sideslip.semitrailer"][: len(start)]
    )


def test_steer_offset_is_corrected_in_the_initial_state(truck, lane_changes):
    record = lane_changes.with_signals({STEER: lane_changes.signals[STEER] + 0.03}).cut(0, 0.5)  # straight
    actual = Observer(truck, record.signals, ObserverSettings(sensor_errors={f"{STEER}.offset": 0.03})).batch(record)
    for name, truth in record.reference.items():
        assert abs(actual.values[name] - truth)[0] < 0.2 * DEGREE, name


def test_steer_delay_is_corrected(truck, lane_changes):
    delay = 0.05
    steer = np.interp(lane_changes.time - delay, lane_changes.time, lane_changes.signals[STEER])
    record = lane_changes.with_signals({STEER: steer})
    settings = ObserverSettings(sensor_errors={f"{STEER}.delay": delay})
    name = "sideslip.semitrailer"
    corrected, uncorrected = (
        rms(Observer(truck, record.signals, s).batch(record).values[name] - lane_changes.reference[name])
        for s in (settings, None)
    )
    assert corrected < 0.05 * DEGREE
    assert corrected < uncorrected


@pytest.mark.slow
def test_lower_noise_gives_lower_sigma(truck, lane_changes):
    """If the sensors are as good as they are said to be; otherwise the innovations show it, and sigma rises."""
    lane_changes = lane_changes.cut(0, 6)
    settings = ObserverSettings(noise={YAWS[0]: 1e-8, YAWS[1]: 1e-8})
    usual = Observer(truck, lane_changes.signals).batch(lane_changes)
    precise = lane_changes.with_signals({name: usual.values[name] for name in YAWS})
    low, contradicted = (Observer(truck, r.signals, settings).batch(r) for r in (precise, lane_changes))
    assert low.sigma[YAWS[0]][-1] < 1.1e-4 < contradicted.sigma[YAWS[0]][-1] < usual.sigma[YAWS[0]][-1]
    assert low.sigma["sideslip.semitrailer"][-1] < usual.sigma["sideslip.semitrailer"][-1]


@pytest.mark.parametrize(
    ("available", "starts"),
    [
        ({"speed", *YAWS}, r"^steer\.tractor\.front: not in the signals"),
        ({STEER, *YAWS}, r"^speed: not among the signals"),
        ({"speed", STEER}, r"^yaw_rate\.tractor: not among the signals"),
        ({"speed", STEER, "lateral_acceleration.tractor"}, r"^yaw_rate\.tractor: "),
        ({"speed", STEER, "yaw_rate.lorry"}, r"^yaw_rate\.tractor: "),
        ({"speed", STEER, "articulation.tractor"}, r"^yaw_rate\.tractor: "),
        ({"speed", "steer.tractor.drive", *YAWS}, r"^steer\.tractor\.front: "),
        (set(), r"^steer\.tractor\.front: "),
    ],
    ids=["no steer", "no speed", "nothing", "acceleration only", "another unit", "own articulation", "rear", "none"],
)
def test_missing_signals_are_refused(truck, available, starts):
    with pytest.raises(SignalError, match=starts):
        Observer(truck, available)


def test_record_without_a_signal_of_the_observer_is_refused(truck, lane_changes):
    o = Observer(truck, {*lane_changes.signals, "articulation.semitrailer"})
    with pytest.raises(SignalError, match=r"^articulation\.semitrailer: not in simulated"):
        o.batch(lane_changes)
