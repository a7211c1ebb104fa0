"""Smoothed states against the truth and against dense Gaussian conditioning."""

import numpy as np
import pytest
from scipy.stats import chi2

from fifthwheel.estimate.filters import kalman
from fifthwheel.estimate.observe import Observer, ObserverSettings, Status
from tests.estimate.observe.conftest import EXACT, STEER, assert_same, but_settling
from tests.estimate.observe.exact import OUTPUTS, TRUCK, exact_system, lane_change_steer, simulate_exact
from tests.estimate.observe.test_stream import LANE_CHANGES, SCENARIOS, observer

each = pytest.mark.parametrize("name", SCENARIOS)


def columns(states) -> dict[str, np.ndarray]:
    """Every column of the states."""
    sigma = {f"{name}.sigma": values for name, values in states.sigma.items()}
    return {"time": states.time, "status": states.status, **states.values, **sigma}


def within(squares: np.ndarray, chance: float = 1e-5) -> bool:
    """Whether the mean of squares of independent standard normals is within its chi-square interval."""
    low, high = chi2.ppf([chance / 2, 1 - chance / 2], squares.size) / squares.size
    return bool(low < squares.mean() < high)


@pytest.mark.slow
def test_errors_and_innovations_agree_with_sigma():
    """Of 30 simulations by the model, including process noise; the smoother has smaller errors than the filter."""
    time = np.arange(600) / 100
    steer, random = lane_change_steer(time), np.random.default_rng(5)
    system = exact_system(time, steer[0])
    o = Observer(TRUCK, {"speed", STEER, *OUTPUTS}, ObserverSettings(gate=1e6, **EXACT))
    runs, normalised, innovations = {}, {}, []
    for _ in range(30):
        record = simulate_exact(system, time, steer, random)
        both = filtered, _ = o.batch(record), o.smooth(record)
        for name, truth in record.reference.items():
            errors = np.array([states.values[name] - truth for states in both])
            runs.setdefault(name, []).append(errors)
            normalised.setdefault(name, []).append(errors / [states.sigma[name] for states in both])
        innovations.append([filtered.innovation[n] / filtered.innovation_sigma[n] for n in o.outputs])
    for name, found in normalised.items():
        for k in (0, 100, 300, 599):  # runs are independent
            for errors in np.array(found)[:, :, k].T:
                assert within(errors**2), (name, k)
                assert abs(np.mean(errors)) * np.sqrt(len(errors)) < 4.5, (name, k)
        by_filter, by_smoother = np.sqrt(np.mean(np.square(runs[name]), axis=(0, 2)))
        assert by_smoother < (0.7 if name.startswith("articulation") else 0.95) * by_filter, name
    for i, name in enumerate(o.outputs):
        assert within(np.array(innovations)[:, i] ** 2), name
    autocorrelation = np.mean(np.array(innovations)[..., 1:] * np.array(innovations)[..., :-1])
    assert abs(autocorrelation) * np.sqrt(np.size(innovations)) < 4.5


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
def test_status_and_nan_are_those_of_the_filter_and_the_last_sample_of_a_segment_too(name):
    o, record = observer(), SCENARIOS[name]
    filtered, actual = o.batch(record), o.smooth(record)
    np.testing.assert_array_equal(but_settling(actual.status), but_settling(filtered.status))
    assert set(np.flatnonzero(actual.status == Status.SETTLING)) <= set(np.flatnonzero(filtered.status != Status.OK))
    valid = np.isin(actual.status, [Status.OK, Status.COASTING, Status.SETTLING])
    gap = np.diff(record.time, append=np.inf) > o.settings.max_gap
    ends = np.flatnonzero(valid & (gap | ~np.append(valid[1:], False)))
    for signal, values in actual.values.items():
        sigma, of_filter = actual.sigma[signal], filtered.sigma[signal]
        assert np.isfinite(values[valid]).all(), signal
        assert np.isnan(values[~valid]).all(), signal
        assert np.isnan(sigma[~valid]).all(), signal
        assert (sigma[valid] > 0).all(), signal
        assert (sigma[valid] <= of_filter[valid] * (1 + 1e-9)).all(), signal
        scale = max(np.abs(filtered.values[signal][valid]).max(initial=0.0), 1e-3)
        np.testing.assert_allclose(values[ends], filtered.values[signal][ends], atol=1e-9 * scale)
        np.testing.assert_allclose(sigma[ends], of_filter[ends], rtol=1e-7)
    for signal in actual.innovation:
        np.testing.assert_array_equal(actual.innovation[signal], filtered.innovation[signal])
        np.testing.assert_array_equal(actual.accepted[signal], filtered.accepted[signal])


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
