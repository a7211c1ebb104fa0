"""Validation: equal records, softer tyres, noise, other inputs, and records that are refused."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.errors import FifthwheelError, SignalError, VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.record import Record
from fifthwheel.results.evaluate import METHODS
from fifthwheel.results.evaluate.curves import curve_names
from fifthwheel.results.evaluate.tolerances import DEFAULTS
from fifthwheel.truck import Vehicle
from tests.results.evaluate.conftest import NOISE, STEER, U
from tests.results.evaluate.test_evaluate import MANOEUVRES, ONE
from tests.results.evaluate.test_steady_state import steady_turns

GYROS = {name: NOISE[name] for name in NOISE if name.startswith("yaw_rate")}
QUIET = {name: 1e-4 * variance for name, variance in NOISE.items()}


NOISES = {"good": NOISE, "gyros": GYROS, "quiet": QUIET}


@cache
def simulated(truck, test, seed=1, noise="good"):
    manoeuvre = MANOEUVRES[test]
    settings = ONE.get(manoeuvre, {}) | {"sensors": NOISES[noise], "seed": seed}
    return fw.simulate(truck, manoeuvre=manoeuvre, speed=U, rate=50.0, **settings)


def softer(truck, *groups):
    """The truck with 10 % less cornering stiffness of some tyres."""
    paths = [f"{group}.cornering_stiffness" for group in groups]
    return Vehicle(**truck.fields_with({path: 0.9 * truck.parameters()[path] for path in paths}))


@pytest.mark.slow
@pytest.mark.parametrize("test", METHODS)
def test_equal_records_are_inside_with_difference_0(truck, test):
    log = simulated(truck, test, noise="quiet")
    found = fw.validate(log, log, test, vehicle=truck)
    assert found.verdict == "inside"
    assert found.measures
    assert found.curves
    assert all(m.results == m.log for m in found.measures)
    assert all((c.inside, c.exceedance, c.covered) == (1.0, 0.0, 1.0) for c in found.curves)
    names = {item.name.partition(".")[0] for item in (*found.log, *found.curves)}
    assert names <= DEFAULTS.keys()
    assert {c.name for c in found.curves} == set(curve_names(found.log))
    assert json.loads(json.dumps(found.as_dict(), allow_nan=False))["verdict"] == "inside"
    assert set(found.plots()) == {c.title for c in found.curves}
    assert "<table" in found._repr_html_()
    assert "Verdict" in str(found)


def test_softer_tyres_are_outside_of_the_gradient_that_they_change(truck):
    results = simulated(softer(truck, "tractor.front"), "steady_state", seed=2)
    found = fw.validate(results, simulated(truck, "steady_state"), "steady_state", vehicle=truck)
    verdicts = {item.name: item.verdict for item in (*found.measures, *found.curves)}
    assert {name for name, verdict in verdicts.items() if verdict == "outside"} == {
        "understeer_gradient",
        "steer_less_ackermann",
    }
    curve = next(c for c in found.curves if c.name == "steer_less_ackermann")
    assert curve.inside < 0.5
    assert curve.exceedance == pytest.approx(np.max(np.abs(curve.results - curve.log) - curve.limit))
    assert found.verdict == "outside"
    soft = softer(truck, "tractor.front", "tractor.drive", "semitrailer")  # hardly changes the difference of the axles
    found = fw.validate(simulated(soft, "steady_state", 2), simulated(truck, "steady_state"), "steady_state")
    assert {m.name: m.verdict for m in found.measures}["sideslip_gradient.tractor"] == "outside"


def test_fraction_inside_and_exceedance_by_hand(truck):
    """The results' steer angle is larger by 0.5 deg/(m/s^2) times the lateral acceleration, up to 1.88 m/s^2."""
    log = steady_turns(truck, "constant speed")
    more = np.radians(0.5) * U * log.signals["yaw_rate.tractor"]
    results = log.with_signals({STEER: log.signals[STEER] + more})
    tolerances = {"steer_less_ackermann": "0.3 deg", "understeer_gradient": "5 deg/g + 10 %"}
    found = fw.validate(results, log, "steady_state", vehicle=truck, tolerances=tolerances)
    (gradient,), (curve,) = found.measures, found.curves
    assert gradient.results - gradient.log == pytest.approx(np.radians(0.5), rel=1e-6)
    assert gradient.limit == pytest.approx(np.radians(5) / STANDARD_GRAVITY + 0.1 * gradient.log, rel=1e-9)
    assert gradient.verdict == "inside"
    assert curve.inside == pytest.approx(np.mean(curve.x < 0.6), abs=0.01)
    assert curve.exceedance == pytest.approx(np.radians(0.5 * curve.x.max() - 0.3), rel=1e-6)
    assert (curve.verdict, found.verdict) == ("outside", "outside")


@pytest.mark.slow
@pytest.mark.parametrize("test", ["steady_state", "step"])
def test_noise_alone_is_not_outside(truck, test):
    log = simulated(truck, test)
    found = fw.validate(simulated(truck, test, 2), log, test, vehicle=truck)
    assert not [item.name for item in (*found.measures, *found.curves) if item.verdict == "outside"]


def test_the_uncertainty_of_the_wheelbase_is_common_to_both(truck):
    log = steady_turns(truck, "constant speed", 1)
    uncertain = truck.with_stated({"tractor.front.position": 0.05})
    exact, wide = (fw.validate(log, log, "steady_state", vehicle=v).measures[0].sigma for v in (truck, uncertain))
    assert exact == wide


@pytest.mark.slow
def test_offsets_of_sensors_do_not_count(truck):
    log = steady_turns(truck, "constant speed")
    shifted = log.with_signals({STEER: log.signals[STEER] + 0.02})
    assert fw.validate(shifted, log, "steady_state", vehicle=truck).verdict == "inside"
    log = simulated(truck, "step", noise="quiet")
    moved = {name: log.signals[name] + 0.02 for name in (STEER, "yaw_rate.tractor")}
    later = replace(log.with_signals(moved), time=log.time + 7.0)
    assert fw.validate(later, log, "step", vehicle=truck).verdict == "inside"


def test_histories_of_other_steer_angles_are_undecided(truck):
    log = simulated(truck, "step", noise="quiet")
    smaller = {name: 0.8 * values for name, values in log.signals.items() if name != "speed"}
    faster = {"speed": log.signals["speed"] + 2.0}
    found = fw.validate(log.with_signals(smaller | faster), log, "step", vehicle=truck)
    verdicts = {c.name: c.verdict for c in found.curves}
    assert verdicts.pop(STEER) == "outside"
    assert set(verdicts.values()) == {"undecided"}
    assert {m.verdict for m in found.measures if m.name.startswith("steady_gain")} == {"inside"}
    assert any(note.startswith("The steer angles differ") for note in found.notes)
    assert any("Mean speeds differ: results 86.4 km/h, log 79.2 km/h" in note for note in found.notes)


def test_results_that_cover_less_than_half_of_a_curve_are_undecided(truck):
    left = steady_turns(truck, "constant speed", offset=0.0)
    signals = {n: np.concatenate([v, v if n == "speed" else -v]) for n, v in left.signals.items()}
    both = Record(time=left.rate**-1 * np.arange(2 * len(left)), signals=signals, name="both")
    found = fw.validate(left.cut(0.0, 30.0), both, "steady_state", vehicle=truck)
    assert found.curves[0].covered == pytest.approx(0.37, abs=0.03)
    assert found.curves[0].verdict == "undecided"


def test_what_only_one_record_has_is_noted(truck):
    log = steady_turns(truck, "constant speed")
    more = log.with_signals({"roll.tractor": 0.03 * U * log.signals["yaw_rate.tractor"]})
    found = fw.validate(log, more, "steady_state", vehicle=truck)
    assert "Not compared, only in the log: roll_gradient.tractor and roll.tractor." in found.notes
    other = log.with_signals({"sideslip.tractor": 0.01 * log.signals["yaw_rate.tractor"]})
    with pytest.raises(SignalError, match="results: no measure of Steady-state circular test in common"):
        fw.validate(other, more, "steady_state")


def test_g_times_the_roll_angle_is_in_the_lateral_accelerations_of_both_or_of_none(truck):
    results = simulated(truck, "step", noise="quiet")
    log = replace(results, signals={n: v for n, v in results.signals.items() if "roll" not in n}, reference={})
    for pair in ((results, log), (log, results)):
        found = fw.validate(*pair, "step", vehicle=truck)
        assert any(m.name.endswith("lateral_acceleration.semitrailer") for m in found.measures)
        assert all(m.results == m.log for m in found.measures)


@pytest.mark.slow
def test_inverted_angles_of_the_results_are_refused(truck):
    test, log = "step", simulated(truck, "step", noise="gyros")
    angles = {name: log.reference[name] for name in ("roll.tractor", "articulation.semitrailer")}
    for (name, angle), measured in zip(angles.items(), (log, log.with_signals(angles)), strict=True):
        inverted = replace(log, reference=log.reference | {name: -0.5 * angle})  # the check of signals leaves it alone
        with pytest.raises(SignalError, match=rf"^{name} of the results: opposite sign of the log; .* sign = -1"):
            fw.validate(inverted, measured, test, vehicle=truck)
    same = replace(log, reference={name: 0.5 * values for name, values in log.reference.items()})
    assert fw.validate(same, log, test, vehicle=truck).verdict in ("inside", "outside", "undecided")


@pytest.mark.slow
def test_wrong_records_and_arguments_are_refused(truck):
    log = simulated(truck, "step")
    bare = Record(time=log.time, signals={n: log.signals[n] for n in ("speed", STEER)}, name="bare")
    degrees = log.with_signals({"yaw_rate.tractor": np.degrees(log.signals["yaw_rate.tractor"])})
    cases = [
        (bare, log, {}, r"results, yaw_rate\.tractor: not in bare; map a column to it"),
        (log, bare, {}, r"log, yaw_rate\.tractor: not in bare"),
        (
            simulated(truck, "pulse"),
            log,
            {},
            "results, .*: no step that lasts at least 3 s, .*; give the log of this test",
        ),
        (degrees, log, {}, r'results, yaw_rate\.tractor: .*degrees; set unit = "deg/s" in signals.toml'),
        (log, log, {"yaw_rat": "5 %"}, "tolerance yaw_rat: nothing with this name is compared; did you mean"),
        (log, log, {"yaw_rate": "5 m"}, "tolerance yaw_rate=5 m: expected rad/s"),
    ]
    for results, measured, tolerances, message in cases:
        with pytest.raises(SignalError, match=message):
            fw.validate(results, measured, "step", vehicle=truck, tolerances=tolerances)
    with pytest.raises(SignalError, match="test: 'steps' is not known"):
        fw.validate(log, log, "steps")
    with pytest.raises(FifthwheelError, match="results: expected a Record, got str"):
        fw.validate("results.csv", log, "step")  # type: ignore[arg-type]
    with pytest.raises(VehicleError, match="vehicle: expected a Vehicle, got str"):
        fw.validate(log, log, "step", vehicle="truck")  # type: ignore[arg-type]
    with pytest.raises(FifthwheelError, match="tolerances: expected a Mapping, got str"):
        fw.validate(log, log, "step", tolerances="5 %")  # type: ignore[arg-type]
