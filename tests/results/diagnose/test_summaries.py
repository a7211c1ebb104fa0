"""Runs, fits and states in a few numbers."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import SensorError
from fifthwheel.estimate.observe import States
from fifthwheel.results.diagnose.residuals import fit_quality, predicted_logs, white_noise_sigma
from fifthwheel.results.diagnose.summaries import (
    innovation_size,
    summarise_records,
    summarise_runs,
    summarise_states,
    valid_fraction,
)
from tests.results.report.conftest import NASTY


def test_lateral_acceleration(result):
    run = summarise_runs(result.identification, result.records[:1])[0]
    without_record = summarise_runs(result.identification, [])[0]
    assert 1.0 < run.acceleration < 3.0
    assert without_record.acceleration == pytest.approx(run.acceleration, rel=0.02)  # over 12 rows, not 0.5 s
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


def states_of(time, name="a", **columns):
    """States without any but these fields."""
    n = len(time)
    fields = {
        "values": {}, "sigma": {}, "status": np.zeros(n, dtype=np.int8), "nis": np.ones(n), "innovation": {},
        "innovation_sigma": {}, "accepted": {},
    }  # fmt: skip
    return States(name=name, time=np.asarray(time, dtype=float), **(fields | columns))


def test_references_are_those_of_the_record_of_the_same_name_at_the_same_times():
    time = np.arange(10.0)
    records = [
        Record(time=time, signals={}, reference={"roll.tractor": slope * time}, name=name)
        for name, slope in (("b", 1.0), ("a", 2.0))
    ]
    values = {"roll.tractor": 2.0 * time + 3.0, "sideslip.tractor": time}
    same = summarise_states(states_of(time, values=values, sigma=values), records)
    assert same.reference_rms == {"roll.tractor": pytest.approx(3.0), "sideslip.tractor": None}
    assert summarise_states(states_of(time, "c", values=values, sigma=values), records).reference_rms == {
        "roll.tractor": None,
        "sideslip.tractor": None,
    }
    between = np.array([0.5, 1.5, 2.5, 11.0])  # linear, and nothing beyond the record
    shifted = {"roll.tractor": np.array([1.0, 3.0, np.nan, 99.0]) + 4.0}
    later = summarise_states(states_of(between, values=shifted, sigma=shifted), records)
    assert later.reference_rms == {"roll.tractor": pytest.approx(4.0)}
    half = [
        replace(r, reference={"roll.tractor": np.where(time < 5, r.reference["roll.tractor"], np.nan)}) for r in records
    ]
    missing = {"roll.tractor": np.where(time < 3, np.nan, 2.0 * time + 3.0)}
    assert summarise_states(states_of(time, values=missing, sigma=missing), half).reference_rms == {
        "roll.tractor": pytest.approx(3.0)
    }
    never = {"roll.tractor": np.full(10, np.nan)}
    nothing = summarise_states(states_of(time, values=never, sigma=never), records)
    assert nothing.reference_rms == nothing.band == {"roll.tractor": None}


def test_status_bands_and_valid_samples():
    sigma = {"roll.tractor": np.array([np.nan, 1.0, 2.0, 5.0])}
    one = states_of(range(4), sigma=sigma, values=sigma, status=np.array([0, 0, 0, 2], dtype=np.int8))
    summary = summarise_states(one)
    assert summary.status == {"OK": 0.75, "TOO_SLOW": 0.25}
    assert summary.valid == 0.75
    assert summary.band == {"roll.tractor": 4.0}
    other = states_of(range(3), status=np.array([3, 3, 3], dtype=np.int8))
    assert summarise_states(other).valid == 0.0
    assert valid_fraction([one, other]) == pytest.approx(3 / 7)
    assert valid_fraction([]) == 0.0


def test_the_size_of_innovations():
    """Rms of the accepted ones over their sigma; rejected are those that are measured and not accepted."""
    innovation = np.array([2.0, -2.0, 90.0, np.nan, 4.0])
    columns = {
        "innovation": {"a": innovation},
        "innovation_sigma": {"a": np.array([1.0, 1.0, 1.0, 1.0, 2.0])},
        "accepted": {"a": np.array([True, True, False, False, True])},
    }
    size = innovation_size(states_of(range(5), **columns), "a")
    assert size == (pytest.approx(2.0), 0.25)
    none = {**columns, "accepted": {"a": np.zeros(5, dtype=bool)}}
    assert np.isnan(innovation_size(states_of(range(5), **none), "a").rms)
    assert innovation_size(states_of(range(5), **none), "a").rejected == 1.0
    missing = {**columns, "innovation": {"a": np.full(5, np.nan)}}
    assert innovation_size(states_of(range(5), **missing), "a").rejected == 0.0


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
    slowest = first.with_signals({"speed": np.maximum(speed, 5.0)})
    assert summarise_records([slowest])[0].speed == (5.0, 20.0)
    assert summarise_records([first], min_speed=4.0)[0].speed == (4.9, 20.0)
    assert summarise_records([first], min_speed=20.0)[0].speed == (20.0, 20.0)
    assert np.isnan(summarise_records([first], "semitrailer2")[0].acceleration)
    without = replace(first, signals={"speed": speed})
    assert np.isnan(summarise_records([without])[0].acceleration)
    assert summarise_records([without])[0].speed == (20.0, 20.0)
    assert np.isnan(summarise_records([replace(first, signals={"yaw_rate.tractor": speed})])[0].speed).all()
    renamed = replace(steady, signals={"speed": speed, "roll_rate.a": speed, "yaw_rate.a": np.full(n, 0.06)})
    assert summarise_records([renamed])[0].acceleration == pytest.approx(1.2)

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
    unnamed = replace(offset, log=None)
    assert summarise_runs(replace(bare, sensors=(unnamed,)), [])[0].acceleration == pytest.approx(log.speed[1] * 0.05)
    assert np.isnan(summarise_runs(replace(bare, fits=()), [])[0].acceleration)
