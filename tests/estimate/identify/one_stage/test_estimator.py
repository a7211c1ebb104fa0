"""One stage on the linear vehicle: errors against the Cramér-Rao bound, sigmas, verdicts, faults."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.initial_state import steady_initial_state
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.one_stage import estimator
from fifthwheel.estimate.identify.one_stage.estimator import EARLY, FINAL, WHITE, solve_one_stage
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.unknowns.parameters import stage_1_names
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import FRICTION, quantity_of
from tests.estimate.conftest import without

EVERY_PARAMETER = dict.fromkeys(("cornering_stiffness", "yaw_inertia", "payload.height"), "exact")
KNOWN = OneStage(tyres="linear", given={"others": "exact", "sensors": "exact"})
HEIGHT = "semitrailer.payload.height"
STEER = "steer.tractor.front"
BOUND = {
    "tractor.front.cornering_stiffness": 0.0035,
    "tractor.drive.cornering_stiffness": 0.0025,
    "semitrailer.cornering_stiffness": 0.0073,
    "semitrailer.yaw_inertia": 0.0050,
    HEIGHT: 0.0233,
}
"""Cramér-Rao bound of one lane change, as a fraction of the value; computed by benchmarks/accuracy.py."""


def guesses(truck: Vehicle, factors: tuple[float, ...]) -> Vehicle:
    values = truck.parameters()
    return truck.replace({n: values[n] * f for n, f in zip(stage_1_names(truck), factors, strict=True)})


def errors(result: Identification, truck: Vehicle) -> dict[str, float]:
    truth = truck.parameters() | truck.derived()
    return {e.name: e.value / truth[e.name] - 1 for e in (*result.parameters, *result.derived) if e.name in truth}


def normalised_errors(result: Identification, truck: Vehicle) -> dict[str, float]:
    """Errors in standard deviations."""
    truth = truck.parameters() | truck.derived()
    estimates = (*result.parameters, *result.derived)
    return {e.name: (e.value - truth[e.name]) / e.sigma for e in estimates if e.sigma}


@pytest.fixture(scope="module")
def right(truck: Vehicle) -> Identification:
    """From the true values."""
    settings = replace(KNOWN, given={**KNOWN.given, HEIGHT: "+- 0.75 m"})
    return identify([simulate(truck, count=1, seed=1)], truck, settings)


@pytest.mark.slow
def test_one_lane_change_from_wrong_initial_values(truck: Vehicle, right: Identification) -> None:
    """The initial vehicle is unstable at the speed of the log."""
    record = simulate(truck, count=1, seed=1)
    result = identify([record], guesses(truck, (1.4, 0.6, 1.4, 0.6)), KNOWN)
    assert all(e.verdict is Verdict.CONVERGED for e in result.parameters)
    for name, error in errors(result, truck).items():
        if name in BOUND:
            assert abs(error) < 3.5 * BOUND[name], name
    for e in result.parameters:  # the prior mean has some weight
        assert abs(e.value - right[e.name].value) < 0.2 * e.sigma, e.name


def test_sigma_is_close_to_the_bound(truck: Vehicle, guess: Vehicle) -> None:
    result = identify([simulate(truck, count=1, seed=2)], guess, KNOWN)
    truth = truck.parameters()
    for e in result.parameters:
        assert 0.9 * BOUND[e.name] < e.sigma / truth[e.name] < 1.4 * BOUND[e.name], e.name
    assert set(result.histories) == {"one stage"}
    history = result.histories["one stage"]
    assert history.values[-1] == pytest.approx([e.value for e in result.parameters], rel=1e-3)
    assert (np.diff(history.sigma[:, 0] / history.values[:, 0]) < 1e-3).all()


@pytest.mark.slow
def test_sensor_errors_and_parameters_together(truck: Vehicle, guess: Vehicle) -> None:
    """Gain, offset and delay of the steering, biases and a gain of gyros: all estimated within their sigma."""
    record = simulate(truck, count=2, seed=3)
    signals = dict(record.signals)
    delayed = np.interp(record.time - 0.04, record.time, signals[STEER])
    signals |= {
        STEER: delayed / 1.05 + 0.004,
        "yaw_rate.tractor": 1.003 * signals["yaw_rate.tractor"] + 0.002,
        "roll_rate.semitrailer": signals["roll_rate.semitrailer"] - 0.003,
    }
    result = identify([replace(record, signals=signals)], guess, OneStage(tyres="linear"))
    assert result.rounds <= 10
    assert all(e.verdict is Verdict.CONVERGED for e in result.parameters)
    assert max(np.abs(list(normalised_errors(result, truck).values()))) < 3.5
    errors = {e.name: e for e in result.sensors}
    for name, value in {
        f"{STEER}.gain": 1.05,
        f"{STEER}.offset": 0.004,
        f"{STEER}.delay": 0.04,
        "yaw_rate.tractor.offset": 0.002,
        "yaw_rate.tractor.gain": 1.003,
        "roll_rate.semitrailer.offset": -0.003,
    }.items():
        assert abs(errors[name].value - value) < 3.5 * errors[name].sigma, name
    assert errors[f"{STEER}.delay"].sigma < 0.015  # the latency of each gyro has a prior of 0.01 s
    assert {e.verdict for e in result.uncertain} <= {Verdict.CONVERGED, Verdict.NOT_EXCITED}
    assert result.logs[0].bank is not None


@pytest.mark.slow
def test_offsets_of_several_logs(truck: Vehicle, guess: Vehicle) -> None:
    records = []
    for i, offset in enumerate((0.003, -0.002)):
        record = simulate(truck, count=1, seed=i, name=f"log {i}")
        records.append(record.with_signals({"yaw_rate.tractor": record.signals["yaw_rate.tractor"] + offset}))
    result = identify(records, guess, replace(KNOWN, given={"others": "exact"}))
    offsets = {(e.log, e.name): e.value for e in result.sensors}
    differences = [  # only the difference of the two gyros is identifiable
        offsets[log, "yaw_rate.tractor.offset"] - offsets[log, "yaw_rate.semitrailer.offset"]
        for log in ("log 0", "log 1")
    ]
    assert differences == pytest.approx([0.003, -0.002], abs=0.0006)


@pytest.fixture(scope="module")
def five(truck: Vehicle) -> Record:
    return simulate(truck, count=2, seed=5)


@pytest.fixture(scope="module")
def clean(five: Record, guess: Vehicle) -> Identification:
    return identify([five], guess, KNOWN)


@pytest.mark.slow
@pytest.mark.parametrize(("size", "rejected", "largest"), [(0.8, 0, 0.25), (0.1, 20, 1.5)])
def test_robust_to_spikes_and_gaps(
    five: Record, clean: Identification, guess: Vehicle, size: float, rejected: int, largest: float
) -> None:
    """Spikes that no truck makes are left out; smaller ones are rejected as outliers, above the noise of each gyro."""
    record = five
    rng, signals = np.random.default_rng(0), {n: v.copy() for n, v in record.signals.items()}
    for name in signals:
        if "rate" in name:
            signals[name][rng.integers(0, len(record), 20)] += rng.choice([-size, size], 20)
            signals[name][500:560] = np.nan
    result = identify([replace(record, signals=signals)], guess, KNOWN)
    for e in clean.parameters:
        assert abs(result[e.name].value - e.value) < largest * e.sigma, e.name
    fractions = {name: value for name, value in result.logs[0].rejected.items() if name != "roll_rate.tractor"}
    assert fractions == pytest.approx(dict.fromkeys(fractions, rejected / len(record)), rel=0.3)


@pytest.mark.slow
def test_straight_driving_is_not_excited(truck: Vehicle, guess: Vehicle) -> None:
    result = identify([simulate(truck, manoeuvre="straight", seed=1)], guess, OneStage(tyres="linear"))
    given = guess.parameters() | {HEIGHT: quantity_of(HEIGHT).mean}
    for e in result.parameters:  # noise leaves the estimate within the prior
        assert e.verdict is Verdict.NOT_EXCITED, e.name
        assert abs(e.value - given[e.name]) < e.prior
        assert e.sigma > 0.7 * e.prior * (1.0 if e.name == HEIGHT else e.value / given[e.name])
    assert all(e.verdict is Verdict.NOT_EXCITED for e in result.derived)


@pytest.mark.slow
def test_without_roll_rates_the_payload_is_not_identifiable(truck: Vehicle, guess: Vehicle) -> None:
    record = without(simulate(truck, count=1, seed=4), "roll_rate")
    result = identify([record], guess, OneStage(tyres="linear"))
    height = result[HEIGHT]
    assert (height.verdict, height.correlated_with) == (Verdict.NOT_IDENTIFIABLE, ())
    assert abs(height.value - truck.parameters()[HEIGHT]) < 2 * height.sigma
    assert result["semitrailer.cog_height"].verdict is Verdict.NOT_IDENTIFIABLE
    verdicts = {e.name: e.verdict for e in result.parameters}
    assert [v for n, v in verdicts.items() if n != HEIGHT] == [Verdict.CONVERGED] * 4


def test_correlated_unknowns_are_named(truck: Vehicle, guess: Vehicle) -> None:
    """Front stiffness and an unknown steering gain in one lane change."""
    record = simulate(truck, count=1, seed=6)
    result = identify([record], guess, OneStage(tyres="linear", given={"others": "exact", "steer.*.gain": "+- 200 %"}))
    front = result["tractor.front.cornering_stiffness"]
    assert f"{STEER}.gain" in front.correlated_with


@pytest.mark.slow
def test_payload_of_any_shape(truck: Vehicle, guess: Vehicle) -> None:
    result = identify([simulate(truck, count=5, seed=7)], guess, replace(KNOWN, uniform_payload=False))
    names = [e.name for e in result.parameters]
    assert names[-2:] == ["semitrailer.sprung.cog_height", "semitrailer.sprung.roll_inertia"]
    truth = truck.derived()
    for name, allowed in (("semitrailer.cog_height", 0.015), ("semitrailer.roll_inertia", 0.2)):
        e = result[name]
        assert abs(e.value / truth[name] - 1) < allowed
        assert abs(e.value - truth[name]) < 3 * e.sigma
    assert result.vehicle.unit("semitrailer").payload is None


@pytest.mark.slow
def test_an_uncertain_number_that_the_log_does_not_inform_widens_sigma(truck: Vehicle, guess: Vehicle) -> None:
    record, soft = simulate(truck, count=2, seed=8), "semitrailer.roll_stiffness"
    certain = identify([record], guess, KNOWN)
    settings = replace(KNOWN, given={**KNOWN.given, soft: "+- 10 %"})
    result = identify([record], guess, settings)
    # an error of 10 % in the suspension stiffness moves the payload height by about 12 %
    assert 0.05 < result[HEIGHT].sigma / result[HEIGHT].value < 0.15
    (uncertain,) = result.uncertain
    assert (uncertain.name, uncertain.verdict) == (soft, Verdict.NOT_EXCITED)
    assert uncertain.sigma == pytest.approx(uncertain.prior, rel=0.3)
    assert abs(result[HEIGHT].value - certain[HEIGHT].value) < result[HEIGHT].sigma
    wrong = guess.replace({soft: 1.1 * truck.parameters()[soft]})
    moved = identify([record], wrong, settings)[HEIGHT]
    assert abs(moved.value - result[HEIGHT].value) == pytest.approx(moved.sigma, rel=0.35)


@pytest.mark.slow
def test_exact_parameters(truck: Vehicle, guess: Vehicle) -> None:
    record = simulate(truck, count=1, seed=10)

    def result(given: dict[str, str]) -> Identification:
        return identify([record], guess, replace(KNOWN, given={**KNOWN.given, **given}))

    verdicts = {e.name: (e.verdict, e.sigma) for e in result({"cornering_stiffness": "exact"}).parameters}
    assert list(verdicts.values()).count((Verdict.FIXED, None)) == 3
    assert verdicts["semitrailer.yaw_inertia"][0] is Verdict.CONVERGED
    for wrong in ("roll_axis_hight", "nonsense", "tractor.yaw_inertai"):
        with pytest.raises(VehicleError, match=f"{wrong}: no such parameter"):
            result({wrong: "+- 10 %"})
    with pytest.raises(VehicleError, match="given: everything is exact"):
        result(EVERY_PARAMETER)
    with pytest.raises(VehicleError, match=r"fifth_wheel\.roll_damping: expected a value above 0"):
        result({"fifth_wheel.roll_damping": "free"})


def banked(record: Record, truck: Vehicle, bank: float) -> Record:
    """The log of a linear truck on a level road as on a banked one, rad, where it starts in equilibrium."""
    steered = truck.with_logged_steering(record.signals, "the record")
    outputs = tuple(name for name in record.signals if "rate" in name)
    model, values = dynamics.model(steered, outputs, roll=True, bank=True), dynamics.all_parameters(steered, outputs)
    inputs = {name: record.signals[name] for name in ("speed", STEER)}
    first = {name: float(value[0]) for name, value in inputs.items()}
    starts = (np.append(steady_initial_state(steered, first, {}, roll=True, bank=b)[0], b) for b in (bank, 0.0))
    with_bank, level = (free_response(model, values, record.time, inputs, start)[1] for start in starts)
    return record.with_signals(
        {name: record.signals[name] + (with_bank - level)[:, i] for i, name in enumerate(outputs)}
    )


@pytest.mark.slow
def test_the_bank_of_the_road_is_estimated_if_the_steering_offset_is_known(truck: Vehicle, guess: Vehicle) -> None:
    """A bank of 2 degrees moves the truck to the right."""
    record, true_bank = simulate(truck, count=2, seed=13), np.radians(2)
    known = {"others": "exact", "road.bank": "+- 0.03 rad"}
    known |= {"steer.*.offset": "+- 1e-4 rad", "*_rate.*.offset": "+- 1e-4 rad/s"}
    result = identify([banked(record, truck, true_bank)], guess, replace(KNOWN, given=known))
    bank, sigma = result.logs[0].bank
    assert sigma < 0.02
    assert abs(bank - true_bank) < 3 * sigma
    assert max(np.abs(list(normalised_errors(result, truck).values()))) < 3.5


@pytest.mark.slow
def test_the_start_of_a_log_contains_no_information_on_the_bank(truck: Vehicle, guess: Vehicle) -> None:
    """A truck in equilibrium on a banked road does not roll at the start, and an unknown steering offset explains its
    yaw rate: the bank keeps its prior, with a vehicle file that is close to instability."""
    record = banked(simulate(truck, count=1, seed=13), truck, 0.06)
    settings = OneStage(tyres="linear", given={"softening": "exact"})  # softening tyres would inform the bank
    bank, sigma = identify([record], guess.replace({"tractor.drive.cornering_stiffness": 6e5}), settings).logs[0].bank
    assert sigma > 0.9 * quantity_of("road.bank").sigma
    assert abs(bank - 0.06) < 2.5 * sigma


@pytest.mark.parametrize(("friction", "raised"), [(0.2, True), (0.75, False)])
def test_the_search_begins_with_enough_friction(truck: Vehicle, friction: float, raised: bool) -> None:
    """At the prior means, but for a friction of at least 2 a / g: other tyres may skid."""
    record, settings = simulate(truck, count=1, seed=1), OneStage(tyres="saturating", given={"road.friction": friction})
    found = estimator._estimator([record], truck, settings, (), None)
    problem = Problem(found.setup, found.dataset.logs)
    z = found._initial(problem)
    slow = np.convolve(record.signals["speed"] * record.signals["yaw_rate.tractor"], np.ones(50) / 50, mode="valid")
    needed = 2 * np.abs(slow).max() / STANDARD_GRAVITY
    assert problem.values(z, 0)[FRICTION] == pytest.approx(needed if raised else friction, rel=0.02)
    assert not np.delete(z, problem.names.index(FRICTION)).any()


def test_a_nearly_unstable_vehicle_is_solved_by_prediction_errors(
    truck: Vehicle, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Below 0.1 1/s of the slowest mode, if the prediction errors have a minimum, or where a free run has no limit."""
    for decay, form, converged, spins, expected in (
        (0.1, "output_error", True, False, "output_error"),
        (0.0999, "output_error", True, False, "prediction_error"),
        (0.0999, "output_error", False, False, "output_error"),
        (0.0999, "prediction_error", True, False, "prediction_error"),
        (0.1, "output_error", False, True, "prediction_error"),
    ):

        def estimator_of(_, vehicle, settings, *others, case=(decay, converged, spins)):
            output_error = settings.form == "output_error"
            objective = SimpleNamespace(output_error=output_error, slowest_decay=lambda z: case[0])
            model = SimpleNamespace(hessian=np.full((1, 1), math.inf if case[2] and output_error else 1.0))
            minimum = SimpleNamespace(objective=objective, z=None, converged=case[1], model=model)
            return SimpleNamespace(
                minimise=lambda progress: minimum, solution=lambda m: SimpleNamespace(form=settings.form, minimum=m)
            )

        monkeypatch.setattr(estimator, "_estimator", estimator_of)
        assert solve_one_stage([], truck, OneStage(form=form, tyres="linear")).form == expected


@pytest.mark.slow
def test_all_samples_of_a_long_log_count(truck: Vehicle, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only the fits before the last one use a part of it, which is doubled while the truck does not follow the rest."""
    record = simulate(truck, count=10, seed=1)
    whole = solve_one_stage([record], *applied(truck, KNOWN))
    monkeypatch.setattr(estimator, "EARLY_ROWS", 500)
    sigma = whole.linearisation.posterior.sigma
    for excess, parts, early in ((8.99, [500], 1), (9.0, [500, 1000], 3)):
        sizes, fits = [], []
        monkeypatch.setattr(Problem, "excess", lambda _, z, part, to=sizes, e=excess: to.append(len(part)) or e)
        solution = solve_one_stage(
            [record],
            *applied(truck, KNOWN),
            progress=lambda title, done, total, to=fits: to.extend([title] * (done == total)),
        )
        assert sizes == pytest.approx(parts, abs=1)
        assert fits == [WHITE, *[EARLY] * early, FINAL]
        assert [len(segment) for segment in solution.problem.logs[0].segments] == [len(record) // 4]
        assert np.abs((solution.minimum.z - whole.minimum.z) / sigma).max() < 0.1
