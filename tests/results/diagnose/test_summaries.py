"""Runs, fits and states in a few numbers."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.estimate.identify import SensorError
from fifthwheel.results.diagnose.residuals import fit_quality, predicted_logs, white_noise_sigma
from fifthwheel.results.diagnose.summaries import (
    summarise_records,
    summarise_runs,
    summarise_states,
    valid_fraction,
)
from tests.results.report.conftest import NASTY


def test_white_noise_sigma():
    time = np.arange(5000) * 0.01
    noise = 0.02 * np.random.default_rng(0).standard_normal(5000)
    assert white_noise_sigma(np.sin(time) + noise) == pytest.approx(0.02, rel=0.05)
    assert np.isnan(white_noise_sigma(time[:5]))


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
    good, bad = (replace(states, status=np.full(len(states.time), status, dtype=np.int8)) for status in (0, 3))
    assert valid_fraction([good, good, bad]) == pytest.approx(2 / 3)
    assert valid_fraction([]) == 0.0


def test_the_runs_of_an_identification(result):
    """With the offset of the gyro of each log removed, at speeds of the model, and without a record by its fit."""
    record, identification = result.records[0], result.identification
    n = len(record)
    speed = np.where(np.arange(n) < n // 2, 20.0, 4.9)
    steady = record.with_signals({"speed": speed, "yaw_rate.tractor": np.full(n, 0.06)})
    first, other = steady, replace(steady, name="b")
    plain = summarise_records([first, other], "tractor", {"b": 0.01})
    assert [run.acceleration for run in plain] == pytest.approx([1.2, 1.0])
    assert {run.speed for run in plain} == {(20.0, 20.0)}
    assert summarise_records([first], min_speed=4.9)[0].speed == (4.9, 20.0)
    (stopped,) = summarise_records([first.with_signals({"speed": np.zeros(n)})])
    assert np.isnan([*stopped.speed, stopped.acceleration]).all()
    assert np.isnan(summarise_records([first], "semitrailer2")[0].acceleration)
    without = replace(first, signals={"speed": speed})
    assert np.isnan(summarise_records([without])[0].acceleration)
    assert summarise_records([without])[0].speed == (20.0, 20.0)
    log = identification.logs[0]
    fit = next(f for f in identification.fits if f.signal == "yaw_rate.tractor" and f.log == log.name)
    constant = replace(fit, measured=np.full(len(fit.measured), 0.05))
    offset = SensorError(name="yaw_rate.tractor.offset", value=0.01, sigma=0.001, unit="rad/s", log=log.name)
    bare = replace(identification, fits=(constant,), sensors=(offset,), logs=(log,))
    (run,) = summarise_runs(bare, [])
    assert run.acceleration == pytest.approx(log.speed[1] * 0.04)
    assert (run.name, run.speed) == (log.name, log.speed)
    (run,) = summarise_runs(bare, [replace(steady, name=log.name)])
    assert run.acceleration == pytest.approx(20.0 * 0.05)
