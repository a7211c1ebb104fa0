"""What an outlook promises is what fits then find, and what it says would help does."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.errors import SignalError, VehicleError
from fifthwheel.identify import OneStage, Verdict, identify
from fifthwheel.identify.forecast import Forecast, together
from fifthwheel.identify.outlook import Looking, Outlook, outlook
from fifthwheel.identify.problem import Problem
from fifthwheel.identify.remedies import AGAIN, LANE_CHANGE
from fifthwheel.identify.stage import Log
from fifthwheel.logs import Record
from fifthwheel.logs.noise import article_gyros
from fifthwheel.observe.prepare import steered_as_logged
from fifthwheel.simulate import simulate

from .conftest import without

EXACT = OneStage(priors={}, consider={}, nuisances=False)
HEIGHT = "semitrailer.payload.height"
FRONT = "tractor.front.cornering_stiffness"
AXIS = "semitrailer.roll_axis_height"


@pytest.fixture(scope="module")
def drive(truck) -> Record:
    return simulate(truck, count=2, seed=4, name="drive")


@pytest.fixture(scope="module")
def found(truck, drive) -> Outlook:
    return outlook([drive], truck)


def sigmas(told: Outlook) -> np.ndarray:
    return np.array([p.sigma for p in told.parameters])


def test_errors_of_fits_scatter_as_told(truck):
    """60 fits of one lane change each against the mean of what three of the logs let expect; 9 % is chance."""
    logs = [simulate(truck, count=1, seed=seed) for seed in range(60)]
    expected = np.mean([sigmas(outlook([log], truck, EXACT)) for log in logs[:3]], axis=0)
    values = truck.parameters()
    errors = [[e.value - values[e.name] for e in identify([log], truck, EXACT).parameters] for log in logs]
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert rms / expected == pytest.approx(1, abs=0.3)


@pytest.mark.parametrize("settings", [OneStage(), EXACT], ids=["default", "exact"])
@pytest.mark.parametrize("quantities", [(), ("roll_rate",)], ids=["all", "no roll rates"])
def test_a_fit_ends_with_what_was_told(truck, drive, quantities, settings):
    """Sigma, verdict and what is confused; the fit has its own idea of the noise, and of where it is."""
    log = without(drive, *quantities)
    before = outlook([log], truck, settings)
    after = identify([log], truck, replace(settings, initial_payload_height=None))
    for told in before.parameters:
        estimate = after[told.name]
        assert (told.verdict, told.unit) == (estimate.verdict, estimate.unit)
        assert told.prior == pytest.approx(estimate.prior)
        assert told.sigma == pytest.approx(estimate.sigma, rel=0.2)
        assert set(told.confused_with[:1]) <= set(estimate.confused_with)


def test_information_is_that_of_the_problem(truck, drive):
    """The sum over channels and pieces, with no weight lost, and nothing from channels that are not there."""
    vehicle = steered_as_logged(truck, drive)
    log = Log(
        name="drive", sections=[drive.cut(0, 7), drive.cut(8, 15)], noise=article_gyros(["tractor", "semitrailer"])
    )
    forecast = Forecast(vehicle, OneStage(), [20.0])
    names, information = together([forecast.drive(log)])
    settings = replace(forecast.settings, outlier=np.inf)
    problem = Problem(forecast.model, vehicle, [log], forecast.unknowns, settings)
    expected = problem.expand(np.zeros(len(problem.names)), directions="all").hessian - np.eye(len(problem.names))
    order = [problem.names.index(name) for name in names]
    assert information == pytest.approx(expected[np.ix_(order, order)], rel=1e-9, abs=1e-9 * np.abs(expected).max())
    silent = names.index("articulation.semitrailer.offset@0")
    assert not information[silent].any()


def test_holding_helps_as_told(truck, drive, found):
    one, two = found[HEIGHT].remedies
    assert (one.known, two.known[0]) == ((AXIS,), AXIS)
    for remedy in (one, two):
        then = outlook([drive], truck, OneStage(held=remedy.known))[HEIGHT]
        assert remedy.sigma == pytest.approx(then.sigma, rel=1e-6)
        assert remedy.sigma < 0.8 * found[HEIGHT].sigma
    loose = OneStage(priors={"relaxation_length": 0.5})
    (stiffness, *_) = outlook([drive], truck, loose)[FRONT].remedies
    then = outlook([drive], truck, replace(loose, held=stiffness.known))[FRONT]
    assert stiffness.sigma == pytest.approx(then.sigma, rel=1e-6)


def test_one_more_lane_change_helps_as_told(truck):
    still = simulate(truck, manoeuvre="straight", duration=20, name="still")
    both = outlook([still, simulate(truck, count=1, seed=8)], truck)
    for told in outlook([still], truck).parameters:
        (remedy,) = told.remedies
        assert (remedy.drive, remedy.known, remedy.channel) == (LANE_CHANGE, (), None)
        assert both[told.name].verdict is Verdict.CONVERGED
        assert remedy.sigma == pytest.approx(both[told.name].sigma, rel=0.05)


def test_the_same_drive_again_helps_as_told(truck):
    """A sweep tells more than a lane change, so that another sweep is what helps most."""
    one, other = (simulate(truck, manoeuvre="sweep", seed=seed, name=str(seed)) for seed in (1, 2))
    both = outlook([one, other], truck, EXACT)
    for told in outlook([one], truck, EXACT, Looking(enough=1e-6)).parameters:
        (again,) = [remedy for remedy in told.remedies if remedy.kind == "drive"]
        assert again.drive == AGAIN
        assert again.sigma == pytest.approx(both[told.name].sigma, rel=0.05)


def test_a_channel_more_helps_as_told(truck, drive, found):
    blind = outlook([without(drive, "roll_rate")], truck)
    told = blind[HEIGHT]
    assert (told.verdict, told.confused_with) == (Verdict.NOT_IDENTIFIABLE, ())
    assert told.sigma == told.prior == 1.0
    (remedy,) = told.remedies
    assert remedy.channel == "roll_rate.semitrailer"
    name = "roll_rate.semitrailer"
    seeing = without(drive, "roll_rate").with_signals({name: drive.signals[name]})
    assert remedy.sigma == pytest.approx(outlook([seeing], truck)[HEIGHT].sigma, rel=0.05)
    others = [p for p in blind.parameters if p.name != HEIGHT]
    assert {p.verdict for p in others} == {Verdict.CONVERGED}


def test_a_straight_drive_tells_nothing(truck):
    """Nor does it without roll rates, where it takes both a lane change and a channel."""
    still = simulate(truck, manoeuvre="straight", duration=20)
    for log in (still, without(still, "roll_rate")):
        told = outlook([log], truck)
        assert {p.verdict for p in told.parameters} == {Verdict.NOT_EXCITED}
        assert sigmas(told) == pytest.approx([p.prior for p in told.parameters])
        assert all(p.confused_with == () for p in told.parameters)
    (remedy,) = told[HEIGHT].remedies
    assert (remedy.drive, remedy.channel) == (LANE_CHANGE, "roll_rate.semitrailer")
    assert remedy.sigma < 0.3


def test_what_an_outlook_dwells_on(truck, drive, found):
    assert [p.name for p in found.parameters if p.remedies] == [
        p.name for p in found.parameters if p.sigma > 0.05 * p.value
    ]
    assert not any(p.remedies for p in outlook([drive], truck, None, Looking(enough=1.0)).parameters)
    assert not any(p.remedies for p in outlook([drive], truck, None, Looking(worth=0.99)).parameters)
    assert len(outlook([drive], truck, None, Looking(most=1))[HEIGHT].remedies) == 1
    for p in found.parameters:
        assert p.alone < p.sigma < p.prior


def test_an_unstable_truck_is_told_so(truck, drive):
    """The start is that of the fit; a truck that no stiffness could hold is refused."""
    loose = truck.replace({"tractor.drive.cornering_stiffness": 3e5})
    told = outlook([drive], loose)
    assert "unstable from 44 km/h" in told.cautions[0]
    assert told["tractor.drive.cornering_stiffness"].value == 3e5
    assert np.isfinite(sigmas(told)).all()
    assert {p.verdict for p in told.parameters} == {Verdict.CONVERGED}
    with pytest.raises(VehicleError, match=r"unstable at 24\.4 m/s, however stiff"):
        outlook([drive], truck.replace({"tractor.drive.cornering_stiffness": 2e4}))


def test_what_is_wrong_with_a_log_is_listed(truck, drive):
    wrong = {"yaw_rate.semitrailer": -drive.signals["yaw_rate.semitrailer"]}
    hole = drive.signals["roll_rate.tractor"].copy()
    hole[300:420] = np.nan
    told = outlook([drive.with_signals({**wrong, "roll_rate.tractor": hole})], truck)
    assert [(log, f.signal, f.severity) for log, f in told.findings] == [
        ("drive", "yaw_rate.semitrailer", "error"),
        ("drive", "roll_rate.tractor", "warning"),
    ]
    assert not any("roll_rate.tractor" in note for note in told.notes)
    with pytest.raises(SignalError, match=r"(?s)speed: at most 0\.0 m/s.*\n.*roll_rate\.tractor: .*missing"):
        outlook([drive.with_signals({"speed": np.zeros(len(drive)), "roll_rate.tractor": hole})], truck)
    with pytest.raises(SignalError, match=r"logs: none given"):
        outlook([], truck)


def test_noise_is_the_logs_own(truck, drive):
    gyros = article_gyros(["tractor", "semitrailer"])
    loud = simulate(truck, count=4, sensors={name: 4 * v for name, v in gyros.items()})
    none = simulate(truck, count=4, sensors=dict.fromkeys(gyros, 0.0))
    noise, floor = outlook([loud], truck).noise["simulated"], outlook([none], truck).noise["simulated"]
    for name, variance in gyros.items():
        assert noise[name] == pytest.approx(4 * variance, rel=0.3)
        assert floor[name] == pytest.approx(variance / 10)
    given = outlook([loud], truck, OneStage(adapt_noise=False, noise={"yaw_rate.tractor": 1e-5})).noise["simulated"]
    assert given == {**gyros, "yaw_rate.tractor": 1e-5}
    empty = drive.with_signals({"roll_rate.tractor": np.full(len(drive), np.nan)})
    assert "roll_rate.tractor" not in outlook([empty], truck).noise["drive"]


def test_what_is_sought_and_held(truck, drive):
    told = outlook([drive], truck, OneStage(free=("tractor.yaw_inertia",), held=(FRONT,)))
    assert [p.name for p in told.parameters] == ["tractor.yaw_inertia"]
    assert any(FRONT in note and "held" in note for note in told.notes)
    apart = outlook([drive], truck, OneStage(uniform_payload=False))
    assert apart["semitrailer.sprung.cog_height"].value == pytest.approx(truck.derived()["semitrailer.cog_height"])
    with pytest.raises(VehicleError, match="nothing is left to seek"):
        outlook([drive], truck, OneStage(free=(FRONT,), held=(FRONT,)))
    with pytest.raises(VehicleError, match="no such parameter"):
        outlook([drive], truck, OneStage(held=("tractor.colour",)))


def test_json(found):
    told = json.loads(found.to_json())
    assert [p["name"] for p in told["parameters"]] == [p.name for p in found.parameters]
    assert told["parameters"][-1]["remedies"][0]["known"] == [AXIS]
    assert told["logs"] == ["drive"]
    with pytest.raises(KeyError):
        found["tractor.mass"]
