"""The cost of the one-stage problem, and its derivatives against differences."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from scipy.signal import lfilter

from fifthwheel.base.errors import VehicleError
from fifthwheel.data.record import Record
from fifthwheel.data.record.record import segments_above
from fifthwheel.estimate.filters import tangent
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.dataset import LogData
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.identify.unknowns.parameters import VARIATION, time_base_delays
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle

AROUND_TRUTH = {"payload.height": "+- 0.75 m"}
EXACT = {"others": "exact", "sensors": "exact"}
PREDICTION = OneStage(form="prediction_error", tyres="linear", roll=False, given=EXACT)
"""Of few unknowns of a truck without roll, whose filter compiles soon."""


def problem(truck: Vehicle, records: list[Record], settings: OneStage, further: Sequence[Unknown] = ()) -> Problem:
    truck, settings = applied(truck.with_logged_steering(records[0].signals, "the records"), settings)
    outputs = tuple(sorted((n for n in records[0].signals if "rate" in n), reverse=True))  # as in an identification
    outputs = outputs if settings.roll else tuple(name for name in outputs if name.startswith("yaw_rate"))
    setup = Setup.of(truck, outputs, settings)
    logs = [LogData(name=r.name, segments=segments_above(r, 5.0)) for r in records]
    return Problem(replace(setup, unknowns=(*setup.unknowns, *further)), logs)


@pytest.fixture(scope="module")
def records(truck: Vehicle) -> list[Record]:
    """Two logs; the first has a slow phase that cuts it in two, a gap in a channel and a spike."""
    first, second = (simulate(truck, count=1, seed=seed, name=f"log {seed}").cut(0.5, 5.0) for seed in (1, 2))
    speed, gyro = first.signals["speed"].copy(), first.signals["yaw_rate.tractor"].copy()
    speed[200:260], gyro[300:340], gyro[100] = 3.0, np.nan, 3.0
    return [first.with_signals({"speed": speed, "yaw_rate.tractor": gyro}), second]


@pytest.mark.parametrize("form", ["output_error", pytest.param("prediction_error", marks=pytest.mark.slow)])
def test_gradient(truck: Vehicle, records: list[Record], form: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By all unknowns: parameters, sensor errors, initial states and bank; by parts of the rows, too."""
    monkeypatch.setattr(tangent, "CHUNK", 37 if form == "prediction_error" else tangent.CHUNK)
    given = {"*_rate.*.gain": "+- 5 %", "payload.height": "1.0 m +- 0.75 m"}
    p = problem(truck, records, OneStage(given=given) if form == "output_error" else PREDICTION)
    rng = np.random.default_rng(4)  # no innovation is at the gate of the filter, where the cost has a step
    z = 0.1 * rng.normal(size=len(p.names))
    positive = ("steer.tractor.front.play", "semitrailer.rear.self_steering")
    z[[k for k, name in enumerate(p.names) if name in positive]] **= 2
    quadratic = p.expand(z)
    assert (len(list(p.blocks(z, 1, 0))) > 3) == (form == "prediction_error")
    assert quadratic.cost == pytest.approx(p.cost(z), rel=1e-9)
    np.testing.assert_allclose(
        p.gradient(z), quadratic.gradient, rtol=1e-5, atol=1e-6 * np.abs(quadratic.gradient).max()
    )
    step = 1e-4
    for i, name in enumerate(p.names):
        if name in ("speed.delay", "steer.tractor.front.delay"):
            continue  # a shifted input is constant beyond the ends of a segment: the cost has kinks there
        shift = np.eye(len(z))[i] * step
        expected = (p.cost(z + shift) - p.cost(z - shift)) / (2 * step)
        scale = np.sqrt(quadratic.hessian[i, i])
        assert abs(quadratic.gradient[i] - expected) < 2e-4 * (abs(expected) + scale), name
    assert np.linalg.eigvalsh(quadratic.hessian).min() > 0.99


def test_derivatives_by_model_errors(truck: Vehicle) -> None:
    """Of the residuals by every softening, play, delay, misalignment, the time base and who brakes, against central
    differences."""
    record = simulate(truck, count=1, seed=1).cut(0.5, 5.0)
    record = record.with_signals({"speed": record.signals["speed"] + 0.3 * np.sin(record.time)})
    outputs = tuple(name for name in record.signals if "rate" in name)
    trailer = {name: "trailer" for name in outputs if "semitrailer" in name}
    further = time_base_delays(trailer, "", outputs, OneStage())
    p = problem(truck, [record], OneStage(given={"payload.height": "1.0 m +- 0.75 m"}), further)
    kinds = ("softening", "play", "delay", "misalignment", "time_base", "drive_axle@0")
    chosen = [name for name in p.names if name.rpartition(".")[2] in kinds]
    # axle groups, steering, delays of inputs, gyros and trailer, gyros, time, brakes
    assert len(chosen) == 3 + 1 + (2 + 4 + 1) + 4 + 1 + 1
    z = 0.1 * np.random.default_rng(4).normal(size=len(p.names))
    z[[p.names.index(name) for name in chosen]] = np.linspace(0.4, 0.9, len(chosen))
    (block,) = p.blocks(z, 0, 0, whitened=False)
    inside = slice(0, -30)  # a shifted input is constant beyond the end
    for name in chosen:
        i, step = p.names.index(name), 1e-3
        shift = np.eye(len(z))[i] * step
        higher, lower = (next(p.blocks(z + s * shift, 0, 0, differentiated=False)).error for s in (1, -1))
        expected = ((higher - lower) / (2 * step))[inside]
        actual = block.jacobian[..., block.indices.tolist().index(i)][inside]
        assert np.abs(actual - expected).max() < 1e-4 * np.abs(expected).max(), name


def test_the_log_likelihood_is_that_of_coloured_noise(truck: Vehicle) -> None:
    """The normal density of all residuals of a channel with the covariance of white noise and discrepancy."""
    record = simulate(truck, count=1, seed=1).cut(0.5, 4.0)
    p = problem(truck, [record], OneStage(outlier=100.0))
    z = 0.3 * np.random.default_rng(1).normal(size=len(p.names))
    z = np.clip(z, *p.bounds)
    p = p.with_residual_noise(z, autocorrelated=True)
    time, error, _ = p.residuals(z, 0, whitened=False)
    total = 0.0
    for e, name in zip(error.T, p.model.outputs, strict=True):
        noise = p.logs[0].noise_model(name)
        lag = np.abs(time[:, None] - time)
        covariance = noise.white * np.eye(len(e)) + noise.discrepancy * np.exp(-lag / noise.time_constant)
        total += stats.multivariate_normal(cov=covariance).logpdf(e)
    assert p.log_likelihood(z) == pytest.approx(total, abs=1e-3)


def test_cost_does_not_depend_on_former_points(truck: Vehicle) -> None:
    """Rows are kept until the errors of the steering change; the contact of the play depends on its gain too."""
    record = simulate(truck, count=1, seed=1).cut(0.5, 5.0)
    z = np.zeros(len(problem(truck, [record], OneStage()).names))
    for kind, change in (("play", 1.5), ("gain", 1.0), ("delay", 0.2), ("offset@0", 0.3)):
        p, fresh = (problem(truck, [record], OneStage()) for _ in range(2))
        p.cost(z)
        z[p.names.index(f"steer.tractor.front.{kind}")] = change
        assert p.cost(z) == fresh.cost(z), kind


@pytest.mark.parametrize("samples", [5001, 100])
def test_a_shortened_problem_has_the_parts_with_most_steering(truck: Vehicle, samples: int) -> None:
    """The largest variance of speed times steer angle, by a search over all parts; at least 20 s of each segment."""
    records = [simulate(truck, count=5, seed=seed, name=str(seed)) for seed in (1, 2)]
    whole = problem(truck, records, OneStage())
    total = sum(len(record) for record in records)
    for record, log in zip(records, whole.shortened(samples).logs, strict=True):
        (part,) = log.segments
        assert len(part) - max(np.ceil(samples / total * len(record)), 2000) in (0, 1)  # the rate is rounded
        product = record.signals["speed"] * record.signals["steer.tractor.front"]
        first = int(np.argmax([np.var(product[i : i + len(part)]) for i in range(len(record) - len(part) + 1)]))
        assert part.time[0] == record.time[first]
    short = problem(truck, [simulate(truck, count=1, seed=1), records[1]], OneStage()).shortened(100).logs[0]
    assert len(short.segments[0]) == len(simulate(truck, count=1, seed=1)), "one of less than 20 s is kept"
    assert whole.shortened(total) is whole
    assert whole.shortened(total - 1) is not whole


@pytest.mark.slow
def test_autocorrelated_innovations_count_less(truck: Vehicle) -> None:
    """Of a gyro with noise of 0.2 s, for which the filter takes white noise."""
    record, name = simulate(truck, count=1, seed=4, roll=False), "yaw_rate.semitrailer"
    rng, pole = np.random.default_rng(2), np.exp(-record.time[1] / 0.2)
    slow = lfilter([np.sqrt(1 - pole**2)], [1, -pole], rng.normal(size=len(record)))
    factors = []
    for size in (0.0, 0.01):
        noisy = record.with_signals({name: record.signals[name] + size * slow})
        p = problem(truck, [noisy], PREDICTION)
        p = p.with_residual_noise(np.zeros(len(p.names)), autocorrelated=True)
        factors.append(p.logs[0].autocorrelation_factor[name])
        assert not p.logs[0].noise_models
    assert 1 <= factors[0] < 2.5
    assert factors[1] > 5


def test_the_noise_of_a_slow_channel_is_fitted_at_its_own_rate(truck: Vehicle) -> None:
    """Not at that of the rows: a discrepancy of 0.4 s in a channel of 20 Hz in a record of 100 Hz."""
    record, name = simulate(truck, count=5, seed=4), "yaw_rate.semitrailer"
    rng, pole = np.random.default_rng(2), np.exp(-record.time[1] / 0.4)
    slow = lfilter([np.sqrt(1 - pole**2)], [1, -pole], rng.normal(size=len(record)))
    models = []
    for step in (1, 5):
        values = np.where(np.arange(len(record)) % step == 0, record.signals[name] + 0.01 * slow, np.nan)
        p = problem(truck, [record.with_signals({name: values})], OneStage(given=AROUND_TRUTH))
        p = p.with_residual_noise(np.zeros(len(p.names)), autocorrelated=True)
        models.append(p.logs[0].noise_models[name])
    assert [model.time_constant for model in models] == pytest.approx([0.4, 0.4], rel=0.3)
    assert models[1].discrepancy == pytest.approx(models[0].discrepancy, rel=0.15)


def test_a_slow_channel_has_the_least_discrepancy_of_its_motion(truck: Vehicle) -> None:
    """A hundredth of the amplitude, also where no two successive rows have a value."""
    record, name = simulate(truck, count=5, seed=4), "yaw_rate.tractor"
    values = np.where(np.arange(len(record)) % 2 == 0, record.signals[name], np.nan)
    settings = OneStage(given={**AROUND_TRUTH, "discrepancy": "+- 30 %"})
    p = problem(truck, [record.with_signals({name: values})], settings)
    p = p.with_residual_noise(np.zeros(len(p.names)), autocorrelated=True)
    motion = np.nanvar(values) - 0.000016
    assert p.logs[0].noise_models[name].discrepancy == pytest.approx(0.09 * motion, rel=0.1)


def test_bounds_and_nuisances(truck: Vehicle, records: list[Record]) -> None:
    """Initial states are within 8 prior standard deviations; an unknown that is not estimated keeps its prior mean."""
    p = problem(truck, records, OneStage())
    kept = p.setup.unknowns[0]
    p = Problem(p.setup.with_unknown(replace(kept, estimated=False)), p.logs)
    lower, upper = (dict(zip(p.names, bound.tolist(), strict=True)) for bound in p.bounds)
    assert (lower[kept.name], upper[kept.name]) == (0.0, 0.0)
    assert len(set(p.names)) == len(p.names)
    assert {"steer.tractor.front.offset@1", "bank.road@0.1", "steer.tractor.front.gain"} <= set(p.names)
    assert p.segments() == [(0, 0), (0, 1), (1, 0)]
    assert not problem(truck, records, PREDICTION).layout.initial_states[0][0].size
    states = [name for name in p.names if name not in p.unknowns_by_name]
    assert len(states) == 3 * len(p.model.states)
    assert {(lower[name], upper[name]) for name in states} == {(-8.0, 8.0)}
    for name, u in p.unknowns_by_name.items():
        if u.estimated and not u.logarithmic:
            assert (lower[name], upper[name]) == pytest.approx(
                ((u.lower - u.centre) / u.scale, (u.upper - u.centre) / u.scale)
            )
            assert lower[name] < upper[name]
    nuisances = {p.names[i] for i in p.nuisances}
    assert nuisances == set(p.names) - set(p.setup.estimated)
    assert {"mass_scale", "brakes.drive_axle@1", "steer.tractor.front.gain", *states} <= nuisances
    assert "semitrailer.yaw_inertia" not in nuisances


def test_a_log_may_tell_who_brakes(truck: Vehicle, records: list[Record]) -> None:
    """Its prior then replaces the common one, 0.5 +- 0.4."""
    p = problem(truck, records, OneStage())
    logs = [p.logs[0], replace(p.logs[1], drive_axle_braking=(1.0, 0.05))]
    prior = Problem(p.setup, logs).prior
    places = [p.names.index(f"brakes.drive_axle@{i}") for i in (0, 1)]
    np.testing.assert_allclose(prior.mean[places], [0.0, (1.0 - 0.5) / 0.4])
    np.testing.assert_allclose(prior.variance[places], [1.0, (0.05 / 0.4) ** 2])


def test_a_gross_error_has_a_wider_prior(truck: Vehicle, records: list[Record]) -> None:
    """The cost differs only by that of the prior, also with other noise; bounds are within what a truck can have."""
    p = problem(truck, records, OneStage())
    for name, largest in (
        ("mass_scale", 12.0),
        ("semitrailer.cornering_stiffness", 12.0),
        ("brakes.drive_axle@1", 1.25),
        ("yaw_rate.tractor.delay", 12.0),
    ):
        i, z = p.names.index(name), 0.01 * np.random.default_rng(1).normal(size=len(p.names))
        z[p.names.index("steer.tractor.front.play")] = 0.0
        z[i] = 0.8
        for wide in (p.with_gross_error(name, 4.0, 3.0), p.with_gross_error(name, 4.0, 3.0).shortened(10**9)):
            own = p.prior.cost(np.where(np.arange(len(z)) == i, z, 0.0))
            assert wide.cost(z) == pytest.approx(p.cost(z) - own + (z[i] / 4) ** 2 / 2, abs=1e-6)
            assert wide.prior.expand(z).gradient[i] == pytest.approx(z[i] / 16)
            assert wide.prior.expand(z).hessian[i, i] == pytest.approx(1 / 16)
            assert [bound[i] for bound in wide.bounds] == pytest.approx([-largest, largest])


def test_the_excess_of_residuals_over_the_noise_of_a_part(truck: Vehicle, records: list[Record]) -> None:
    """The largest ratio of mean squares to variances over all logs and channels, at least 1."""
    p = problem(truck, records, OneStage())
    z = np.zeros(len(p.names))
    squares = [np.nanmean(p.residuals(z, i, whitened=False)[1] ** 2, axis=0) for i in (0, 1)]
    noise = [dict(zip(p.model.outputs, each.tolist(), strict=True)) for each in squares]
    part = SimpleNamespace(logs=[SimpleNamespace(noise=each) for each in noise])
    assert p.excess(z, part) == pytest.approx(1.0)
    noise[1]["roll_rate.semitrailer"] /= 7
    assert p.excess(z, part) == pytest.approx(7.0)
    noise[1]["roll_rate.semitrailer"] *= 70
    assert p.excess(z, part) == pytest.approx(1.0)
    assert len(p) == sum(len(segment) for log in p.logs for segment in log.segments)


def test_what_varies_from_log_to_log_is_left_out(truck: Vehicle, records: list[Record]) -> None:
    """The variation of a stiffness and who brakes, and not the offset of a sensor."""
    p = problem(truck, records, OneStage())
    z = np.ones(len(p.names))
    changed = {p.names[i] for i in np.flatnonzero(p.without_variation(z) == 0)}
    variations = {name for name in p.names if name.endswith(f".{VARIATION}@0")}
    assert changed == variations | {"brakes.drive_axle@0"}
    assert variations
    assert z.all()


@pytest.mark.parametrize(("decimated", "divided"), [(1, False), (12, True)])
def test_residuals_are_those_of_the_samples(
    truck: Vehicle, monkeypatch: pytest.MonkeyPatch, decimated: int, divided: bool
) -> None:
    """Long steps are divided; rows between two samples are no residuals."""
    monkeypatch.setattr(tangent, "CHUNK", 5)
    record = simulate(truck, count=1, seed=1)
    signals = {name: values[::decimated] for name, values in record.signals.items()}
    record = Record(time=record.time[::decimated], signals=signals)
    p = problem(truck, [record], OneStage())
    z = np.zeros(len(p.names))
    rows = p._step_rows(0, 0, p.model_values(z, 0) | p.values(z, 0))
    assert (len(rows) > len(record)) == divided
    for differentiated in (True, False):
        blocks = list(p.blocks(z, 0, 0, differentiated=differentiated))
        assert len(blocks) > 2
        np.testing.assert_allclose(np.concatenate([block.time for block in blocks]), record.time)
        assert np.isfinite(np.concatenate([block.error for block in blocks])).all()


def test_an_unstable_vehicle_has_no_finite_cost(truck: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its free-running model never forgets its initial state; nor is there a cost of a vehicle that cannot exist."""
    p = problem(truck, [simulate(truck, count=1, seed=1)], OneStage())
    z = np.zeros(len(p.names))

    def impossible(*_: object) -> float:
        raise VehicleError("a payload that is heavier than its unit")

    cases = ((lambda *_: 1e-9, False), (lambda *_: 0.0, True), (lambda *_: -1.0, True), (impossible, True))
    for slowest_decay, unstable in cases:
        monkeypatch.setattr(Setup, "slowest_decay", slowest_decay)
        assert p.unstable(z) == unstable
        assert np.isinf(p.cost(z)) == unstable


@pytest.mark.parametrize("rows", [12, -7])
def test_corrected_delays_shift_signals_of_one_log(truck: Vehicle, records: list[Record], rows: int) -> None:
    """A gyro has no samples beyond its own, a steer angle keeps the last one."""
    p, delays = problem(truck, records, OneStage()), {}
    for name in ("yaw_rate.tractor", "steer.tractor.front"):
        delays["log 2", name] = rows / 100
    before, after = (q.logs[1].segments[0].signals for q in (p, p.with_delays(delays)))
    assert p.with_delays(delays).logs[0].segments == p.logs[0].segments
    used = slice(None, -rows) if rows > 0 else slice(-rows, None)
    for name in ("yaw_rate.tractor", "steer.tractor.front"):
        assert np.allclose(after[name][used], np.roll(before[name], -rows)[used])
    assert np.isnan(after["yaw_rate.tractor"]).sum() == abs(rows)
    assert np.isfinite(after["steer.tractor.front"]).all()
    assert np.array_equal(after["yaw_rate.semitrailer"], before["yaw_rate.semitrailer"])
