"""A plan's drive tells what it promises, is the shortest that does, and where none does the reason is the true one."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fifthwheel import dynamics
from fifthwheel.errors import SignalError, VehicleError
from fifthwheel.identify import OneStage, Verdict, identify
from fifthwheel.identify.echo import Echo
from fifthwheel.identify.forecast import Forecast
from fifthwheel.identify.manoeuvres import candidates, lateral, to_record
from fifthwheel.identify.outlook import outlook
from fifthwheel.identify.plan import plan
from fifthwheel.identify.proposal import Plan, Proposal
from fifthwheel.identify.search import Planning
from fifthwheel.identify.stage import Log
from fifthwheel.logs import Record
from fifthwheel.logs.noise import article_gyros
from fifthwheel.observe.prepare import locked_but
from fifthwheel.simulate import response
from fifthwheel.vehicle import Vehicle

GYROS = article_gyros(["tractor", "semitrailer"])
EXACT = OneStage(priors={}, consider={}, nuisances=False)
INERTIA, HEIGHT = "semitrailer.yaw_inertia", "semitrailer.payload.height"
QUICK = Planning(speeds=(80 / 3.6,), frequencies=(0.4,))


@pytest.fixture(scope="module")
def steered(truck) -> Vehicle:
    """The truck whose front axle only steers."""
    return locked_but(truck, ["steer.tractor.front"], truck.name)


def driven(planned: Plan, seed: int = 0) -> Record:
    """The log of the drive that is proposed."""
    vehicle, record = planned.vehicle, planned.record()
    model = dynamics.model(vehicle, planned.channels, roll=True)
    inputs = {name: record.signals[name] for name in model.inputs}
    _, seen = response(model, dynamics.all_parameters(vehicle, planned.channels), record.time, inputs)
    seen += np.random.default_rng(seed).normal(size=seen.shape) * np.sqrt([GYROS[name] for name in planned.channels])
    return record.with_signals(dict(zip(planned.channels, seen.T, strict=True)))


def directly(forecast: Forecast, one: Proposal) -> dict[str, float]:
    """Sigmas by the derivatives along the whole drive, as parts of the values."""
    record = to_record(forecast.vehicle, one.speed, one.steer, 100.0, one.kind)
    found = forecast.fit([forecast.drive(Log(name="drive", sections=[record], noise=dict(GYROS)), list(GYROS))])
    values = forecast.vehicle.parameters()
    return {name: found.sigma(name) * forecast.prior(name) / values[name] for name in forecast.sought}


@pytest.mark.parametrize("number", range(4))
def test_what_a_pulse_says_of_a_drive(steered, number):
    """The convolution gives the same information as the derivatives along the drive itself, at any size."""
    speed, rate, size = 21.0, 100.0, 1.3
    forecast = Forecast(steered, OneStage(), [speed])
    echo = Echo(forecast, speed, rate=rate, noise=GYROS)
    manoeuvre = candidates(speed, (0.4,))[number]
    steer, period = manoeuvre.steer(steered, rate), round(manoeuvre.period * rate)
    for count, share in enumerate(echo.of(steer, period, 3), 1):
        record = to_record(steered, speed, size * manoeuvre.repeated(steer, count, rate), rate, "drive")
        told = forecast.drive(Log(name="drive", sections=[record], noise=dict(GYROS)), list(GYROS))
        direct, quick = forecast.fit([told]), forecast.judge(echo.names, share.at(size), GYROS)
        for name in forecast.sought:
            assert quick.sigma(name) == pytest.approx(direct.sigma(name), rel=2e-4)
        order = [told.names.index(name) for name in echo.names]
        whole = told.information()[np.ix_(order, order)]
        shown = np.ix_(*2 * [echo.steered & (np.diag(whole) > 0)])
        root = np.sqrt(np.diag(whole[shown]))
        assert np.abs((share.at(size) - whole)[shown] / np.outer(root, root)).max() < 1e-7


@pytest.mark.parametrize("settings", [OneStage(), EXACT], ids=["default", "exact"])
def test_a_fit_of_the_drive_knows_what_was_wanted(truck, settings):
    """Sigma as wanted but for what a log's own noise changes, and the error is one of such a sigma."""
    wanted = 0.03 if settings == OneStage() else 0.002
    found = plan(truck, {INERTIA: wanted}, settings)
    assert found.met
    assert found.best.sigma[INERTIA] <= wanted
    for seed in range(3):
        estimate = identify([driven(found, seed)], truck, settings)[INERTIA]
        assert estimate.verdict is Verdict.CONVERGED
        assert estimate.sigma == pytest.approx(found.best.sigma[INERTIA] * truck.units[1].yaw_inertia, rel=0.25)
        assert abs(estimate.value - truck.units[1].yaw_inertia) < 3.5 * estimate.sigma


def test_no_shorter_drive_would_do(steered):
    """Against every drive that is tried, by the derivatives along the drive itself."""
    wants = {INERTIA: 0.004}
    found = plan(steered, wants, EXACT, planning=QUICK)
    forecast = Forecast(found.vehicle, EXACT, QUICK.speeds)
    assert directly(forecast, found.best) == pytest.approx(dict(found.best.sigma), rel=1e-3)
    checked = 0
    for manoeuvre in candidates(QUICK.speeds[0], QUICK.frequencies):
        steer = manoeuvre.steer(steered, 100.0)
        size = min(
            QUICK.max_acceleration / np.abs(lateral(steered, manoeuvre.speed, steer, 100.0)).max(),
            QUICK.max_steer_rate / np.abs(np.diff(steer)).max() / 100.0,
        )
        shorter = [n for n in QUICK.repetitions if n * manoeuvre.period < found.best.duration - 1e-6]
        for count in shorter[-1:]:  # more of the same tells more here, where nothing is only considered
            whole = size * manoeuvre.repeated(steer, count, 100.0)
            one = replace(found.best, kind=manoeuvre.kind, speed=manoeuvre.speed, steer=whole)
            assert directly(forecast, one)[INERTIA] > wants[INERTIA]
            checked += 1
    assert checked
    assert sorted(one.duration for one in found.alternatives) == [one.duration for one in found.alternatives]
    assert found.best.duration <= found.alternatives[0].duration
    assert len({one.kind for one in (found.best, *found.alternatives)}) == 1 + len(found.alternatives)


@pytest.mark.parametrize("most", [0.7, 2.0])
def test_the_limits_are_kept(steered, most):
    limits = replace(QUICK, max_acceleration=most, max_steer_rate=0.1)
    found = plan(steered, {INERTIA: 0.05}, EXACT, planning=limits)
    for one in (found.best, *found.alternatives):
        assert np.abs(lateral(found.vehicle, one.speed, one.steer, 100.0)).max() <= 1.02 * most
        assert np.abs(np.diff(one.steer)).max() * 100 <= 1.02 * 0.1
        assert len(one.steer) == pytest.approx(100 * one.duration, abs=0.6 * one.repetitions)
        assert one.speed == pytest.approx(80 / 3.6)
    fastest = [np.abs(np.diff(one.steer)).max() * 100 for one in (found.best, *found.alternatives)]
    assert max(fastest) == pytest.approx(0.1, rel=0.02)


def test_of_drives_as_long_the_gentlest_is_taken(steered):
    found = plan(steered, {INERTIA: 0.02}, EXACT, planning=QUICK)
    assert found.best.acceleration == 0.5
    harder = plan(steered, {INERTIA: 0.02}, EXACT, planning=replace(QUICK, accelerations=(1.5,)))
    assert (harder.best.acceleration, harder.best.duration) == (1.5, found.best.duration)
    assert harder.best.sigma[INERTIA] < found.best.sigma[INERTIA]


def test_the_usual_wants_and_what_is_not_usually_sought(truck):
    usual = plan(truck, planning=QUICK)
    assert set(usual.wants.values()) == {0.05}
    assert set(usual.wants) == {p for p in usual.best.sigma if p != HEIGHT}
    assert plan(truck, {"tractor.yaw_inertia": 0.2}, planning=QUICK).best.sigma["tractor.yaw_inertia"] > 0
    held = plan(truck, None, OneStage(held=("tractor.front.cornering_stiffness",)), planning=QUICK)
    assert "tractor.front.cornering_stiffness" not in held.wants


def test_what_is_known_only_roughly_stands_in_the_way(truck):
    """Known exactly it does bring the sigma that is told: a fit's outlook on the same drive agrees."""
    found = plan(truck, {HEIGHT: 0.02}, planning=QUICK)
    (short,) = found.unmet
    assert not found.met
    assert short.sigma == found.best.sigma[HEIGHT] > short.wanted == 0.02
    assert short.remedies[0].known[0] in ("semitrailer.roll_axis_height", "semitrailer.roll_stiffness")
    for remedy in short.remedies:
        then = outlook([driven(found)], truck, OneStage(held=remedy.known))[HEIGHT]
        assert remedy.sigma == pytest.approx(then.sigma / then.value, rel=0.1)
        assert remedy.sigma < 0.9 * short.sigma
    loose = OneStage(priors={"relaxation_length": 0.5})
    stiffness = plan(truck, {"tractor.front.cornering_stiffness": 0.01}, loose, planning=QUICK)
    known = [name for remedy in stiffness.unmet[0].remedies for name in remedy.known]
    assert known
    assert not set(known) & set(stiffness.best.sigma)  # what a fit seeks, nobody can measure


def test_a_missing_channel_stands_in_the_way(truck):
    found = plan(truck, {HEIGHT: 0.3}, planning=QUICK, channels=["articulation.semitrailer", "yaw_rate.tractor"])
    (short,) = found.unmet
    assert short.verdict is Verdict.NOT_IDENTIFIABLE
    assert [remedy.channel for remedy in short.remedies] == ["roll_rate.semitrailer"]
    assert found.alternatives == ()
    assert found.channels == ("yaw_rate.tractor", "articulation.semitrailer")
    more = plan(truck, {HEIGHT: 0.3}, planning=QUICK, channels=[*found.channels, "roll_rate.semitrailer"])
    assert more.met
    assert short.remedies[0].sigma == pytest.approx(more.best.sigma[HEIGHT], rel=0.1)


def test_speeds_at_which_the_truck_is_unstable(truck):
    loose = truck.replace({"tractor.drive.cornering_stiffness": 3.5e5})
    found = plan(loose, {INERTIA: 0.1}, EXACT, planning=replace(QUICK, speeds=(10.0, 30.0)))
    assert found.best.speed == 10.0
    assert found.notes == ("cheng_cebon_2011: unstable at 108 km/h by its file, not tried there.",)
    with pytest.raises(VehicleError, match="unstable at 108 km/h"):
        plan(loose, planning=replace(QUICK, speeds=(30.0,)))


@pytest.mark.parametrize(
    ("wants", "more", "message"),
    [
        ({"semitrailer.yaw_intertia": 0.1}, {}, r"yaw_intertia: no such parameter"),
        ({INERTIA: 0.0}, {}, r"yaw_inertia: expected a wanted sigma above 0"),
        ({INERTIA: 0.1}, {"settings": OneStage(held=(INERTIA,))}, r"yaw_inertia: held and wanted"),
        (None, {"channels": ["yaw_rate.tractor"]}, r"yaw_rate\.semitrailer: not among the channels"),
        (None, {"channels": ["sideslip.tractor"]}, r"sideslip\.tractor: no channel that a fit uses"),
    ],
)
def test_what_cannot_be_planned(truck, wants, more, message):
    with pytest.raises((SignalError, VehicleError), match=message):
        plan(truck, wants, **{"planning": QUICK, **more})


@pytest.mark.parametrize(
    "wrong", [{"speeds": ()}, {"speeds": (2.0,)}, {"max_acceleration": 0.0}, {"repetitions": (0,)}, {"rate": -1.0}]
)
def test_planning_is_checked(wrong):
    with pytest.raises(SignalError, match=f"{next(iter(wrong)).removesuffix('s')}"):
        Planning(**wrong)


def test_json_and_record(truck):
    found = plan(truck, {INERTIA: 0.05}, planning=QUICK)
    told = json.loads(found.to_json(files={}))
    assert told["best"]["sigma"] == dict(found.best.sigma)
    assert told["best"]["max_steer"] == np.abs(found.best.steer).max()
    assert "steer" not in told["best"]
    assert (told["met"], told["unmet"], told["files"]) == (True, [], {})
    record = found.record()
    assert set(record.signals) == {"speed", "steer.tractor.front"}
    assert record.signals["steer.tractor.front"][[0, -1]] == pytest.approx(0, abs=1e-3)
