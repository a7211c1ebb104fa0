"""When the learner learns, what it keeps without information, and that faults of the signals do not break it."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.observe import Status
from fifthwheel.estimate.online import Learner, LearnerSettings
from fifthwheel.estimate.online.online_model import online_setup
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle
from tests.estimate.conftest import without
from tests.estimate.online.conftest import (
    FIVE,
    HEIGHT,
    OF_TRACTOR,
    WITH_SENSORS,
    assert_identified,
    estimates,
    learn,
    samples,
)


def changed(record: Record, change: Callable[[Array], Array], *quantities: str) -> Record:
    """The record with the signals of some quantities changed."""
    signals = {n: change(np.array(v)) if n.split(".")[0] in quantities else v for n, v in record.signals.items()}
    return replace(record, signals=signals)


def test_a_record_gives_the_same_estimates_as_its_samples(guess: Vehicle, lanes: Record, learned: Learner) -> None:
    pushed = Learner(guess, lanes.signals, FIVE)
    for sample in samples(lanes):
        pushed.push(sample)
    for one, other in zip(estimates(pushed), estimates(learned), strict=True):
        np.testing.assert_array_equal(one, other)


def test_the_vehicle_has_the_estimates(guess: Vehicle, learned: Learner) -> None:
    vehicle = learned.vehicle()
    for estimate in learned.parameters:
        assert vehicle.parameters()[estimate.name] == pytest.approx(estimate.value)
        assert learned[estimate.name] == estimate
    others = set(guess.parameters()) - {estimate.name for estimate in learned.parameters}
    assert all(vehicle.parameters()[name] == guess.parameters()[name] for name in others)


@pytest.mark.slow
def test_considered_parameters_stay_and_increase_the_sigmas(
    guess: Vehicle, considering: Learner, learned: Learner
) -> None:
    considered = [u.name for u in considering._live.setup.unknowns if not u.estimated]
    assert considered == ["tractor.roll_axis_height", "semitrailer.roll_axis_height"]
    for name in considered:
        assert considering[name].value == guess.parameters()[name]
    assert len(considering.parameters) == len(learned.parameters)
    assert considering[HEIGHT].sigma > 1.2 * learned[HEIGHT].sigma
    assert considering.doubts == ()


def test_changes_of_the_vehicle_file_are_considered_at_zero(guess: Vehicle, lanes: Record) -> None:
    """The change `tractor.mass`, in its standard deviations, is not the parameter `tractor.mass`, in kg."""
    learner = Learner(guess, lanes.signals, OneStage(tyres="linear"))
    unknowns = {u.name: u for u in learner._live.setup.unknowns}
    assert {"tractor.mass", "semitrailer.payload.mass", "mass_scale", "time_base"} <= set(unknowns)
    assert {u.centre for u in unknowns.values() if u.moves and not u.estimated} == {0.0}
    assert unknowns["semitrailer.cornering_stiffness.variation"].estimated
    assert "semitrailer.cornering_stiffness.variation" not in {value.name for value in learner.parameters}


def test_automatic_tyres_are_linear_without_axle_loads(guess: Vehicle, lanes: Record) -> None:
    """Two groups on the trailer leave the loads open. A learner without settings has linear tyres in any case."""
    group = guess.units[1].axle_groups[0]
    axles = [group.model_copy(update={"name": f"part{i}", "axles": (axle,)}) for i, axle in enumerate(group.axles)]
    trailer = guess.units[1].model_copy(update={"axle_groups": tuple(axles)})
    undetermined = guess.model_copy(update={"units": (guess.units[0], trailer)})
    automatic = replace(FIVE, tyres="auto")
    for vehicle, law in ((undetermined, "linear"), (guess, "saturating")):
        assert online_setup(vehicle, lanes.signals, automatic).settings.tyres == law
    assert Learner(guess, lanes.signals).live.setup.settings.tyres == "linear"


# When it learns


@pytest.mark.slow
def test_the_signals_of_the_tractor_are_enough(truck: Vehicle, guess: Vehicle) -> None:
    """The trailer pulls at the fifth wheel, so that its parameters and its motion follow."""
    record = simulate(truck, count=4, seed=3)
    learner = Learner(guess, OF_TRACTOR, WITH_SENSORS)
    learner.learn(record)
    stiffness = [f"{group}.cornering_stiffness" for group in ("tractor.front", "tractor.drive", "semitrailer")]
    for e in map(learner.__getitem__, (*stiffness, "semitrailer.yaw_inertia")):
        assert e.verdict is Verdict.CONVERGED
        assert e.sigma is not None
        assert abs(e.value - truck.parameters()[e.name]) < 3 * e.sigma < 0.45 * e.value, e.name
    assert learner[HEIGHT].verdict is Verdict.NOT_IDENTIFIABLE
    unseen, name = simulate(truck, count=1, seed=4), "articulation.semitrailer"
    found = [learner.push(sample | {"time": sample["time"] + 1e3}) for sample in samples(unseen)][100:]
    error = np.array([now[name] for now in found]) - unseen.reference[name][100:]
    assert np.mean(np.abs(error) < 2 * np.array([now[f"{name}.sigma"] for now in found])) > 0.9
    assert np.sqrt(np.mean(error**2)) < 0.1 * np.ptp(unseen.reference[name])


def test_a_roll_rate_without_samples_counts_as_absent(guess: Vehicle, lanes: Record, tmp_path: Path) -> None:
    empty = changed(lanes, lambda values: np.full_like(values, np.nan), "roll_rate")
    learner = learn(guess, empty)
    learner.save(tmp_path / "truck.json")
    for each in (learner, Learner.load(tmp_path / "truck.json")):
        assert each[HEIGHT].verdict == Verdict.NOT_IDENTIFIABLE
        assert each.vehicle().parameters()[HEIGHT] == guess.parameters()[HEIGHT]
        assert each["semitrailer.yaw_inertia"].verdict == Verdict.CONVERGED


@pytest.mark.slow
def test_on_a_straight_road_nothing_is_learned(truck: Vehicle, guess: Vehicle) -> None:
    record = simulate(truck, manoeuvre="straight", duration=20.0, seed=3)
    steer = record.signals["steer.tractor.front"] + 0.01 + 2e-4 * np.random.default_rng(0).normal(size=len(record))
    learner = Learner(guess, OF_TRACTOR, WITH_SENSORS)
    answers = [learner.push(sample) for sample in samples(record.with_signals({"steer.tractor.front": steer}))]
    assert not any(answer["learning"] for answer in answers)
    z, Pz = estimates(learner)
    np.testing.assert_array_equal(z, 0.0)
    np.testing.assert_array_equal(Pz, np.eye(len(Pz)))
    verdicts = {e.name: e.verdict for e in (*learner.parameters, *learner.sensors)}
    assert verdicts.pop(HEIGHT) is Verdict.NOT_IDENTIFIABLE
    assert set(verdicts.values()) == {Verdict.NOT_EXCITED}
    assert learner.vehicle().parameters() == pytest.approx(guess.parameters())  # not the initial payload height


def test_nothing_is_learned_where_it_is_slow_and_right_after_a_gap(guess: Vehicle, lanes: Record) -> None:
    slow = changed(lanes.cut(0.0, 4.0), lambda u: u * 0 + 4.0, "speed")
    learner = Learner(guess, slow.signals, FIVE)
    answers = [learner.push(sample) for sample in samples(slow)]
    assert {answer["status"] for answer in answers} == {Status.TOO_SLOW}
    assert np.isnan(answers[-1]["sideslip.tractor"])
    np.testing.assert_array_equal(estimates(learner)[0], 0.0)
    learner = Learner(guess, lanes.signals, FIVE)
    before = [learner.push(sample) for sample in samples(lanes.cut(0.0, 2.0))]
    assert before[-1]["learning"]
    assert estimates(learner)[0].any()
    later = lanes.cut(2.01, 3.4)
    answers = [learner.push(sample) for sample in samples(replace(later, time=later.time + 5))]
    assert not any(answer["learning"] for answer in answers[:100])
    assert any(answer["learning"] for answer in answers[100:])


# Faults


def spikes(size: float) -> Callable[[Array], Array]:
    def change(values: Array) -> Array:
        generator = np.random.default_rng(7)
        values[generator.random(len(values)) < 0.01] += size * generator.normal()
        return values

    return change


HARMLESS: Mapping[str, tuple[Callable[[Array], Array], tuple[str, ...]]] = {
    "huge spikes": (spikes(1e300), ("yaw_rate", "roll_rate")),
    "steer spikes": (spikes(0.2), ("steer",)),
    "speed spikes": (spikes(20.0), ("speed",)),
}
HARMFUL: Mapping[str, tuple[Callable[[Array], Array], tuple[str, ...]]] = {
    "inverted sign": (lambda v: -v, ("steer",)),
    "degrees": (np.degrees, ("yaw_rate", "roll_rate")),
}


@pytest.mark.slow
@pytest.mark.parametrize("fault", [*HARMLESS, *HARMFUL])
def test_no_fault_breaks_the_covariance(truck: Vehicle, guess: Vehicle, lanes: Record, fault: str) -> None:
    change, quantities = (HARMLESS | HARMFUL)[fault]
    record = changed(lanes if fault in HARMLESS else lanes.cut(0.0, 8.0), change, *quantities)
    learner = Learner(guess, record.signals, FIVE)
    for k, sample in enumerate(samples(record)):
        learner.push(sample)
        if k % 40 == 0:
            z, Pz = estimates(learner)
            assert np.isfinite(z).all()
            assert np.linalg.eigvalsh(Pz).min() > 0
    if fault in HARMLESS:
        assert_identified(learner, truck, sigmas=6.0)
    else:
        assert any(estimate.verdict != Verdict.CONVERGED for estimate in learner.parameters)
    learner.vehicle()


@pytest.mark.parametrize("time", [0.5, np.nan, None])
def test_a_time_that_is_not_later_is_refused_without_effect(guess: Vehicle, lanes: Record, time: float | None) -> None:
    one, other = (Learner(guess, lanes.signals, FIVE) for _ in range(2))
    for sample in samples(lanes.cut(0.0, 0.5)):
        one.push(sample)
        other.push(sample)
    with pytest.raises(SignalError, match="time: "):
        one.push({**samples(lanes)[300], "time": time})
    with pytest.raises(SignalError, match=r"time: simulated starts at 0 s, which is not after 0\.5 s"):
        one.learn(lanes)
    for sample in samples(lanes.cut(0.51, 2.5)):
        assert one.push(sample) == other.push(sample)


@pytest.mark.parametrize("steer", [-1e300, 1.1])
def test_an_impossible_steer_angle_is_missing(guess: Vehicle, lanes: Record, steer: float) -> None:
    """In the first sample, and after a gap."""
    learner = Learner(guess, lanes.signals, FIVE)
    for k, sample in enumerate(samples(lanes.cut(0.0, 6.0))):
        later = {**sample, "time": sample["time"] + (9.0 if k >= 300 else 0.0)}
        answer = learner.push({**later, "steer.tractor.front": steer} if k in (0, 300) else later)
        assert k not in (0, 300) or answer["status"] == Status.INPUT_MISSING
        assert np.isfinite(answer["sideslip.tractor"]) == (answer["status"] in (Status.OK, Status.SETTLING))
    assert np.isfinite([(e.value, e.sigma) for e in learner.parameters]).all()
    assert learner["tractor.front.cornering_stiffness"].verdict == Verdict.CONVERGED


def test_present_parameters_are_those_of_all_samples_between_segments(guess: Vehicle, lanes: Record) -> None:
    """Within a segment they are near: of the filter that has seen each sample once."""
    learner, within = Learner(guess, lanes.signals, FIVE), 0.0
    for k, sample in enumerate(samples(lanes.cut(0.0, 9.0))):
        learner.push(sample)
        if k % 100 == 99 and learner.live.learning:
            pairs = zip(learner.parameters, learner.present_parameters, strict=True)
            within = max(within, *(abs(a.value - b.value) / a.sigma for a, b in pairs))
    assert learner.live.learning is False
    assert 0.0 < within < 5.0
    assert learner.present_parameters == learner.parameters


# What it refuses


def test_signals_records_and_settings_that_it_refuses(guess: Vehicle, lanes: Record) -> None:
    for signals, expected in (
        (("steer.tractor.front", "yaw_rate.tractor"), "speed: not among the signals"),
        (("speed", "yaw_rate.tractor"), "steer.tractor.front"),
        (("speed", "steer.tractor.front", "roll_rate.tractor"), "yaw_rate.tractor: not among the signals"),
    ):
        with pytest.raises(SignalError, match=expected):
            Learner(guess, signals, FIVE)
    with pytest.raises(SignalError, match=r"roll_rate\.tractor: not in simulated"):
        Learner(guess, lanes.signals, FIVE).learn(without(lanes, "roll_rate"))
    with pytest.raises(SignalError, match="given: no unknown is left to estimate"):
        Learner(guess, lanes.signals, replace(FIVE, given={"*": "exact"}))
    for name, value in (
        ("start_excitation", 0.0),
        ("stop_excitation", 1.0),
        ("hold", -1.0),
        ("excitation_window", np.nan),
    ):
        with pytest.raises(FifthwheelError, match=f"^{name}: expected"):
            LearnerSettings(**{name: value})
