"""Tyres that saturate: the observer on the nonlinear truck, beyond the range of linear tyres."""

from collections.abc import Iterable

import casadi as ca
import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.model import pack_array
from fifthwheel.estimate.observe import Observer, ObserverSettings, Status, Uncertainty, monitor
from fifthwheel.model.manoeuvres import braked
from fifthwheel.model.manoeuvres.open_loops import single_sine
from fifthwheel.model.plant import Plant, Properties, Sensor, article_sensors, measure
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, get
from fifthwheel.truck.unit import Accelerometer
from tests.estimate.observe.conftest import assert_same, batched, pushed

pytestmark = pytest.mark.slow

TRUCK = get("cheng_cebon_2011")
SIGNALS = (
    "speed",
    "steer.tractor.front",
    *(f"{q}.{u}" for q in ("yaw_rate", "roll_rate") for u in ("tractor", "semitrailer")),
)
SIDESLIP = ("sideslip.tractor", "sideslip.semitrailer")
ACCELERATION = "lateral_acceleration.tractor"
LANE_CHANGES = simulate(TRUCK, count=1, seed=3)


def placed(position: float, height: float) -> Vehicle:
    """The truck with an accelerometer on the tractor."""
    tractor, *others = TRUCK.units
    tractor = tractor.model_copy(update={"accelerometer": Accelerometer(position=position, height=height)})
    return TRUCK.model_copy(update={"units": (tractor, *others)})


def driven(acceleration: float, friction: float, braking: float = 0.0, **properties) -> Record:
    """A single sine with the article's sensors; the friction is a factor of that of the tyres.

    While braking the sine begins later, and the speed has a noise of 0.1 m/s.
    """
    course = single_sine(TRUCK, acceleration=acceleration, lead=2.0 if braking else 1.0)
    plant = Plant(TRUCK, Properties(friction=friction, **properties))
    run = plant.drive(braked(course, braking) if braking else course)
    sensors = article_sensors(TRUCK) | {"speed": Sensor(variance=0.01 if braking else 0.0)}
    signals = measure(
        run.time, {n: run.truth[n] for n in SIGNALS}, {n: sensors[n] for n in SIGNALS if n in sensors}, seed=1
    )
    return Record(time=run.time, signals=signals, reference={n: run.truth[n] for n in SIDESLIP}, name="sine")


def errors(record: Record, truck: Vehicle = TRUCK, signals: Iterable[str] = SIGNALS, **settings) -> list[float]:
    """Rms error of both sideslip angles, deg."""
    observer = Observer(truck, signals, ObserverSettings(bank=0.0, steer_offset=0.0, **settings))
    states = observer.batch(record)
    return [
        float(np.degrees(np.sqrt(np.mean((states.values[name] - record.reference[name]) ** 2)))) for name in SIDESLIP
    ]


def test_sideslip_near_the_limit() -> None:
    """A single sine of 0.33 g on snow, whose friction is known within 15 %: rms 0.22 deg, linear tyres 1.07."""
    record = driven(2.0, 0.3)
    saturating = errors(record, friction=0.85 * 0.3)
    assert max(saturating) < 0.25
    assert saturating[1] < 0.4 * errors(record)[1]


def test_sideslip_while_braking() -> None:
    """A single sine of 0.54 g with 3 m/s^2 on a dry road and a noisy speed.

    Rms of tractor and trailer 0.04 and 0.11 deg; 0.21 and 0.28 without braking, 0.29 and 0.72 with linear tyres.
    """
    record = driven(3.0, 1.0, 3.0)
    assert max(errors(record, friction=0.74)) < 0.15
    assert max(errors(record, friction=0.74, speed_smoothing=np.inf)) > 1.5 * 0.15
    assert max(errors(record)) > 0.15


def test_sideslip_with_a_retarder() -> None:
    """Of 1 m/s^2 at 0.36 g: rms of tractor and trailer 0.02 and 0.07 deg; 0.26 and 0.10 if all groups braked."""
    record = driven(1.5, 1.0, 1.0, brakes={"tractor.drive": 1.0})
    assert max(errors(record, friction=0.74, surroundings={"brakes.drive_axle": 1.0})) < 0.1
    assert max(errors(record, friction=0.74)) > 0.2


def test_push_and_batch_agree_while_braking() -> None:
    """With a speed that falls by 1 m/s^2, and its noise."""
    noise = 0.1 * np.random.default_rng(5).normal(size=len(LANE_CHANGES))
    record = LANE_CHANGES.with_signals({"speed": LANE_CHANGES.signals["speed"] - LANE_CHANGES.time + noise})
    observer = Observer(TRUCK, record.signals, ObserverSettings(friction=0.8))
    assert_same(pushed(observer, record), batched(observer, record))


def test_an_accelerometer_near_the_limit() -> None:
    """On a road with a bank, in a single sine of 0.5 g, away from the CoG: its offset is estimated, and it measures
    gravity by the bank.

    Rms 0.018 and 0.038 deg without it, 0.015 and 0.036 with it; 0.047 and 0.096 if misplaced, 0.097 and 0.139 if its
    offset is ignored.
    """
    truck = placed(-1.5, 1.5)
    run = Plant(truck, Properties(bank=0.02)).drive(single_sine(TRUCK, acceleration=2.0))
    sensors = {name: sensor for name, sensor in article_sensors(TRUCK).items() if name in SIGNALS}
    sensors[ACCELERATION] = Sensor(variance=0.05**2, bias=0.2)
    signals = measure(run.time, run.truth, sensors, seed=1)
    record = Record(time=run.time, signals=signals, reference={n: run.truth[n] for n in SIDESLIP}, name="sine")
    settings = {"friction": 0.74, "bank_mean": 0.02}
    without, more = errors(record, **settings), (*SIGNALS, ACCELERATION)
    settings["noise"] = {ACCELERATION: 0.05**2}
    exact, misplaced = (errors(record, vehicle, more, **settings) for vehicle in (truck, TRUCK))
    ignored = errors(record, truck, more, **settings, acceleration_offset=0.0)
    for i in range(2):
        assert exact[i] < 0.97 * without[i]
        assert misplaced[i] > 1.3 * exact[i]
        assert ignored[i] > 1.5 * exact[i]
    means = []
    for mean in (0.02, 0.0):
        known = {"acceleration_offset": 0.0, "sensor_errors": {f"{ACCELERATION}.offset": 0.2}, "bank_mean": mean}
        observer = Observer(truck, more, ObserverSettings(bank=0.0, steer_offset=0.0, friction=0.74, **known))
        means.append(np.mean(observer.batch(record).innovation[ACCELERATION][record.time < 1.0]))
    assert abs(means[0]) < 0.02
    assert abs(means[1]) > 0.05


def test_uncertain_friction_is_in_sigma() -> None:
    """Its part of sigma is the change of the states with the friction, with the gains of the filter as they are."""

    def observer(friction: float) -> Observer:
        return Observer(TRUCK, LANE_CHANGES.signals, ObserverSettings(friction=friction))

    known, more, less = (observer(friction).batch(LANE_CHANGES) for friction in (1.2, 1.21, 1.19))
    uncertain = observer(1.2).batch(LANE_CHANGES, Uncertainty(names=("road.friction",), covariance=[[0.1**2]]))
    for name in SIDESLIP:
        part = np.sqrt(np.maximum(uncertain.sigma[name] ** 2 - known.sigma[name] ** 2, 0.0))
        change = 0.1 * np.abs(more.values[name] - less.values[name]) / 0.02
        assert change.max() > np.radians(1e-3)
        assert 0.8 < np.sqrt(np.mean(part**2) / np.mean(change**2)) < 1.2, name


def violent(seed: int, samples: int = 300) -> Record:
    """Random steering at irregular times, and random yaw rates and roll rates of any truck that tumbles."""
    rng = np.random.default_rng(seed)
    step = 10 ** rng.uniform(-3, -0.4, samples)
    steer, speed = np.zeros(samples), np.full(samples, 30.0)
    for k in range(1, samples):
        steer[k] = np.clip(steer[k - 1] + rng.uniform(-2.8, 2.8) * step[k], -0.9, 0.9)
        speed[k] = np.clip(speed[k - 1] + rng.uniform(-15, 15) * step[k], 6.0, 40.0)
    rates = {n: np.where(rng.random(samples) < 0.9, 4.5 * rng.normal(size=samples), np.nan) for n in SIGNALS[2:]}
    return Record(time=np.cumsum(step), signals={"speed": speed, "steer.tractor.front": steer} | rates, name="violent")


def test_a_diverged_filter_restarts() -> None:
    """No state and no sigma is NaN, and a stream restarts where a record does."""
    record = violent(seed=26)
    observer = Observer(TRUCK, SIGNALS, ObserverSettings(friction=0.3))
    assert_same(pushed(observer, record), batched(observer, record))
    states = observer.batch(record)
    assert (states.status == Status.INCONSISTENT).mean() > 0.9
    for name, values in states.values.items():
        assert np.isfinite(values).all(), name
        assert np.isfinite(states.sigma[name]).all(), name


def test_each_channel_is_linearised_at_the_corrected_state() -> None:
    """The first sample after a start with a wide sigma, in NumPy; an accelerometer on saturating tyres is nonlinear."""
    observer = Observer(
        TRUCK, (*SIGNALS, ACCELERATION), ObserverSettings(friction=0.5, gate=1e6, bank=0.0, steer_offset=0.0)
    )
    model, inputs = observer.model, [24.0, 0.03, 0.0]
    n, m = len(model.states), len(model.outputs)
    variance = np.array([0.2, 0.1, 0.1, 0.1, 0.02, 0.02, 0.1, 0.1, *np.full(n - 9, 0.05), 0.09]) ** 2
    y, d = np.array([0.1, 0.08, 0.0, 0.0, 3.0]), np.array([*inputs, *inputs])
    carry = np.concatenate([np.zeros(n), pack_array(np.diag(variance)), np.zeros(n), monitor.START])
    after, _ = observer.scan(carry, np.concatenate([[0.0], d, y, np.ones(m)])[None], observer.constant)

    c, noise = observer.constant[: len(model.known)], observer.constant[len(model.known) + n * (n + 1) // 2 :][:m]
    state = ca.SX.sym("x", n)
    outputs = model.observation(state, d, [], c)
    h = ca.Function("h", [state], [outputs, model.observation_jacobian(state, d, [], c)[:, :n]])
    x, P = np.zeros(n), np.diag(variance)
    at_start = np.array(h(x)[1])[-1]
    for i in range(m):
        predicted, H = (np.array(value)[i] for value in h(x))
        K = P @ H / (H @ P @ H + noise[i])
        x, P = x + K * (y[i] - predicted), P - np.outer(K, H @ P)
    assert np.abs(H / at_start - 1).max() > 0.1
    np.testing.assert_allclose(after[:n], x, atol=1e-9)
