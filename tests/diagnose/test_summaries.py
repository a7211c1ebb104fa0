"""Runs, fits and states in a few numbers."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.diagnose.fit_quality import FitQuality, fit_quality, predicted_logs, white_noise_sigma
from fifthwheel.diagnose.run_summary import summarise_records, summarise_runs
from fifthwheel.diagnose.state_summary import summarise_states
from tests.report.conftest import NASTY


def test_lateral_acceleration(result):
    run = summarise_runs(result.identification, result.records[:1])[0]
    without_record = summarise_runs(result.identification, [])[0]
    assert 1.0 < run.acceleration < 3.0
    assert without_record.acceleration == pytest.approx(run.acceleration, rel=0.01)
    assert run.speed == pytest.approx((88 / 3.6, 88 / 3.6))


def test_a_constant_turn_has_its_lateral_acceleration(result):
    record = result.records[0]
    turn = record.with_signals(
        {"speed": np.full(len(record), 20.0), "yaw_rate.tractor": np.full(len(record), 0.05 + 0.01)}
    )
    (run,) = summarise_records([turn], "tractor", {turn.name: 0.01})
    assert run.acceleration == pytest.approx(1.0)
    (stopped,) = summarise_records([turn.with_signals({"speed": np.zeros(len(record))})])
    assert np.isnan([*stopped.speed, stopped.acceleration]).all()


def test_white_noise_sigma():
    time = np.arange(5000) * 0.01
    noise = 0.02 * np.random.default_rng(0).standard_normal(5000)
    assert white_noise_sigma(np.sin(time) + noise) == pytest.approx(0.02, rel=0.05)
    assert np.isnan(white_noise_sigma(time[:5]))


def test_a_fit_is_good_if_noise_limits_it():
    assert FitQuality(explained=0.2, rms=1.2, noise=1.0, motion=1.0).good
    assert FitQuality(explained=0.95, rms=5.0, noise=1.0, motion=1.0).good
    assert not FitQuality(explained=0.8, rms=1.3, noise=1.0, motion=1.0).good
    assert not FitQuality(explained=0.8, rms=1.3, noise=np.nan, motion=1.0).noise_limited


def test_the_stated_noise_of_a_filtered_sensor(result):
    """Its samples are autocorrelated: second differences show only a part of the noise."""
    fit = result.identification.fits[0]
    n = len(fit.measured)
    noise = np.convolve(np.random.default_rng(0).normal(size=n + 9), np.ones(10) / 10**0.5, "valid") * 0.01
    fit = replace(fit, measured=fit.predicted + noise, explained=0.5, rms=float(np.std(noise)))
    assert not fit_quality(fit, {}).good
    assert fit_quality(fit, {fit.signal: 0.01**2}).good
    assert not fit_quality(fit, {fit.signal: 0.005**2}).good
    assert fit_quality(replace(fit, measured=fit.measured[:5]), {fit.signal: 0.01**2}).noise == pytest.approx(0.01)


def test_predicted_logs(result):
    identified = [fit for fit in result.identification.fits if fit.identified_on]
    unseen = [replace(fit, log="unseen", identified_on=False, rms=1e-6) for fit in identified]
    (log,) = predicted_logs(replace(result.identification, fits=(*identified, *unseen)))
    assert (log.log, log.excited, log.explained, log.poor) == ("unseen", True, None, False)
    unseen[0] = replace(unseen[0], explained=0.93, rms=1.0)
    (log,) = predicted_logs(replace(result.identification, fits=(*identified, *unseen)))
    assert (log.explained, log.poor) == (0.93, False)
    unseen[0] = replace(unseen[0], explained=np.nan)
    (log,) = predicted_logs(replace(result.identification, fits=(*identified, *unseen)))
    assert log.poor


def test_states_in_numbers(result):
    record, states = result.records[1], result.states[1]
    summary = summarise_states(states, result.records)
    assert summary.name == NASTY
    assert sum(summary.status.values()) == pytest.approx(1)
    assert summary.status["TOO_SLOW"] == pytest.approx(300 / len(record))
    name = "sideslip.semitrailer"
    assert summary.band[name] == pytest.approx(2 * np.nanmedian(states.sigma[name]))
    difference = states.values[name] - record.reference[name]
    assert summary.reference_rms[name] == pytest.approx(np.sqrt(np.nanmean(difference**2)))
    size = summary.innovations["yaw_rate.tractor"]
    assert size.rejected == pytest.approx(np.mean([0] * (len(record) - 500 - 2) + [1] * 2), abs=1e-3)
    assert size.rms == pytest.approx(1, abs=0.2)
    assert summarise_states(states).reference_rms[name] is None
