"""Knowledge of a truck: from log to log as in one call, with changes dated, other loads apart, and bad logs aside."""

from dataclasses import replace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.estimate.identify.knowledge.knowledge import UNSURE
from fifthwheel.results.diagnose.doubt_cautions import contradiction_cautions
from tests.estimate.identify.knowledge.conftest import SETTINGS
from tests.estimate.identify.test_saturating_tyres import response

TRUCK = fw.vehicle("cheng_cebon_2011")
GUESS = TRUCK.replace({"tractor.front.cornering_stiffness": 4.2e5, "semitrailer.cornering_stiffness": 1.1e6})
TYRES = "semitrailer.cornering_stiffness"
FRONT, HEIGHT = "tractor.front.cornering_stiffness", "semitrailer.payload.height"
LINEAR = fw.OneStage(tyres="linear")
"""The tyres of the simulated truck."""
SMALL = fw.OneStage(given={"*": "exact", FRONT: "free"}, tyres="linear")
"""Settings that are identified in a fraction of a second."""


def log(seed, truck=TRUCK, *, name=None):
    return replace(fw.simulate(truck, count=2, seed=seed, speed=18.0 + 2 * (seed % 3)), name=name or f"run {seed}")


@pytest.fixture(scope="module")
def records():
    return [log(seed) for seed in range(3)]


@pytest.fixture(scope="module")
def first(records):
    return fw.identify(records[:1], GUESS, LINEAR)


@pytest.fixture(scope="module")
def small(records):
    return fw.identify(records[:1], GUESS, SMALL)


@pytest.mark.slow
def test_logs_one_after_another_are_as_in_one_call(records, first):
    """Each log is linearised at another estimate, and each call takes the friction of its road as its own."""
    more = fw.identify([records[1]], GUESS, LINEAR, knowledge=first.knowledge)
    assert [log.name for log in more.knowledge.logs] == ["run 0", "run 1"]
    assert any(note.endswith("(1, the last of them run 0).") for note in more.notes)
    assert all(more[e.name].sigma < e.sigma for e in first.parameters if "road" not in e.name)
    last = fw.identify([records[2]], GUESS, LINEAR, knowledge=more.knowledge)
    together = fw.identify(records, GUESS, LINEAR)
    for e in (e for e in together.parameters if e.name != "road.friction"):
        assert abs(last[e.name].value - e.value) < 0.25 * e.sigma, e.name
        assert last[e.name].sigma == pytest.approx(e.sigma, rel=0.05), e.name


def test_a_log_counts_once(records, small):
    again = fw.identify([records[0]], GUESS, SMALL, knowledge=small.knowledge)
    assert len(again.knowledge.logs) == 1
    assert again[FRONT].sigma == pytest.approx(small[FRONT].sigma, rel=1e-6)


@pytest.mark.slow
def test_softer_tyres_begin_again(first):
    """A fifth softer, as new tyres or less pressure: all estimates but theirs go on."""
    soft = TRUCK.replace({TYRES: 0.8 * TRUCK.parameters()[TYRES]})
    result = fw.identify([log(7, soft, name="soft")], GUESS, LINEAR, knowledge=first.knowledge)
    assert result.knowledge.logs[-1].changed == (TYRES,)
    (caution,) = contradiction_cautions(result)
    assert str(caution).startswith("soft differs from the earlier logs: tyres of semitrailer changed.")
    assert abs(result[TYRES].value / soft.parameters()[TYRES] - 1) < 2 * result[TYRES].sigma / result[TYRES].value
    assert result[FRONT].sigma < first[FRONT].sigma


@pytest.mark.slow
def test_another_load_shares_the_tyres_at_their_nominal_load(records, first):
    """The stiffness of the unladen trailer gives that of the laden one, by the load of its tyres."""
    empty = fw.with_payload(TRUCK, 0.0)
    unladen = fw.identify([log(3, empty)], fw.with_payload(GUESS, 0.0), LINEAR, occasion=fw.Occasion(load="0t"))
    laden = fw.identify([records[0]], GUESS, LINEAR, knowledge=unladen.knowledge)
    assert unladen[TYRES].value < 0.6 * laden[TYRES].value
    assert laden[TYRES].sigma < first[TYRES].sigma
    assert laden["semitrailer.payload.height"].sigma < first["semitrailer.payload.height"].sigma
    for name in (TYRES, FRONT, "semitrailer.yaw_inertia", "semitrailer.payload.height"):
        assert abs(laden[name].value - TRUCK.parameters()[name]) < 2.5 * laden[name].sigma


def test_masses_of_another_load_need_its_name(records, small):
    known = small.knowledge
    half = fw.with_payload(TRUCK, 10e3)
    with pytest.raises(SignalError, match=r"semitrailer\.mass: 23328 kg, but 33450 kg .* another load\? Name it"):
        fw.identify([records[1]], half, SMALL, knowledge=known)
    named = fw.identify([records[1]], half, SMALL, knowledge=known, occasion=fw.Occasion(load="half"))
    assert len(named.knowledge.logs) == 2
    with pytest.raises(SignalError, match="knowledge: only one stage begins with what is known"):
        fw.identify([records[1]], TRUCK, fw.TwoStage(), knowledge=small.knowledge)


def test_tyres_keep_their_relative_uncertainty_with_another_payload():
    """Stated ones, and those of a class, which stay assumed."""
    stated, assumed = "tractor.drive.cornering_stiffness", "semitrailer.cornering_stiffness"
    value = TRUCK.parameters()
    known = TRUCK.model_copy(
        update={"stated": {stated: 0.05 * value[stated], assumed: 0.2 * value[assumed]}, "assumed": {assumed: "class"}}
    )
    half = fw.with_payload(known, 10e3)
    after = half.parameters()
    assert after[stated] < 0.9 * value[stated]
    assert half.stated[stated] == pytest.approx(0.05 * after[stated])
    assert half.stated[assumed] == pytest.approx(0.2 * after[assumed])
    assert half.assumed == known.assumed


def test_with_payload_keeps_the_unladen_vehicle():
    half, again = fw.with_payload(TRUCK, 10e3), fw.with_payload(fw.with_payload(TRUCK, 10e3), 20122.0)
    before, after, back = TRUCK.parameters(), half.parameters(), again.parameters()
    assert after["semitrailer.mass"] - after["semitrailer.payload.mass"] == pytest.approx(33450 - 20122)
    assert after["semitrailer.sprung.mass"] == before["semitrailer.sprung.mass"]
    assert after[TYRES] < before[TYRES]
    for name, value in before.items():
        assert back[name] == pytest.approx(value, rel=1e-9), name
    assert half.stated["semitrailer.cog"] > 0.15
    double = fw.vehicle("b_double")
    lighter = fw.with_payload(double, 5e3, unit="lead")
    assert [b.mass - a.mass for a, b in zip(lighter.units, double.units, strict=True)] == [0, 8e3, 0]
    with pytest.raises(VehicleError, match="expected one unit with a payload, got 2"):
        fw.with_payload(double, 5e3)
    with pytest.raises(VehicleError, match="expected one unit with a payload, got 0"):
        fw.with_payload(fw.with_payload(TRUCK, 0.0), 5e3)
    for mass in (-1.0, np.nan, np.inf):
        with pytest.raises(fw.SignalError, match=r"payload: expected a number of kg from 0 on, got"):
            fw.with_payload(TRUCK, mass)


@pytest.mark.slow
def test_a_log_of_the_tractor_alone_gives_the_states_of_a_known_trailer(first):
    record = log(19, name="tractor")
    record = replace(record, signals={n: v for n, v in record.signals.items() if not n.endswith("rate.semitrailer")})
    result = fw.identify([record], GUESS, LINEAR, knowledge=first.knowledge)
    assert result[TYRES].verdict == result["semitrailer.payload.height"].verdict == "converged"
    assert result[TYRES].sigma < 1.02 * first[TYRES].sigma
    states = result.observer(log="tractor").batch(record, result.uncertainty("tractor"))
    truth = fw.simulate(TRUCK, count=2, seed=19, speed=20.0).reference["sideslip.semitrailer"]
    error = np.abs(states.values["sideslip.semitrailer"] - truth)
    assert np.mean(error < 3 * states.sigma["sideslip.semitrailer"]) > 0.9
    assert (
        np.sqrt(np.mean(error**2))
        < 1.5 * np.sqrt(np.mean(states.sigma["sideslip.semitrailer"] ** 2))
        < 0.2 * np.ptp(truth)
    )


@pytest.mark.slow
def test_a_log_that_did_not_converge_is_set_aside_until_it_is_identified_again(knowledge: fw.Knowledge) -> None:
    """After one step only. Its result says so; later logs do not begin with it, and no other log brings it back."""
    first, second = (fw.simulate(TRUCK, count=1, seed=seed, name=f"run {seed}") for seed in (4, 5))
    stopped = fw.identify([first], GUESS, replace(SETTINGS, adapt_noise=False, iterations=1))
    assert fw.Verdict.NOT_CONVERGED in {estimate.verdict for estimate in stopped.parameters}
    (log,) = stopped.knowledge.logs
    assert log.set_aside == UNSURE
    with pytest.raises(SignalError, match="run 4 must be identified again"):
        _ = stopped.knowledge.combined
    both = knowledge.with_logs([log])
    assert both.without("run 1").used == both.used[1:]
    assert both.majority(knowledge.logs) is None
    later = fw.identify([second], TRUCK, SETTINGS, knowledge=both)
    assert [log.set_aside for log in later.knowledge.logs] == ["", "", "", UNSURE, ""]
    again = fw.identify([first], TRUCK, SETTINGS, knowledge=later.knowledge)
    assert [(log.name, log.set_aside) for log in again.knowledge.logs][3:] == [("run 5", ""), ("run 4", "")]


# A known payload


@pytest.fixture(scope="module")
def assumed():
    """The truck with a suspension in its file that is stiffer than the real one, at a higher roll axis."""
    values, name = TRUCK.parameters(), "semitrailer.roll_stiffness"
    return TRUCK.replace({name: 1.12 * values[name], "semitrailer.roll_axis_height": 0.88})


@pytest.mark.slow
def test_a_known_payload_makes_the_next_payload_height_more_accurate(assumed):
    """The known one has the same mass, and a height of 0.8 m."""
    low, record = fw.simulate(TRUCK.replace({HEIGHT: 0.8}), count=1, seed=3), fw.simulate(TRUCK, count=1, seed=4)
    settings = replace(LINEAR, given={HEIGHT: "0.8 m exact"})
    known = fw.identify([low], assumed, settings, occasion=fw.Occasion(load="a"))
    alone = fw.identify([record], assumed, LINEAR)[HEIGHT]
    after = fw.identify([record], assumed, LINEAR, knowledge=known.knowledge, occasion=fw.Occasion(load="b"))[HEIGHT]
    true = TRUCK.parameters()[HEIGHT]
    assert abs(alone.value / true - 1) > 0.09
    assert abs(after.value / true - 1) < 0.08
    assert after.sigma < 0.7 * alone.sigma
    assert after.verdict == "converged"


# Logs on one road share its friction

FRICTION, TRUE = "road.friction", 0.3
SLIPPERY = fw.OneStage(tyres="saturating", check=False)


@pytest.fixture(scope="module")
def of_road(tmp_path_factory):
    """Of a sine on snow, as a file keeps it."""
    occasion, path = fw.Occasion(road="pass"), tmp_path_factory.mktemp("known") / "knowledge.json"
    first = response(1.5, TRUE, name="first")
    result = fw.identify([first], TRUCK, SLIPPERY, occasion=occasion)
    result.knowledge.save(path)
    return fw.Knowledge.load(path)


@pytest.mark.slow
def test_the_friction_belongs_to_a_named_road_alone(of_road):
    """A weak sine begins with it on the same road, and not on another one."""
    (log,) = of_road.logs
    assert (log.road, log.trailer, log.load) == ("pass", "", "")
    assert FRICTION in log.information.names
    weak = response(0.4, TRUE, name="second", seed=2)
    same, other = (
        fw.identify([weak], TRUCK, SLIPPERY, knowledge=of_road, occasion=fw.Occasion(road=road))
        for road in ("pass", "")
    )
    assert same[FRICTION].sigma < 0.8 * other[FRICTION].sigma
    assert abs(same[FRICTION].value - TRUE) < 3 * same[FRICTION].sigma
    assert FRICTION not in other.knowledge.logs[1].information.names


@pytest.mark.slow
def test_two_trucks_share_the_road_alone(of_road):
    (log,) = of_road.logs
    both = of_road.merged(fw.Knowledge(logs=(replace(log, tractor="lorry", name="lorry", digest="other"),)))
    names = [unknown.name for unknown in both.combined.layout.unknowns]
    assert {name for name in names if names.count(name) == 1} == {FRICTION}
    elsewhere = fw.Knowledge(logs=(replace(log, tractor="lorry", road="valley"),))
    with pytest.raises(fw.SignalError, match="lorry: the first unit of another truck than tractor"):
        of_road.merged(elsewhere)
    with pytest.raises(fw.VehicleError, match="tractor: the knowledge is of a truck whose first unit is lorry"):
        elsewhere.require_same_truck(TRUCK, fw.Occasion(road="pass"))
    elsewhere.require_same_truck(TRUCK, fw.Occasion(road="valley"))
