"""Tyres that saturate: the observer on the nonlinear truck, beyond the range of linear tyres."""

import numpy as np
import pytest

from fifthwheel.errors import SignalError
from fifthwheel.manoeuvres.open_loops import single_sine
from fifthwheel.observe import Observer, ObserverSettings, Status, Uncertainty
from fifthwheel.plant import Plant, Properties, article_sensors, measure
from fifthwheel.record import Record
from fifthwheel.simulate import simulate
from fifthwheel.vehicle import get
from tests.observe.conftest import assert_same, batched, pushed

TRUCK = get("cheng_cebon_2011")
SIGNALS = (
    "speed",
    "steer.tractor.front",
    *(f"{q}.{u}" for q in ("yaw_rate", "roll_rate") for u in ("tractor", "semitrailer")),
)
SIDESLIP = ("sideslip.tractor", "sideslip.semitrailer")
LANE_CHANGES = simulate(TRUCK, count=1, seed=3)


def driven(acceleration: float, friction: float) -> Record:
    """A single sine with the article's sensors; the friction is a factor of that of the tyres."""
    run = Plant(TRUCK, Properties(friction=friction)).drive(single_sine(TRUCK, acceleration=acceleration))
    sensors = article_sensors(TRUCK)
    signals = measure(
        run.time, {n: run.truth[n] for n in SIGNALS}, {n: sensors[n] for n in SIGNALS if n in sensors}, seed=1
    )
    return Record(time=run.time, signals=signals, reference={n: run.truth[n] for n in SIDESLIP}, name="sine")


def errors(record: Record, **settings) -> list[float]:
    """Rms error of both sideslip angles, deg."""
    observer = Observer(TRUCK, SIGNALS, ObserverSettings(bank=0.0, steer_offset=0.0, **settings))
    states = observer.batch(record)
    return [
        float(np.degrees(np.sqrt(np.mean((states.values[name] - record.reference[name]) ** 2)))) for name in SIDESLIP
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("acceleration", "friction", "limit"),  # rms 0.07 and 0.13 deg; 0.05 and 0.19: linear tyres 0.42; 0.22 and 1.07
    [(3.0, 1.0, 0.15), (2.0, 0.3, 0.25)],
)
def test_sideslip_near_the_limit(acceleration: float, friction: float, limit: float) -> None:
    """A single sine of 0.53 g on a dry road, and one of 0.33 g on snow; the friction is known within 15 %."""
    record = driven(acceleration, friction)
    linear = errors(record)
    for factor in (0.85, 1.0):
        saturating = errors(record, friction=factor * friction)
        assert max(saturating) < limit
        assert saturating[1] < 0.4 * linear[1]


def test_push_and_batch_agree() -> None:
    observer = Observer(TRUCK, LANE_CHANGES.signals, ObserverSettings(friction=0.8))
    assert_same(pushed(observer, LANE_CHANGES), batched(observer, LANE_CHANGES))


def test_small_slip_is_linear() -> None:
    """In a lane change of 0.1 g of the linear truck both observers agree within a small part of sigma."""
    linear, saturating = (
        Observer(TRUCK, LANE_CHANGES.signals, ObserverSettings(friction=friction)).batch(LANE_CHANGES)
        for friction in (None, 0.8)
    )
    for name in SIDESLIP:
        assert np.abs(linear.values[name] - saturating.values[name]).max() < 0.5 * linear.sigma[name].min()


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


@pytest.mark.parametrize("friction", [0.0, float("nan"), 80.0])
def test_friction_out_of_range(friction: float) -> None:
    with pytest.raises(SignalError, match="friction: expected between"):
        ObserverSettings(friction=friction)


def test_a_state_is_not_resumed_with_another_friction() -> None:
    dry, snow = (Observer(TRUCK, LANE_CHANGES.signals, ObserverSettings(friction=f)) for f in (0.8, 0.3))
    with pytest.raises(SignalError, match="same vehicle"):
        snow.resume(dry.save())


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


@pytest.mark.parametrize(("friction", "seed"), [(0.85, 12), (0.85, 32), (0.3, 26), (1.5, 16)])
def test_a_diverged_filter_restarts(friction: float, seed: int) -> None:
    """No state and no sigma is NaN, and a stream restarts where a record does."""
    record = violent(seed)
    observer = Observer(TRUCK, SIGNALS, ObserverSettings(friction=friction))
    assert_same(pushed(observer, record), batched(observer, record))
    for states in (observer.batch(record), observer.smooth(record)):
        assert (states.status == Status.INCONSISTENT).mean() > 0.9
        for name, values in states.values.items():
            assert np.isfinite(values).all(), name
            assert np.isfinite(states.sigma[name]).all(), name
