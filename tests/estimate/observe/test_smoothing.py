"""Smoothed states against the truth and against dense Gaussian conditioning."""

import numpy as np
import pytest
from scipy.stats import chi2

from fifthwheel.estimate.filters import kalman
from fifthwheel.estimate.observe import Observer, ObserverSettings, Status
from tests.estimate.observe.conftest import EXACT, STEER, assert_same, but_settling
from tests.estimate.observe.exact import OUTPUTS, TRUCK, exact_system, lane_change_steer, simulate_exact
from tests.estimate.observe.test_stream import LANE_CHANGES, SCENARIOS, observer

SEEDS = 40
each = pytest.mark.parametrize("name", SCENARIOS)


def columns(states) -> dict[str, np.ndarray]:
    """Every column of the states."""
    sigma = {f"{name}.sigma": values for name, values in states.sigma.items()}
    return {"time": states.time, "status": states.status, **states.values, **sigma}


def rms(error) -> float:
    return float(np.sqrt(np.mean(np.square(error))))


def within(squares: np.ndarray, chance: float = 1e-5) -> bool:
    """Whether the mean of squares of independent standard normals is within its chi-square interval."""
    low, high = chi2.ppf([chance / 2, 1 - chance / 2], squares.size) / squares.size
    return bool(low < squares.mean() < high)


@pytest.mark.slow
def test_errors_are_smaller_than_those_of_the_filter_and_agree_with_sigma():
    """With a simulation by the model, including process noise, errors over sigma are standard normal."""
    time = np.arange(600) / 100
    steer, random = lane_change_steer(time), np.random.default_rng(5)
    system = exact_system(time, steer[0])
    o = Observer(TRUCK, {"speed", STEER, *OUTPUTS}, ObserverSettings(gate=1e6, **EXACT))
    normalised, by_filter, by_smoother = {}, {}, {}
    for _ in range(SEEDS):
        record = simulate_exact(system, time, steer, random)
        filtered, actual = o.batch(record), o.smooth(record)
        for name, truth in record.reference.items():
            normalised.setdefault(name, []).append((actual.values[name] - truth) / actual.sigma[name])
            by_smoother.setdefault(name, []).append(actual.values[name] - truth)
            by_filter.setdefault(name, []).append(filtered.values[name] - truth)
    for name, runs in normalised.items():
        for k in (0, 100, 300, 599):  # runs are independent
            assert within(np.array(runs)[:, k] ** 2), (name, k)
        assert rms(by_smoother[name]) < 0.95 * rms(by_filter[name]), name
    assert rms(by_smoother["articulation.semitrailer"]) < 0.7 * rms(by_filter["articulation.semitrailer"])


@pytest.mark.parametrize("process_noise", [1.0, 0.0])
def test_equals_the_dense_solution(process_noise):
    """The joint Gaussian of all states of a short irregular record with gaps, given all measurements."""
    random = np.random.default_rng(2)
    N = 70
    time = np.cumsum(random.choice([0.004, 0.007, 0.01], size=N))
    steer = 0.02 * np.sin(9 * time)
    system = exact_system(time, steer[0], process_noise=process_noise)
    record = simulate_exact(system, time, steer, random)
    lost = {name: np.where(random.random(N) < 0.3, np.nan, record.signals[name]) for name in OUTPUTS}
    record = record.with_signals({name: np.where(time - time[0] < 0.1, np.nan, v) for name, v in lost.items()})
    settings = ObserverSettings(gate=1e6, process_noise=process_noise, **EXACT)
    actual = Observer(TRUCK, record.signals, settings).smooth(record)

    n = len(system.x0)
    mean, covariance = np.zeros(N * n), np.zeros((N * n, N * n))
    x, P, past = system.x0, system.P0, np.zeros((n, 0))
    for k in range(N):
        block = slice(k * n, (k + 1) * n)
        if k:
            F = system.F[k]
            x = F @ x + system.before[k] * steer[k - 1] + system.after[k] * steer[k]
            P, past = F @ P @ F.T + np.diag(system.Q[k]), F @ past
        mean[block], covariance[block, block] = x, P
        covariance[block, : k * n], covariance[: k * n, block] = past, past.T
        past = np.hstack([past, P])
    measured = np.column_stack([record.signals[name] for name in OUTPUTS])
    k, i = np.nonzero(np.isfinite(measured))
    indices = k * n + np.array([system.states.index(name) for name in OUTPUTS])[i]
    S = covariance[np.ix_(indices, indices)] + np.diag(system.R[i])
    gain = np.linalg.solve(S, covariance[indices]).T
    mean = mean + gain @ (measured[k, i] - mean[indices])
    covariance = covariance - gain @ covariance[indices]
    for name in (name for name in actual.values if not name.startswith("predicted_load_transfer.")):
        row = system.rows(name)
        expected = mean.reshape(N, n) @ row
        variance = np.array([row @ covariance[j * n : j * n + n, j * n : j * n + n] @ row for j in range(N)])
        np.testing.assert_allclose(actual.values[name], expected, rtol=0, atol=2e-6 * np.abs(expected).max())
        np.testing.assert_allclose(actual.sigma[name] ** 2, variance, rtol=1e-5)


@each
def test_status_and_nan_are_those_of_the_filter(name):
    o, record = observer(), SCENARIOS[name]
    filtered, actual = o.batch(record), o.smooth(record)
    np.testing.assert_array_equal(but_settling(actual.status), but_settling(filtered.status))
    assert set(np.flatnonzero(actual.status == Status.SETTLING)) <= set(np.flatnonzero(filtered.status != Status.OK))
    valid = np.isin(actual.status, [Status.OK, Status.COASTING, Status.SETTLING])
    for signal, values in actual.values.items():
        assert np.isfinite(values[valid]).all(), signal
        assert np.isnan(values[~valid]).all(), signal
        assert np.isnan(actual.sigma[signal][~valid]).all(), signal
        assert (actual.sigma[signal][valid] > 0).all(), signal
        assert (actual.sigma[signal][valid] <= filtered.sigma[signal][valid] * (1 + 1e-9)).all(), signal
    for signal in actual.innovation:
        np.testing.assert_array_equal(actual.innovation[signal], filtered.innovation[signal])
        np.testing.assert_array_equal(actual.accepted[signal], filtered.accepted[signal])


@each
def test_last_sample_of_a_segment_equals_that_of_the_filter(name):
    o, record = observer(), SCENARIOS[name]
    filtered, actual = o.batch(record), o.smooth(record)
    valid = np.isin(actual.status, [Status.OK, Status.COASTING, Status.SETTLING])
    gap = np.diff(record.time, append=np.inf) > o.settings.max_gap
    ends = np.flatnonzero(valid & (gap | ~np.append(valid[1:], False)))
    for signal in actual.values:
        scale = max(np.abs(filtered.values[signal][valid]).max(initial=0.0), 1e-3)
        np.testing.assert_allclose(actual.values[signal][ends], filtered.values[signal][ends], atol=1e-9 * scale)
        np.testing.assert_allclose(actual.sigma[signal][ends], filtered.sigma[signal][ends], rtol=1e-7)


def test_stretches_know_nothing_of_each_other():
    record = SCENARIOS["gap in time"]
    batch_result, later = observer().smooth(record), observer().smooth(record.cut(5.0))
    part = record.time > 5
    assert 0 < part.sum() < len(record)
    assert_same(columns(later), {name: values[part] for name, values in columns(batch_result).items()})


def test_result_does_not_depend_on_the_chunks(monkeypatch):
    batch_result = columns(observer().smooth(LANE_CHANGES))
    for chunk in (37, 100_000):
        monkeypatch.setattr(kalman, "CHUNK", chunk)
        assert_same(columns(observer().smooth(LANE_CHANGES)), batch_result)


def test_a_spike_counts_as_missing():
    spikes = SCENARIOS["spiked"]
    without_spikes = spikes.with_signals(
        {
            name: np.where(spikes.signals[name] != LANE_CHANGES.signals[name], np.nan, spikes.signals[name])
            for name in OUTPUTS
        }
    )
    assert_same(columns(observer().smooth(spikes)), columns(observer().smooth(without_spikes)))


def test_smoothing_does_not_change_the_stream():
    o = observer()
    before = o.save()
    o.smooth(LANE_CHANGES)
    assert o.save() == before


def test_segment_of_one_sample():
    speed = np.where(np.arange(len(LANE_CHANGES)) == 700, 5.1, 4.99)
    record = LANE_CHANGES.with_signals({"speed": speed})
    filtered, actual = observer().batch(record), observer().smooth(record)
    assert (but_settling(actual.status) == Status.OK).sum() == 1
    for name in actual.values:
        assert actual.values[name][700] == pytest.approx(filtered.values[name][700], rel=1e-9, abs=1e-15)
        assert actual.sigma[name][700] == pytest.approx(filtered.sigma[name][700], rel=1e-9)
