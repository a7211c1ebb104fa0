"""Everything at once on the linear truck: errors against the bound, sigmas, verdicts, faults."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fifthwheel import dynamics
from fifthwheel.errors import VehicleError
from fifthwheel.identify import Identification, OneStage, Verdict, identify
from fifthwheel.identify.parameters import stage_1_names
from fifthwheel.observe import Observer
from fifthwheel.observe.prepare import locked_but
from fifthwheel.simulate import response, simulate
from fifthwheel.vehicle import Vehicle

from .conftest import without

KNOWN = OneStage(priors={}, consider={}, nuisances=False)
HEIGHT = "semitrailer.payload.height"
STEER = "steer.tractor.front"
BOUND = {
    "tractor.front.cornering_stiffness": 0.0035,
    "tractor.drive.cornering_stiffness": 0.0025,
    "semitrailer.cornering_stiffness": 0.0073,
    "semitrailer.yaw_inertia": 0.0050,
    HEIGHT: 0.0233,
}
"""Cramer-Rao bound of one lane change, as a part of each; benchmarks/accuracy.py reckons it."""


def guesses(truck: Vehicle, factors: tuple[float, ...]) -> Vehicle:
    values = truck.parameters()
    return truck.replace({n: values[n] * f for n, f in zip(stage_1_names(truck), factors, strict=True)})


def errors(found: Identification, truck: Vehicle) -> dict[str, float]:
    truth = truck.parameters() | truck.derived()
    return {e.name: e.value / truth[e.name] - 1 for e in (*found.parameters, *found.derived) if e.name in truth}


def in_sigma(found: Identification, truck: Vehicle) -> dict[str, float]:
    """Errors in standard deviations."""
    truth = truck.parameters() | truck.derived()
    told = (*found.parameters, *found.derived)
    return {e.name: (e.value - truth[e.name]) / e.sigma for e in told if e.sigma}


@pytest.mark.parametrize(
    "factors", [(0.6, 1.4, 0.6, 1.4), (1.4, 1.4, 1.4, 1.4), (1.4, 0.6, 1.4, 0.6), (0.6, 0.6, 1.4, 0.6)], ids=str
)
def test_one_lane_change_from_anywhere(truck: Vehicle, factors: tuple[float, ...]) -> None:
    """Also from trucks that would run away."""
    record = simulate(truck, count=1, seed=1)
    found = identify([record], guesses(truck, factors), KNOWN)
    assert all(e.verdict is Verdict.CONVERGED for e in found.parameters)
    for name, error in errors(found, truck).items():
        if name in BOUND:
            assert abs(error) < 3.5 * BOUND[name], name
    right = identify([record], truck, replace(KNOWN, initial_payload_height=None))
    for e in found.parameters:  # what is left of the start is what the prior weighs
        assert abs(e.value - right[e.name].value) < 0.2 * e.sigma, e.name


def test_sigma_is_the_bound(truck: Vehicle, guess: Vehicle) -> None:
    found = identify([simulate(truck, count=1, seed=2)], guess, KNOWN)
    truth = truck.parameters()
    for e in found.parameters:
        assert 0.9 * BOUND[e.name] < e.sigma / truth[e.name] < 1.4 * BOUND[e.name], e.name
    assert set(found.traces) == {"one stage"}
    trace = found.traces["one stage"]
    assert trace.values[-1] == pytest.approx([e.value for e in found.parameters], rel=1e-3)
    assert (np.diff(trace.sigma[:, 0] / trace.values[:, 0]) < 1e-3).all()


@pytest.mark.slow
def test_one_lane_change_reaches_the_bound(truck: Vehicle) -> None:
    """Root mean square within sampling error of 1.1 times the bound, and 90 % intervals that hold 90 %."""
    truth, ratios = truck.parameters(), []
    for seed in range(100):
        factors = tuple(np.random.default_rng([seed, 7]).choice([0.8, 1.2], 4))
        found = identify([simulate(truck, count=1, seed=seed)], guesses(truck, factors), KNOWN)
        ratios.append([(e.value / truth[e.name] - 1, e.sigma / truth[e.name]) for e in found.parameters])
    error, sigma = np.moveaxis(np.array(ratios), -1, 0)
    rms = np.sqrt(np.mean(error**2, axis=0)) / np.array(list(BOUND.values()))
    covered = np.mean(np.abs(error) < 1.645 * sigma, axis=0)
    assert (rms < 1.1 * 1.1).all(), rms  # an rms of 100 draws is known to 7 %
    assert ((covered >= 0.85) & (covered <= 0.97)).all(), covered


@pytest.mark.parametrize("form", ["output_error", "prediction_error"])
def test_everything_unknown_at_once(truck: Vehicle, guess: Vehicle, form: str) -> None:
    """Steer gain, zero and delay, gyros' zeros and gains: all wrong, all within their sigma."""
    record = simulate(truck, count=3, seed=3)
    signals = dict(record.signals)
    late = np.interp(record.time - 0.04, record.time, signals[STEER])
    signals |= {
        STEER: late / 1.05 + 0.004,
        "yaw_rate.tractor": 1.003 * signals["yaw_rate.tractor"] + 0.002,
        "roll_rate.semitrailer": signals["roll_rate.semitrailer"] - 0.003,
    }
    found = identify([replace(record, signals=signals)], guess, OneStage(form=form))
    assert all(e.verdict is Verdict.CONVERGED for e in found.parameters)
    assert max(np.abs(list(in_sigma(found, truck).values()))) < 3.5
    told = {e.name: e for e in found.sensors}
    for name, value in {
        f"{STEER}.gain": 1.05,
        f"{STEER}.offset": 0.004,
        f"{STEER}.delay": 0.04,
        "yaw_rate.tractor.offset": 0.002,
        "yaw_rate.tractor.gain": 1.003,
        "roll_rate.semitrailer.offset": -0.003,
    }.items():
        assert abs(told[name].value - value) < 3.5 * told[name].sigma, name
    assert told[f"{STEER}.delay"].sigma < 0.01
    assert {e.verdict for e in found.rough} == {Verdict.HELD}


def test_several_logs_have_zeros_of_their_own(truck: Vehicle, guess: Vehicle) -> None:
    records = []
    for i, zero in enumerate((0.003, -0.002)):
        record = simulate(truck, count=1, seed=i, name=f"log {i}")
        records.append(record.with_signals({"yaw_rate.tractor": record.signals["yaw_rate.tractor"] + zero}))
    found = identify(records, guess, replace(KNOWN, nuisances=True))
    zeros = {(e.log, e.name): e.value for e in found.sensors}
    apart = [  # which of the two gyros it is in, nobody can tell
        zeros[log, "yaw_rate.tractor.offset"] - zeros[log, "yaw_rate.semitrailer.offset"] for log in ("log 0", "log 1")
    ]
    assert apart == pytest.approx([0.003, -0.002], abs=0.0006)
    alone = identify(records[:1], guess, replace(KNOWN, nuisances=True))
    assert all(found[e.name].sigma < e.sigma for e in alone.parameters)


def test_spikes_and_gaps_do_not_matter(truck: Vehicle, guess: Vehicle) -> None:
    record = simulate(truck, count=2, seed=5)
    rng, signals = np.random.default_rng(0), {n: v.copy() for n, v in record.signals.items()}
    for name in signals:
        if "rate" in name:
            signals[name][rng.integers(0, len(record), 20)] += rng.choice([-0.8, 0.8], 20)
            signals[name][500:560] = np.nan
    clean = identify([record], guess, KNOWN)
    found = identify([replace(record, signals=signals)], guess, KNOWN)
    for e in clean.parameters:
        assert abs(found[e.name].value - e.value) < 1.5 * e.sigma, e.name
    assert all(part == pytest.approx(20 / len(record), rel=0.3) for part in found.logs[0].rejected.values())


def test_a_straight_drive_tells_nothing(truck: Vehicle, guess: Vehicle) -> None:
    found = identify([simulate(truck, manoeuvre="straight", seed=1)], guess)
    given = guess.parameters()
    for e in found.parameters:
        assert e.verdict is Verdict.NOT_EXCITED, e.name
        assert e.value == given[e.name]
        assert e.sigma == pytest.approx(e.prior)
    assert all(e.verdict is Verdict.NOT_EXCITED for e in found.derived)


def test_without_roll_rates_the_payload_is_not_identifiable(truck: Vehicle, guess: Vehicle) -> None:
    found = identify([without(simulate(truck, count=3, seed=4), "roll_rate")], guess)
    height = found[HEIGHT]
    assert (height.verdict, height.confused_with) == (Verdict.NOT_IDENTIFIABLE, ())
    assert height.value == truck.parameters()[HEIGHT]
    assert found["semitrailer.cog_height"].verdict is Verdict.NOT_IDENTIFIABLE
    told = {e.name: e.verdict for e in found.parameters}
    assert [v for n, v in told.items() if n != HEIGHT] == [Verdict.CONVERGED] * 4
    # what the height may be counts in their sigma
    certain = identify([without(simulate(truck, count=3, seed=4), "roll_rate")], guess, OneStage(held=(HEIGHT,)))
    assert found["semitrailer.cornering_stiffness"].sigma > certain["semitrailer.cornering_stiffness"].sigma


def test_two_that_only_show_together_are_named(truck: Vehicle, guess: Vehicle) -> None:
    """Front stiffness and a steering ratio that nobody knows, in one steady turn."""
    record = simulate(truck, count=1, seed=6)
    loose = OneStage(steer_gain_prior=2.0, prior=0.05, priors={}, consider={})
    found = identify([record], guess, loose)
    front = found["tractor.front.cornering_stiffness"]
    assert f"{STEER}.gain" in front.confused_with


def test_a_load_of_any_shape(truck: Vehicle, guess: Vehicle) -> None:
    found = identify([simulate(truck, count=10, seed=7)], guess, replace(KNOWN, uniform_payload=False))
    names = [e.name for e in found.parameters]
    assert names[-2:] == ["semitrailer.sprung.cog_height", "semitrailer.sprung.roll_inertia"]
    truth = truck.derived()
    for name, allowed in (("semitrailer.cog_height", 0.015), ("semitrailer.roll_inertia", 0.2)):
        e = found[name]
        assert abs(e.value / truth[name] - 1) < allowed
        assert abs(e.value - truth[name]) < 3 * e.sigma
    assert found.vehicle.unit("semitrailer").payload is None


def test_what_is_considered_widens_sigma_and_keeps_its_value(truck: Vehicle, guess: Vehicle) -> None:
    record, soft = simulate(truck, count=2, seed=8), "semitrailer.roll_stiffness"
    certain = identify([record], guess, KNOWN)
    found = identify([record], guess, replace(KNOWN, consider={soft: 0.1}))
    assert found[HEIGHT].value == pytest.approx(certain[HEIGHT].value, rel=1e-3)
    # findings: ten per cent of suspension stiffness are about twelve of payload height
    assert 0.05 < found[HEIGHT].sigma / found[HEIGHT].value < 0.15
    (rough,) = found.rough
    assert (rough.name, rough.value, rough.verdict) == (soft, truck.parameters()[soft], Verdict.HELD)
    wrong = guess.replace({soft: 1.1 * truck.parameters()[soft]})
    moved = identify([record], wrong, replace(KNOWN, consider={soft: 0.1}))[HEIGHT]
    assert abs(moved.value - certain[HEIGHT].value) == pytest.approx(moved.sigma, rel=0.35)


def test_what_is_known_roughly_is_learned(truck: Vehicle) -> None:
    late = truck.replace({f"{path}.relaxation_length": 0.6 for path in ("tractor.front", "tractor.drive")})
    found = identify([simulate(truck, count=10, seed=9)], late, replace(KNOWN, priors={"relaxation_length": 0.3}))
    for e in found.rough:
        assert abs(e.value - 0.45) < 3.5 * e.sigma
        assert e.sigma < 0.5 * e.prior


def test_held_and_freed(truck: Vehicle, guess: Vehicle) -> None:
    record, front = simulate(truck, count=2, seed=10), "tractor.front.cornering_stiffness"
    found = identify([record], guess, replace(KNOWN, held=(front,)))
    assert (found[front].verdict, found[front].sigma) == (Verdict.HELD, None)
    only = identify([record], truck, replace(KNOWN, free=("tractor.yaw_inertia", "semitrailer.mass")))
    assert [e.name for e in only.parameters] == ["tractor.yaw_inertia", "semitrailer.mass"]
    assert max(np.abs(list(in_sigma(only, truck).values()))) < 3.5
    ended = identify([record], guess, replace(KNOWN, held=("cornering_stiffness",)))
    assert [e.verdict for e in ended.parameters].count(Verdict.HELD) == 3
    for wrong in ({"consider": {"roll_axis_hight": 0.1}}, {"priors": {"nonsense": 0.1}}):
        with pytest.raises(VehicleError, match="no such parameter"):
            identify([record], guess, replace(KNOWN, **wrong))
    with pytest.raises(VehicleError, match="is sought, so it cannot only be considered"):
        identify([record], guess, replace(KNOWN, consider={"payload.height": 0.1}))
    with pytest.raises(VehicleError, match=r"tractor\.yaw_inertai: no such parameter"):
        identify([record], guess, replace(KNOWN, free=("tractor.yaw_inertai",)))
    with pytest.raises(VehicleError, match="every parameter is held"):
        identify([record], guess, replace(KNOWN, free=(front,), held=(front,), nuisances=False))

    with pytest.raises(VehicleError, match=r"fifth_wheel\.roll_damping: expected above 0"):
        identify([record], guess, replace(KNOWN, free=("fifth_wheel.roll_damping",)))


def test_the_result_goes_into_json_and_into_an_observer(truck: Vehicle, guess: Vehicle) -> None:
    record = simulate(truck, count=2, seed=11, name="a drive")
    found = identify([record], guess)
    told = json.loads(found.to_json())
    assert told["method"] == "one-stage"
    assert told["settings"]["consider"]["roll_stiffness"] == 0.1
    assert len(told["uncertainty"]["names"]) == len(told["uncertainty"]["covariance"])
    own = found.uncertainty("a drive")
    assert own is not None
    assert f"{STEER}.offset" in own.names
    other = found.uncertainty("another")  # of its sensors' zeros nothing is known but the prior
    assert set(other.names) == set(own.names)
    place = other.names.index(f"{STEER}.offset")
    assert np.sqrt(other.covariance[place, place]) == pytest.approx(found.settings.steer_offset_prior)
    assert np.count_nonzero(other.covariance[place]) == 1
    observer = Observer(found.vehicle, record.signals, found.observer_settings("a drive"))
    plain, wider = observer.batch(record), observer.batch(record, own)
    name = "sideslip.semitrailer"
    assert wider.values[name] == pytest.approx(plain.values[name], nan_ok=True)
    assert (wider.sigma[name] > plain.sigma[name]).all()
    error = wider.values[name] - record.reference[name]
    assert np.mean(np.abs(error) < 1.645 * wider.sigma[name]) > 0.8


def test_a_log_of_a_hundred_steps_a_second_takes_a_moment(truck: Vehicle, guess: Vehicle) -> None:
    """Not a wall time: the number of steps that a fit needs."""
    found = identify([simulate(truck, count=2, seed=12)], guess)
    assert found.rounds <= 10


def test_the_roads_bank_is_found_where_the_steer_zero_is_known(truck: Vehicle, guess: Vehicle) -> None:
    """Of a truck that a bank of 2 degrees pulls to the right."""
    record, lean = simulate(truck, count=3, seed=13), np.radians(2)
    own = locked_but(truck, record.signals, "the record")
    outputs = tuple(name for name in record.signals if "rate" in name)
    values = dynamics.all_parameters(own, outputs)
    pulled, level = (
        response(
            dynamics.model(own, outputs, roll=True, bank=True),
            values,
            record.time,
            {name: record.signals[name] for name in ("speed", STEER)},
            np.array([*[0.0] * (len(dynamics.state_names(own, roll=True))), bank]),
        )[1]
        for bank in (lean, 0.0)
    )
    moved = {name: record.signals[name] + (pulled - level)[:, i] for i, name in enumerate(outputs)}
    known = replace(KNOWN, nuisances=True, steer_offset_prior=1e-4, rate_offset_prior=1e-4)
    found = identify([record.with_signals(moved)], guess, known)
    bank, sigma = found.logs[0].bank
    assert sigma < 0.02
    assert abs(bank - lean) < 3 * sigma
    assert max(np.abs(list(in_sigma(found, truck).values()))) < 3.5
    assert identify([record], guess, KNOWN).logs[0].bank is None
