"""The smoothed states: against the truth, and against all samples of a short record at once."""

import numpy as np
import pytest
from scipy.stats import chi2

from fifthwheel.observe import Observer, ObserverSettings, Status, passes

from .conftest import STEER, assert_same
from .exact import OUTPUTS, TRUCK, drive, exact, lane_change
from .test_stream import DRIVE, SCENARIOS, observer

SEEDS = 40
each = pytest.mark.parametrize("name", SCENARIOS)


def columns(states) -> dict[str, np.ndarray]:
    """Every column of the states."""
    sigma = {f"{name}.sigma": values for name, values in states.sigma.items()}
    return {"time": states.time, "status": states.status, **states.values, **sigma}


def rms(error) -> float:
    return float(np.sqrt(np.mean(np.square(error))))


def within(squares: np.ndarray, chance: float = 1e-5) -> bool:
    """Whether a mean of squares of so many independent standard normals may be that large, or that small."""
    low, high = chi2.ppf([chance / 2, 1 - chance / 2], squares.size) / squares.size
    return bool(low < squares.mean() < high)


def test_errors_are_smaller_than_the_filters_and_sigma_is_honest():
    """A truck that moves as the model says, process noise included: errors over sigma are standard normal."""
    time = np.arange(600) / 100
    steer, random = lane_change(time), np.random.default_rng(5)
    system = exact(time, steer[0])
    o = Observer(TRUCK, {"speed", STEER, *OUTPUTS}, ObserverSettings(gate=1e6))
    over, by_filter, by_smoother = {}, {}, {}
    for _ in range(SEEDS):
        record = drive(system, time, steer, random)
        filtered, found = o.batch(record), o.smooth(record)
        for name, truth in record.reference.items():
            over.setdefault(name, []).append((found.values[name] - truth) / found.sigma[name])
            by_smoother.setdefault(name, []).append(found.values[name] - truth)
            by_filter.setdefault(name, []).append(filtered.values[name] - truth)
    for name, runs in over.items():
        for k in (0, 100, 300, 599):  # one instant: independent runs
            assert within(np.array(runs)[:, k] ** 2), (name, k)
        assert rms(by_smoother[name]) < 0.95 * rms(by_filter[name]), name
    assert rms(by_smoother["articulation.semitrailer"]) < 0.7 * rms(by_filter["articulation.semitrailer"])


@pytest.mark.parametrize("process_noise", [1.0, 0.0])
def test_all_samples_at_once(process_noise):
    """The joint Gaussian of all states of a short record, irregular and with holes, given everything measured."""
    random = np.random.default_rng(2)
    N = 70
    time = np.cumsum(random.choice([0.004, 0.007, 0.01], size=N))
    steer = 0.02 * np.sin(9 * time)
    system = exact(time, steer[0], process_noise=process_noise)
    record = drive(system, time, steer, random)
    lost = {name: np.where(random.random(N) < 0.3, np.nan, record.signals[name]) for name in OUTPUTS}
    record = record.with_signals({name: np.where(time - time[0] < 0.1, np.nan, v) for name, v in lost.items()})
    found = Observer(TRUCK, record.signals, ObserverSettings(gate=1e6, process_noise=process_noise)).smooth(record)

    n = len(system.x0)
    mean, covariance = np.zeros(N * n), np.zeros((N * n, N * n))
    x, own, past = system.x0, system.P0, np.zeros((n, 0))
    for k in range(N):
        at = slice(k * n, (k + 1) * n)
        if k:
            F = system.F[k]
            x = F @ x + system.before[k] * steer[k - 1] + system.after[k] * steer[k]
            own, past = F @ own @ F.T + np.diag(system.Q[k]), F @ past
        mean[at], covariance[at, at] = x, own
        covariance[at, : k * n], covariance[: k * n, at] = past, past.T
        past = np.hstack([past, own])
    measured = np.column_stack([record.signals[name] for name in OUTPUTS])
    k, i = np.nonzero(np.isfinite(measured))
    places = k * n + np.array([system.states.index(name) for name in OUTPUTS])[i]
    S = covariance[np.ix_(places, places)] + np.diag(system.R[i])
    gain = np.linalg.solve(S, covariance[places]).T
    mean = mean + gain @ (measured[k, i] - mean[places])
    covariance = covariance - gain @ covariance[places]
    for name in found.values:
        row = system.rows(name)
        expected = mean.reshape(N, n) @ row
        variance = np.array([row @ covariance[j * n : j * n + n, j * n : j * n + n] @ row for j in range(N)])
        np.testing.assert_allclose(found.values[name], expected, rtol=0, atol=2e-6 * np.abs(expected).max())
        np.testing.assert_allclose(found.sigma[name] ** 2, variance, rtol=1e-5)


@each
def test_status_and_holes_are_those_of_the_filter(name):
    o, record = observer(), SCENARIOS[name]
    filtered, found = o.batch(record), o.smooth(record)
    np.testing.assert_array_equal(found.status, filtered.status)
    good = np.isin(found.status, [Status.OK, Status.COASTING])
    for signal, values in found.values.items():
        assert np.isfinite(values[good]).all(), signal
        assert np.isnan(values[~good]).all(), signal
        assert np.isnan(found.sigma[signal][~good]).all(), signal
        assert (found.sigma[signal][good] > 0).all(), signal
        assert (found.sigma[signal][good] <= filtered.sigma[signal][good] * (1 + 1e-9)).all(), signal
    for signal in found.innovation:
        np.testing.assert_array_equal(found.innovation[signal], filtered.innovation[signal])
        np.testing.assert_array_equal(found.accepted[signal], filtered.accepted[signal])


@each
def test_at_the_end_of_a_stretch_nothing_is_still_to_come(name):
    o, record = observer(), SCENARIOS[name]
    filtered, found = o.batch(record), o.smooth(record)
    good = np.isin(found.status, [Status.OK, Status.COASTING])
    gap = np.diff(record.time, append=np.inf) > o.settings.max_gap
    ends = np.flatnonzero(good & (gap | ~np.append(good[1:], False)))
    for signal in found.values:
        scale = max(np.abs(filtered.values[signal][good]).max(initial=0.0), 1e-3)
        np.testing.assert_allclose(found.values[signal][ends], filtered.values[signal][ends], atol=1e-9 * scale)
        np.testing.assert_allclose(found.sigma[signal][ends], filtered.sigma[signal][ends], rtol=1e-7)


def test_stretches_know_nothing_of_each_other():
    record = SCENARIOS["gap in time"]
    whole, later = observer().smooth(record), observer().smooth(record.cut(5.0))
    part = record.time > 5
    assert 0 < part.sum() < len(record)
    assert_same(columns(later), {name: values[part] for name, values in columns(whole).items()})


def test_however_the_rows_are_parted(monkeypatch):
    whole = columns(observer().smooth(DRIVE))
    for chunk in (37, 100_000):
        monkeypatch.setattr(passes, "CHUNK", chunk)
        assert_same(columns(observer().smooth(DRIVE)), whole)


def test_a_spike_counts_as_missing():
    spikes = SCENARIOS["spiked"]
    blanked = spikes.with_signals(
        {name: np.where(spikes.signals[name] != DRIVE.signals[name], np.nan, spikes.signals[name]) for name in OUTPUTS}
    )
    assert_same(columns(observer().smooth(spikes)), columns(observer().smooth(blanked)))


def test_the_stream_is_left_alone():
    o = observer()
    before = o.save()
    o.smooth(DRIVE)
    assert o.save() == before


def test_a_stretch_of_one_sample():
    speed = np.where(np.arange(len(DRIVE)) == 700, DRIVE.signals["speed"], 1.0)
    record = DRIVE.with_signals({"speed": speed})
    filtered, found = observer().batch(record), observer().smooth(record)
    assert (found.status == Status.OK).sum() == 1
    for name in found.values:
        assert found.values[name][700] == pytest.approx(filtered.values[name][700], rel=1e-9, abs=1e-15)
        assert found.sigma[name][700] == pytest.approx(filtered.sigma[name][700], rel=1e-9)
