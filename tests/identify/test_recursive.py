"""The learner on the road: as good as the whole record at once, calm where nothing is told, and hard to break."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from fifthwheel import dynamics, vehicle
from fifthwheel.errors import FifthwheelError, SignalError, VehicleError
from fifthwheel.filters.twice import Looks
from fifthwheel.identify import identify
from fifthwheel.identify.excitation import Excitation, LearnerSettings
from fifthwheel.identify.information import Verdict
from fifthwheel.identify.parameters import one_stage_unknowns, scaling, stage_1_names
from fifthwheel.identify.problem import Problem
from fifthwheel.identify.recursive import Learner
from fifthwheel.identify.settings import OneStage
from fifthwheel.identify.stage import Log
from fifthwheel.logs import Record
from fifthwheel.observe import Status
from fifthwheel.observe.prepare import fast_enough, locked_but
from fifthwheel.simulate import simulate
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]
FIVE = OneStage(priors={}, consider={}, nuisances=False)
HEIGHT = "semitrailer.payload.height"
GYROS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.tractor", "roll_rate.semitrailer")


@pytest.fixture(scope="module")
def drive(truck: Vehicle) -> Record:
    return simulate(truck, count=2, seed=5)


@pytest.fixture(scope="module")
def learned(guess: Vehicle, drive: Record) -> Learner:
    """After that drive; not to be changed."""
    return after(guess, drive)


def after(guess: Vehicle, record: Record, settings: OneStage = FIVE, **arguments: LearnerSettings) -> Learner:
    learner = Learner(guess, record.signals, settings, **arguments)
    learner.learn(record)
    return learner


def samples(record: Record) -> list[dict[str, float]]:
    names = ["time", *record.signals]
    rows = np.column_stack([record.time, *record.signals.values()]).tolist()
    return [dict(zip(names, row, strict=True)) for row in rows]


def knowledge(learner: Learner) -> tuple[Array, Array]:
    """z and its covariance."""
    return learner._live.filter.learned()


def changed(record: Record, change: Callable[[Array], Array], *quantities: str) -> Record:
    """The record with some quantities' signals changed."""
    signals = {n: change(np.array(v)) if n.split(".")[0] in quantities else v for n, v in record.signals.items()}
    return replace(record, signals=signals)


def expect_known(learner: Learner, truth: Vehicle, within: float = 4.0) -> None:
    for one in learner.parameters:
        assert one.verdict == Verdict.CONVERGED
        assert abs(one.value - truth.parameters()[one.name]) < within * one.sigma


# Accuracy


def errors_and_bound(truck: Vehicle, seeds: range, settings: OneStage) -> tuple[Array, Array]:
    """Relative errors (seeds, 5) after one lane change from 80 or 120 %, and the Cramer-Rao bound of each."""
    truth, names, found = truck.parameters(), stage_1_names(truck), []
    for seed in seeds:
        record = simulate(truck, count=1, seed=seed)
        factors = np.random.default_rng(1000 + seed).choice([0.8, 1.2], len(names))
        guess = truck.replace({name: truth[name] * f for name, f in zip(names, factors, strict=True)})
        found.append([one.value / truth[one.name] - 1 for one in after(guess, record, settings).parameters])
    record = simulate(truck, count=1, seed=0)
    known = locked_but(truck, record.signals, "record")
    unknowns = one_stage_unknowns(known, GYROS, settings)
    model = dynamics.model(known, GYROS, roll=True, free=tuple(dynamics.all_parameters(known, GYROS)))
    problem = Problem(model, known, [Log(name="log", sections=fast_enough(record, 5.0))], unknowns, settings)
    p, own = np.array([truth[u.name] for u in unknowns]), scaling(unknowns)
    z = np.zeros(len(problem.names))
    z[: len(p)] = own.to_z(p)
    sigma = np.sqrt(np.diag(np.linalg.inv(problem.expand(z).hessian)))[: len(p)]
    return np.array(found), sigma * np.abs(own.slope(p)) / p


@pytest.mark.parametrize("seeds", [range(6), pytest.param(range(100), marks=pytest.mark.slow)])
def test_one_lane_change_tells_it_all(truck: Vehicle, seeds: range) -> None:
    errors, bound = errors_and_bound(truck, seeds, FIVE)
    allowed = 1.5 if len(seeds) >= 100 else 2.2
    assert (np.sqrt(np.mean(errors**2, axis=0)) < allowed * bound).all()


@pytest.mark.slow
def test_sigma_is_what_the_errors_are(truck: Vehicle, guess: Vehicle) -> None:
    normalised = []
    for seed in range(8):
        learner = after(guess, simulate(truck, count=2, seed=seed), OneStage(priors={}, consider={}))
        for one in learner.parameters:
            normalised.append((one.value - truck.parameters()[one.name]) / one.sigma)
    assert 0.5 < np.std(normalised) < 1.5


@pytest.mark.slow
def test_with_all_that_is_known_roughly_it_is_where_the_whole_log_is(truck: Vehicle, guess: Vehicle) -> None:
    differences = []
    for seed in range(6):
        record = simulate(truck, count=1, seed=seed)
        batch, learner = identify([record], guess, OneStage(adapt_noise=False)), after(guess, record, OneStage())
        differences.append([(learner[e.name].value - e.value) / e.sigma for e in batch.parameters if e.sigma])
    assert (np.sqrt(np.mean(np.square(differences), axis=0)) < 1.0).all()


@pytest.mark.slow
def test_what_the_file_knows_roughly_is_off_by_what_it_says(truck: Vehicle) -> None:
    """Trucks that differ from the file where it is only rough: sigma tells what the errors are."""
    known = locked_but(truck, simulate(truck, count=1).signals, "record")
    rough = [u for u in one_stage_unknowns(known, GYROS, OneStage()) if u.considered or u.rough]
    normalised = []
    for seed in range(8):
        factors = np.exp(
            [
                u.scale * value
                for u, value in zip(rough, np.random.default_rng(seed).normal(size=len(rough)), strict=True)
            ]
        )
        real = known.replace({u.name: u.centre * float(f) for u, f in zip(rough, factors, strict=True)})
        names = stage_1_names(truck)
        factors = np.random.default_rng(100 + seed).choice([0.8, 1.2], len(names))
        guess = known.replace({n: real.parameters()[n] * f for n, f in zip(names, factors, strict=True)})
        learner = after(guess, simulate(real, count=3, seed=seed), OneStage())
        normalised += [
            (learner[name].value - real.parameters()[name]) / learner[name].sigma for name in (*names, HEIGHT)
        ]
    assert np.sqrt(np.mean(np.square(normalised))) < 1.5


def test_a_long_stretch_is_learned_in_parts(truck: Vehicle, guess: Vehicle) -> None:
    record = simulate(truck, manoeuvre="random", duration=20.0, seed=1)
    expect_known(after(guess, record, learner=LearnerSettings(looks=Looks(samples=300))), truck)


def test_without_second_looks_it_is_an_extended_kalman_filter(truck: Vehicle, guess: Vehicle) -> None:
    learner = after(guess, simulate(truck, count=3, seed=2), learner=LearnerSettings(looks=Looks(most=0)))
    expect_known(learner, truck, within=6.0)


@pytest.mark.slow
def test_a_vehicle_of_three_units(guess: Vehicle) -> None:
    fields = guess.model_dump()
    semitrailer = fields["units"][1]
    fields["units"] = (*fields["units"], {**semitrailer, "name": "second"})
    coupling = {**fields["couplings"][0], "name": "hitch"}
    coupling["leading_position"] = min(axle.position for axle in guess.units[1].axles)
    fields["couplings"] = (*fields["couplings"], coupling)
    train = Vehicle(**fields)
    record = simulate(train, count=1, speed=15.0, seed=1)
    learner = after(train, record, OneStage(priors={}, consider={}, nuisances=False, initial_payload_height=None))
    assert {one.name.split(".")[0] for one in learner.parameters} == {"tractor", "semitrailer", "second"}
    assert all(np.isfinite([one.value, one.sigma]).all() for one in learner.parameters)


# When it learns


def test_on_a_straight_road_nothing_moves(truck: Vehicle, guess: Vehicle) -> None:
    record = simulate(truck, manoeuvre="straight", duration=20.0, seed=3)
    steer = record.signals["steer.tractor.front"] + 0.01 + 2e-4 * np.random.default_rng(0).normal(size=len(record))
    learner = Learner(guess, record.signals, OneStage(priors={}, consider={}))
    answers = [learner.push(sample) for sample in samples(record.with_signals({"steer.tractor.front": steer}))]
    assert not any(answer["learning"] for answer in answers)
    z, Pz = knowledge(learner)
    np.testing.assert_array_equal(z, 0.0)
    np.testing.assert_array_equal(Pz, np.eye(len(z)))
    assert {one.verdict for one in (*learner.parameters, *learner.sensors)} == {Verdict.NOT_EXCITED}
    assert learner.vehicle().parameters() == pytest.approx(guess.parameters())  # and not the height it started from


def test_excitation_is_a_swing_and_no_offset(truck: Vehicle) -> None:
    excitation = Excitation(truck, 1, LearnerSettings())
    assert not any(excitation(0.01, [25.0, 0.02]) for _ in range(500))
    swing = [excitation(0.01, [25.0, 0.02 + 0.02 * np.sin(2.5 * 0.01 * k)]) for k in range(500)]
    assert swing[-1]
    calm = [excitation(0.01, [25.0, 0.02]) for _ in range(1000)]
    assert calm[0]
    assert not calm[-1]
    assert np.diff(np.array(calm, dtype=int)).min() == -1  # off once
    assert np.count_nonzero(np.diff(np.array(calm, dtype=int))) == 1


def test_nothing_is_learned_below_the_least_speed(truck: Vehicle, guess: Vehicle, drive: Record) -> None:
    slow = changed(drive, lambda u: u * 0 + 4.0, "speed")
    learner = Learner(guess, slow.signals, FIVE)
    answers = [learner.push(sample) for sample in samples(slow)]
    assert {answer["status"] for answer in answers} == {Status.TOO_SLOW}
    assert np.isnan(answers[-1]["sideslip.tractor"])
    np.testing.assert_array_equal(knowledge(learner)[0], 0.0)


def test_nothing_is_learned_right_after_a_gap(guess: Vehicle, drive: Record) -> None:
    learner = Learner(guess, drive.signals, FIVE)
    before = [learner.push(sample) for sample in samples(drive.cut(0.0, 2.0))]
    z, _ = knowledge(learner)
    later = replace(drive.cut(2.01, 3.4), time=drive.cut(2.01, 3.4).time + 5)
    answers = [learner.push(sample) for sample in samples(later)]
    assert before[-1]["learning"]
    assert not any(answer["learning"] for answer in answers[:100])
    assert any(answer["learning"] for answer in answers[100:])
    assert not np.array_equal(z, 0 * z)
    assert answers[50]["sideslip.tractor.sigma"] > 0


def test_what_is_considered_stays_and_counts(guess: Vehicle, drive: Record, learned: Learner) -> None:
    considered = after(guess, drive, replace(FIVE, consider={"roll_axis_height": 0.1}))
    unknowns = considered._live.unknowns
    z, _ = knowledge(considered)
    assert [u.considered for u in unknowns].count(True) > 0
    assert all(z[i] == 0.0 for i, u in enumerate(unknowns) if u.considered)
    assert len(considered.parameters) == len(learned.parameters)
    assert considered[HEIGHT].sigma > 1.2 * learned[HEIGHT].sigma


# States


def test_states_come_with_honest_sigmas(truck: Vehicle, guess: Vehicle) -> None:
    """Before anything is learned as well as after."""
    early, late = [], []
    for seed in range(8):
        record = simulate(truck, count=1, seed=seed)
        learner = Learner(guess, record.signals, FIVE)
        answers = [learner.push(sample) for sample in samples(record)]
        for errors, at in ((early, 110), (late, 600)):
            for name in ("sideslip.tractor", "sideslip.semitrailer", "roll.semitrailer", "articulation.semitrailer"):
                error = answers[at][name] - record.reference[name][at]
                errors.append(error / answers[at][f"{name}.sigma"])
    for errors in (early, late):
        assert np.sqrt(np.mean(np.square(errors))) < 2.0
        assert np.max(np.abs(errors)) < 5.0


def test_a_record_is_its_samples(guess: Vehicle, drive: Record, learned: Learner) -> None:
    pushed = Learner(guess, drive.signals, FIVE)
    for sample in samples(drive):
        pushed.push(sample)
    for one, other in zip(knowledge(pushed), knowledge(learned), strict=True):
        np.testing.assert_array_equal(one, other)


def test_long_and_uneven_steps_are_divided(truck: Vehicle, guess: Vehicle) -> None:
    record = simulate(truck, count=6, seed=4)
    kept = np.random.default_rng(1).random(len(record)) < 0.2
    signals = {name: values[kept] for name, values in record.signals.items()}
    expect_known(after(guess, Record(time=record.time[kept], signals=signals)), truck, within=6.0)


# Faults


def spikes(size: float) -> Callable[[Array], Array]:
    def change(values: Array) -> Array:
        rng = np.random.default_rng(7)
        values[rng.random(len(values)) < 0.01] += size * rng.normal()
        return values

    return change


def missing(part: float) -> Callable[[Array], Array]:
    def change(values: Array) -> Array:
        values[np.random.default_rng(8).random(len(values)) < part] = np.nan
        return values

    return change


HARMLESS: Mapping[str, tuple[Callable[[Array], Array], tuple[str, ...]]] = {
    "spikes": (spikes(1.0), ("yaw_rate", "roll_rate")),
    "huge spikes": (spikes(1e300), ("yaw_rate", "roll_rate")),
    "steer spikes": (spikes(0.2), ("steer",)),
    "speed spikes": (spikes(20.0), ("speed",)),
    "dropouts": (missing(0.3), ("yaw_rate", "roll_rate", "speed")),
    "steer dropouts": (missing(0.02), ("steer",)),
}
HARMFUL: Mapping[str, tuple[Callable[[Array], Array], tuple[str, ...]]] = {
    "swapped sign": (lambda v: -v, ("steer",)),
    "degrees": (np.degrees, ("yaw_rate", "roll_rate")),
    "noise": (lambda v: np.random.default_rng(len(v)).normal(size=len(v)), ("yaw_rate", "roll_rate")),
    "wandering": (lambda v: 0.1 * np.cumsum(np.random.default_rng(1).normal(size=len(v))), ("yaw_rate", "roll_rate")),
    "stuck at zero": (lambda v: 0 * v, ("yaw_rate", "roll_rate")),
    "noisy steer": (lambda v: v + 0.05 * np.random.default_rng(2).normal(size=len(v)), ("steer",)),
    "noisy speed": (lambda v: v + 10 * np.random.default_rng(3).normal(size=len(v)), ("speed",)),
}


@pytest.mark.parametrize("fault", [*HARMLESS, *HARMFUL])
def test_no_fault_breaks_the_covariance(truck: Vehicle, guess: Vehicle, drive: Record, fault: str) -> None:
    change, quantities = (HARMLESS | HARMFUL)[fault]
    record = changed(drive, change, *quantities)
    learner = Learner(guess, record.signals, FIVE)
    for k, sample in enumerate(samples(record)):
        learner.push(sample)
        if k % 40 == 0:
            z, Pz = knowledge(learner)
            assert np.isfinite(z).all()
            assert np.linalg.eigvalsh(Pz).min() > 0
    if fault in HARMLESS:
        expect_known(learner, truck, within=6.0)
    elif fault != "noisy speed":
        assert any(one.verdict != Verdict.CONVERGED for one in learner.parameters)
    learner.vehicle()


@pytest.mark.parametrize("time", [0.5, 0.4, -1.0, np.nan, np.inf, None])
def test_time_that_does_not_go_forward_is_refused_and_leaves_no_trace(
    guess: Vehicle, drive: Record, time: float | None
) -> None:
    one, other = (Learner(guess, drive.signals, FIVE) for _ in range(2))
    for sample in samples(drive.cut(0.0, 0.5)):
        one.push(sample)
        other.push(sample)
    with pytest.raises(SignalError, match="time"):
        one.push({**samples(drive)[300], "time": time})
    with pytest.raises(SignalError, match="time"):
        one.learn(drive)
    for sample in samples(drive.cut(0.51, 2.5)):
        assert one.push(sample) == other.push(sample)


def test_a_missing_input_is_held_for_a_while(guess: Vehicle, drive: Record) -> None:
    learner = Learner(guess, drive.signals, FIVE)
    for sample in samples(drive.cut(0.0, 2.0)):
        learner.push(sample)
    found = [learner.push({**s, "steer.tractor.front": None}) for s in samples(drive.cut(2.01, 3.0))]
    status = [answer["status"] for answer in found]
    assert status[40] == Status.OK
    assert status[-1] == Status.INPUT_MISSING
    assert not any(answer["learning"] for answer in found)  # a held angle is no news
    assert np.isnan(found[-1]["roll.tractor"])


def test_a_speed_that_no_truck_has_is_missing(guess: Vehicle, drive: Record) -> None:
    learner = Learner(guess, drive.signals, FIVE)
    for sample in samples(drive.cut(0.0, 1.0)):
        learner.push(sample)
    status = [learner.push({**s, "speed": 90.0})["status"] for s in samples(drive.cut(1.01, 2.0))]
    assert status[0] == Status.OK
    assert status[-1] == Status.INPUT_MISSING


def test_without_measurements_it_coasts(guess: Vehicle, drive: Record) -> None:
    learner = Learner(guess, drive.signals, FIVE)
    for sample in samples(drive.cut(0.0, 1.0)):
        learner.push(sample)
    inputs = ("time", "speed", "steer.tractor.front")
    for sample in samples(drive.cut(1.01, 2.5)):
        answer = learner.push({name: sample[name] for name in inputs})
    assert answer["status"] == Status.COASTING
    assert np.isfinite(answer["sideslip.tractor"])


@pytest.mark.parametrize(
    ("signals", "expected"),
    [
        (("steer.tractor.front", "yaw_rate.tractor"), "speed"),
        (("speed", "yaw_rate.tractor"), "steer.tractor.front"),
        (("speed", "steer.tractor.front", "roll_rate.tractor"), "yaw_rate.tractor"),
    ],
)
def test_signals_that_must_be_there(guess: Vehicle, signals: tuple[str, ...], expected: str) -> None:
    with pytest.raises(SignalError, match=expected):
        Learner(guess, signals, FIVE)


def test_a_record_without_the_signals_is_refused(guess: Vehicle, drive: Record) -> None:
    learner = Learner(guess, [*drive.signals, "articulation.semitrailer"], FIVE)
    with pytest.raises(SignalError, match="articulation"):
        learner.learn(drive)


# What is kept


def test_the_vehicle_has_what_was_learned(guess: Vehicle, learned: Learner) -> None:
    found = learned.vehicle()
    for one in learned.parameters:
        assert found.parameters()[one.name] == pytest.approx(one.value)
        assert learned[one.name] == one
    same = set(guess.parameters()) - {one.name for one in learned.parameters}
    assert all(found.parameters()[name] == guess.parameters()[name] for name in same)


def test_saved_and_loaded_it_knows_the_same(guess: Vehicle, drive: Record, tmp_path: Path) -> None:
    first = after(guess, drive, OneStage(priors={}, consider={"roll_damping": 0.3}))
    first.save(tmp_path / "learner.json")
    second = Learner.load(tmp_path / "learner.json")
    assert second.parameters == pytest.approx(first.parameters)
    assert second.sensors == first.sensors
    assert second.vehicle() == first.vehicle()
    second.learn(drive)  # a new drive: its time may begin anew
    assert second[HEIGHT].sigma < first[HEIGHT].sigma
    assert not list(tmp_path.glob(".*"))


@pytest.mark.parametrize(
    "spoil",
    [
        lambda text: text[: len(text) // 2],
        lambda text: "",
        lambda text: "[1, 2]",
        lambda text: '{"parameters": []}',
        lambda text: text.replace('"z": [', '"z": [1.0, ', 1),
        lambda text: text.replace("tractor", "trucktor"),
        lambda text: text.replace("learner 1", "learner 9"),
    ],
)
def test_a_damaged_or_foreign_file_is_refused(learned: Learner, tmp_path: Path, spoil: Callable[[str], str]) -> None:
    path = tmp_path / "learner.json"
    learned.save(path)
    path.write_text(spoil(path.read_text()))
    with pytest.raises(SignalError, match=r"learner\.json"):
        Learner.load(path)


def test_another_trailer_keeps_the_tractor(truck: Vehicle, guess: Vehicle, drive: Record, tmp_path: Path) -> None:
    learner = after(guess, drive)
    first = {one.name: one for one in learner.parameters}
    learner.trailer("empty", guess)
    for one in learner.parameters:
        if one.name.startswith("tractor."):
            assert (one.value, one.sigma) == pytest.approx((first[one.name].value, first[one.name].sigma))
        else:
            assert one.verdict == Verdict.NOT_EXCITED
    assert np.linalg.eigvalsh(knowledge(learner)[1]).min() > 0
    learner.learn(replace(drive, time=drive.time + 100))
    expect_known(learner, truck)
    second = {one.name: one for one in learner.parameters}

    learner.save(tmp_path / "learner.json")
    learner = Learner.load(tmp_path / "learner.json")
    learner.trailer(guess.name, guess)
    for one in learner.parameters:
        kept = second if one.name.startswith("tractor.") else first
        assert (one.value, one.sigma) == pytest.approx((kept[one.name].value, kept[one.name].sigma))


def test_the_same_name_for_another_trailer_is_refused(guess: Vehicle, drive: Record) -> None:
    learner = after(guess, drive)
    before = learner.parameters
    learner.trailer("other", guess)
    heavier = guess.replace({"semitrailer.yaw_inertia": 2 * guess.parameters()["semitrailer.yaw_inertia"]})
    with pytest.raises(SignalError, match="another name"):
        learner.trailer(guess.name, heavier)
    learner.trailer(guess.name, guess)
    assert learner[HEIGHT].value == pytest.approx({one.name: one for one in before}[HEIGHT].value)


def test_another_tractor_is_refused(learned: Learner, guess: Vehicle) -> None:
    with pytest.raises(VehicleError, match="new tractor"):
        learned.trailer("any", vehicle.get("auburn_6x4"))


@pytest.mark.parametrize("wrong", [{"start": 0.0}, {"stop": 1.0}, {"hold": -1.0}, {"window": float("nan")}])
def test_settings_that_cannot_be_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(FifthwheelError, match=next(iter(wrong))):
        LearnerSettings(**wrong)


def test_what_only_a_roll_rate_tells_is_left_alone_without_one(guess: Vehicle, drive: Record) -> None:
    fields = ("speed", "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer")
    record = replace(drive, signals={name: drive.signals[name] for name in fields})
    learner = after(guess, record)
    assert learner[HEIGHT].verdict == Verdict.NOT_IDENTIFIABLE
    assert learner.vehicle().parameters()[HEIGHT] == guess.parameters()[HEIGHT]
    assert learner["semitrailer.cornering_stiffness"].verdict == Verdict.CONVERGED
    assert HEIGHT in {one.name for one in learner.parameters}
