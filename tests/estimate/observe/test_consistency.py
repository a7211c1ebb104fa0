"""Measurements that contradict the vehicle or its inputs: status, health figure, and restarts of the filter."""

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.filters.model import unpack_array
from fifthwheel.estimate.observe import Observer, ObserverSettings, Status
from fifthwheel.estimate.observe.monitor import START
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get
from tests.estimate.observe.conftest import (
    EXACT,
    ROLLS,
    STEER,
    YAWS,
    but_settling,
    put,
    samples,
)

TRUCK = get("cheng_cebon_2011")
LANE_CHANGES = simulate(TRUCK, count=2, seed=7)
STATES = ("sideslip.tractor", "sideslip.semitrailer", "articulation.semitrailer", "roll.semitrailer")


def scaled(name: str, factor: float) -> Record:
    return LANE_CHANGES.with_signals({name: factor * LANE_CHANGES.signals[name]})


WRONG: dict[str, Record] = {
    "steering-wheel angle": scaled(STEER, 18.0),
    "steer angle inverted": scaled(STEER, -1.0),
    "half the speed": scaled("speed", 0.5),
    "steer offset": LANE_CHANGES.with_signals({STEER: LANE_CHANGES.signals[STEER] + 0.01}),
    "yaw rate inverted": scaled(YAWS[0], -1.0),
    "steer wrong for 0.2 s": put(LANE_CHANGES, STEER, 8, 8.2, 0.1),
    "steer wrong for 1 s": put(LANE_CHANGES, STEER, 8, 9, 0.3),
    "wrong yaw rates": put(put(LANE_CHANGES, YAWS[0], 8, 9, 0.8), YAWS[1], 8, 9, 0.8),
}
BRIEF = ("steer wrong for 0.2 s", "steer wrong for 1 s", "wrong yaw rates")


def observer(**changes) -> Observer:
    return Observer(TRUCK, LANE_CHANGES.signals, ObserverSettings(**{**EXACT, **changes}))


def beyond(o: Observer, record: Record, sigmas: float) -> np.ndarray:
    """Samples in which a state differs from the truth by more than so many sigmas."""
    actual = o.batch(record)
    errors = [np.abs(actual.values[n] - LANE_CHANGES.reference[n]) / actual.sigma[n] for n in STATES]
    return np.any(np.array(errors) > sigmas, axis=0)


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG)
def test_wrong_signals_are_inconsistent_and_do_not_last(name: str) -> None:
    """Brief errors restart the filter: without that, 0.3 rad of steer angle for a second made the states wrong for
    4.7 s."""
    o, record = observer(), WRONG[name]
    actual = o.batch(record)
    inconsistent = actual.status == Status.INCONSISTENT
    np.testing.assert_array_equal(inconsistent, actual.nis > 4)
    for values in (*actual.values.values(), *actual.sigma.values()):
        assert np.isfinite(values).all()
    if name not in BRIEF:
        assert inconsistent.sum() > 400
        return
    assert (actual.status[record.time > 8.0] == Status.SETTLING).sum() > 20
    wrong = beyond(o, record, 5)
    assert wrong[record.time < 8].sum() == 0
    assert (wrong & (actual.status == Status.OK)).sum() <= 25  # 0.25 s
    assert not wrong[record.time >= 9.25].any()
    assert (but_settling(actual.status[record.time > 11.5]) == Status.OK).all()


@pytest.mark.slow
def test_covariances_remain_positive() -> None:
    o = Observer(TRUCK, LANE_CHANGES.signals)
    smallest = np.inf
    for sample in samples(WRONG["wrong yaw rates"].cut(7.5, 11.0)):
        o.push(sample)
        n = len(o.model.states)
        P = unpack_array(np.array(o._filter.carry[n : -n - len(START)]), n)
        scale = np.sqrt(np.diag(P))
        smallest = min(smallest, np.linalg.eigvalsh(P / np.outer(scale, scale)).min())
    assert smallest > 1e-12


def test_consistent_measurements_have_a_nis_of_one() -> None:
    actual = observer().batch(LANE_CHANGES)
    assert (but_settling(actual.status) == Status.OK).all()
    assert actual.nis[0] == 1.0
    assert actual.nis[100:].mean() == pytest.approx(1.0, abs=0.1)
    assert np.abs(actual.nis - 1).max() < 0.3


def test_an_outlier_in_all_channels_restarts_nothing() -> None:
    record = LANE_CHANGES
    for name in (*YAWS, *ROLLS):
        record = put(record, name, 8.0, 8.0 + 5e-3, 1.0)
    actual, plain = observer().batch(record), observer().batch(LANE_CHANGES)
    assert (but_settling(actual.status) == Status.OK).all()
    for name in STATES:
        assert np.abs(actual.sigma[name] / plain.sigma[name] - 1).max() < 0.05, name


def test_measurements_far_apart_do_not_make_a_restart_of_one_outlier() -> None:
    keep = np.arange(0, len(LANE_CHANGES), 50)
    slow = {n: np.where(np.isin(np.arange(len(LANE_CHANGES)), keep), LANE_CHANGES.signals[n], np.nan) for n in YAWS}
    record = LANE_CHANGES.with_signals(slow | {n: np.full(len(LANE_CHANGES), np.nan) for n in ROLLS})
    spiked = record
    for name in YAWS:
        spiked = put(spiked, name, 8.0, 8.0 + 5e-3, 1.0)
    without = put(put(record, YAWS[0], 8.0, 8.0 + 5e-3, np.nan), YAWS[1], 8.0, 8.0 + 5e-3, np.nan)
    a, b = observer().batch(spiked), observer().batch(without)
    for name in STATES:
        np.testing.assert_array_equal(a.values[name], b.values[name])


def test_smoothing_divides_the_record_at_restarts() -> None:
    record = WRONG["steer wrong for 1 s"]
    filtered, smoothed = observer().batch(record), observer().smooth(record)
    np.testing.assert_array_equal(but_settling(filtered.status), but_settling(smoothed.status))
    np.testing.assert_array_equal(filtered.nis, smoothed.nis)
    for name in STATES:
        assert np.isfinite(smoothed.values[name]).all()
        error = np.abs(smoothed.values[name] - record.reference[name])[record.time > 9.5]
        assert (error < 5 * smoothed.sigma[name][record.time > 9.5]).all(), name


def test_largest_nis() -> None:
    for limit, expected in ((1e9, 0), (0.1, len(LANE_CHANGES))):
        assert (observer(max_nis=limit).batch(LANE_CHANGES).status == Status.INCONSISTENT).sum() == expected


def test_large_innovations_raise_sigma() -> None:
    """With more noise of the yaw rates than stated, every variance is multiplied by NIS / 1.5."""
    rng, noise = np.random.default_rng(3), 2 * np.sqrt(article_gyro_variance(("tractor",))[YAWS[0]])
    noisy = {name: LANE_CHANGES.signals[name] + noise * rng.normal(size=len(LANE_CHANGES)) for name in YAWS}
    o, steady = observer(gate=20.0), LANE_CHANGES.time > 5
    actual, plain = o.batch(LANE_CHANGES.with_signals(noisy)), o.batch(LANE_CHANGES)
    assert (actual.nis[steady] > 2).all()
    for name in STATES:
        factor = (actual.sigma[name] / plain.sigma[name])[steady] ** 2
        np.testing.assert_allclose(factor, actual.nis[steady] / 1.5, rtol=1e-9)
