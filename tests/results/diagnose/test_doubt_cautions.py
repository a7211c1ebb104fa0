"""Causes in words: the described change is the one that the implied deviation means."""

import ast
import re
from dataclasses import replace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.formatting import shown
from fifthwheel.base.names import split_log
from fifthwheel.estimate.filters.scaling import symbolic_to_p
from fifthwheel.estimate.identify.doubts import Cause, Evidence
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.unknowns.parameters import one_stage_unknowns, time_base_delays
from fifthwheel.model.dynamics import TIME_SCALE
from fifthwheel.results.diagnose.doubt_cautions import _options, describe_cause
from fifthwheel.truck import unit_of
from tests.model.dynamics.test_steered_axles import with_axle

OUTPUTS = (
    *("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.tractor", "roll_rate.semitrailer"),
    *("lateral_acceleration.tractor", "articulation.semitrailer"),
)
SETTINGS = {
    "linear": fw.OneStage(tyres="linear"),
    "saturating": fw.OneStage(tyres="saturating"),
    "stated": fw.OneStage(
        given={
            "semitrailer.payload.height": "1.8 m",
            "semitrailer.cornering_stiffness": "1.5e6 N/rad +- 5e4 N/rad",
            "steer.tractor.front.gain": "1.2 +- 0.02",
            "yaw_rate.tractor.delay": "30 ms +- 10 ms",
            "yaw_rate.semitrailer.offset": "0.02 rad/s +- 0.004 rad/s",
        },
    ),
}
WIDTHS = {"stated": 0.1}
"""Fraction that the vehicle file states as the standard deviation of each yaw inertia."""


def unknowns(case):
    """The truck, and the unknowns by name."""
    vehicle = fw.vehicle("cheng_cebon_2011")
    inertias = {path: WIDTHS.get(case, 0.0) * x for path, x in vehicle.parameters().items() if "yaw_inertia" in path}
    vehicle, settings = applied(vehicle.with_stated(inertias) if case in WIDTHS else vehicle, SETTINGS[case])
    bases = time_base_delays({"yaw_rate.semitrailer": "trailer"}, "", OUTPUTS, settings)
    return vehicle, {u.name: u for u in (*one_stage_unknowns(vehicle, OUTPUTS, settings), *bases)}


CASES = [(case, name) for case in SETTINGS for name in unknowns(case)[1]]


def number(text):
    """The first number behind the words of a cause with the sign of its direction, and its unit."""
    units = "%|times|ms|deg/s|deg|m/s²|m|1/m|rad/s"
    found = re.search(rf"(?:is|are|of|by|runs|=)(?: up to)? (−?[\d.\u202f]+(?:e[-+]?\d+)?) ?({units})?(.*)", text)
    value = float(found[1].replace("−", "-").replace("\u202f", ""))
    minus = re.search(r"smaller|early|the rear|further from|too fast", found[3])
    return value * (-1 if minus else 1), found[2] or ""


@pytest.mark.parametrize("deviation", [3.0, -0.7])
@pytest.mark.parametrize(("case", "name"), CASES, ids=[f"{case}: {name}" for case, name in CASES])
def test_the_described_change_is_the_implied_one(case, name, deviation):
    """By the transformation that the compiled filters use, and the vehicle with the change."""
    vehicle, found = unknowns(case)
    u, values = found[name], vehicle.parameters()
    evidence = Evidence(names=(), z=np.zeros(0), covariance=np.zeros((0, 0)), unknowns=found, parameters=())
    text = describe_cause(evidence._cause(name, deviation), vehicle)
    assert f"({abs(deviation):.1f} times the assumed uncertainty)" in text or TIME_SCALE in u.moves
    if name.endswith((".softening",)) or (name.endswith("self_steering") and deviation < 0):
        return
    p = float(symbolic_to_p((u.logarithmic,), np.array([deviation]), np.array([u.centre]), np.array([u.scale])))
    given = {path: values[path] for path in u.moves if path in values}
    given = given or (dict.fromkeys(u.moves, 0.0) if u.moves else {name: u.centre})
    changed = {path: x + u.moves[path] * p if u.moves else p for path, x in given.items()}
    size, unit = number(text)
    path = next(iter(given))
    change = changed[path] - given[path]
    if text.partition(f"{unit} ")[2].startswith("its prior value"):
        assert abs(change) > 0.5 * given[path]
        wanted = changed[path] / given[path]
    elif unit == "%":
        reference = 1.0 if TIME_SCALE in u.moves else given[path]
        wanted = 100 * (p if TIME_SCALE in u.moves else change) / reference
    elif unit == "times" or unit in ("deg", "deg/s", "m/s²", "ms"):
        base, _ = split_log(name)
        factor = {"deg": 180 / np.pi, "deg/s": 180 / np.pi, "ms": 1e3}.get(unit, 1.0)
        differs = base.endswith((".play", ".position", ".height"))
        wanted = factor * (change if differs else p)
        if base.endswith(".misalignment"):
            size, wanted = abs(size), abs(wanted)
    elif name.endswith(".axle_positions"):
        wanted = np.sign(change) * max(abs(changed[k] - given[k]) for k in given)
    elif name.endswith("self_steering"):
        wanted = min(p, 1.0)
    else:
        wanted = change
        assert unit in ("m", shown(unit_of(path)).name if path in values else unit)
    assert size == pytest.approx(wanted, rel=0.06, abs=1e-3 if abs(wanted) < 0.1 else 0.0), text


def test_an_uncertain_length_has_the_option_that_estimates_it():
    """Of the wheelbase, rounded up to 10 cm, or of each axle that moves; not of a mass, and not of a gyro."""
    vehicle = fw.vehicle("cheng_cebon_2011")
    distances = {"front": 0.27, "middle": 0.32, "rear": 0.37}
    axles = {f"semitrailer.{axle}.position": d for axle, d in distances.items()}
    cause = Cause(
        name="semitrailer.axle_positions", changes=axles | {"semitrailer.static_load": 9e3}, prior_sigmas=12.0
    )
    options = _options(cause, vehicle)
    assert options == 'given={"semitrailer.wheelbase": "+- 40 cm"}'
    given = ast.literal_eval(options.removeprefix("given="))
    stated, _ = applied(vehicle, fw.OneStage(given=given))
    assert [stated.stated[path] for path in axles] == pytest.approx([0.4, 0.4, 0.4])
    rear = {"semitrailer.rear.position": 0.37}
    assert _options(replace(cause, changes=rear), vehicle) == 'given={"semitrailer.rear.position": "+- 40 cm"}'
    for name, changes in (
        ("semitrailer.mass", {"semitrailer.mass": 2e3}),
        ("x.delay", {"yaw_rate.tractor.delay": 0.1}),
    ):
        assert _options(Cause(name=name, changes=changes, prior_sigmas=5.0), vehicle) == ""


TRUCK, PATH = with_axle({}), "semitrailer.rear.self_steering"


def cause(change: float) -> Cause:
    return Cause(name=PATH, changes={PATH: change}, prior_sigmas=change / 0.015)


def test_an_axle_that_is_not_stated_to_steer_itself():
    text = describe_cause(cause(0.78), TRUCK)
    assert text.startswith("semitrailer.rear steers itself, as a castor axle does: give it self_steering = 0.8 in the")
    assert "self_steering = 1.0 " in describe_cause(cause(1.3), TRUCK)
