"""`fw.assess`: measures, thresholds, what it refuses."""

import importlib
import json
from dataclasses import replace

import pytest
from scipy.stats import norm

import fifthwheel as fw
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.results.assess import longitudinal, rollover
from fifthwheel.results.assess.assessment import display_unit
from fifthwheel.results.assess.measures import MEASURES, STOP, TRACKING
from tests.results.assess.trucks import ENGINE

pytestmark = pytest.mark.slow

TRUCK = fw.vehicle("cheng_cebon_2011")
EXACT = TRUCK.with_stated(dict.fromkeys(TRUCK.parameters(), 0.0))


@pytest.fixture(scope="module")
def assessment():
    body = {"rear_overhang": "2.7 m", "semitrailer.front_overhang": "1.6 m"}
    return fw.assess(TRUCK, body=body, changes=ENGINE, nonlinear=False)


def test_every_measure_of_the_catalogue_is_there(assessment):
    missing = ("zero_damping_speed", TRACKING, STOP)  # it has none, as a note says; others only if nonlinear
    expected = [name for name in MEASURES if name not in missing]
    assert list(dict.fromkeys(m.name.partition(".")[0] for m in assessment)) == expected
    assert "zero-damping speed: none up to 200 km/h" in assessment.notes
    assert {m.name for m in assessment if m.name.startswith("wheel_lift")} >= {"wheel_lift.semitrailer"}
    (threshold,) = assessment["rearward_amplification_set"].thresholds
    assert threshold.value == pytest.approx(5.7 * assessment["rollover_threshold"].value)
    path = assessment["swept_path"]
    assert [(t.level, t.value, t.confirmed) for t in path.thresholds][1:3] == [("2", 8.7, True), ("3", 10.6, False)]
    assert path.thresholds[2].text("m") == "level 3: ≤ 10.6 m (not confirmed)"
    assert (path.best_threshold().level, replace(path, value=9.0).best_threshold().level) == ("1", "3")
    assert replace(path, thresholds=()).best_threshold() is None
    contents = json.loads(json.dumps(assessment.as_dict()))
    assert contents["measures"][0]["name"] == "rollover_threshold"
    assert contents["uncertain"]["half_track"] == {"name": "Half track", "sigma": 0.03, "unit": "m"}


def test_a_threshold_with_its_probability(assessment):
    measure = assessment["rollover_threshold"]
    (threshold,) = measure.thresholds
    assert (threshold.value, threshold.sense, measure.meets(threshold)) == (0.35, "at least", True)
    high = fw.assess(TRUCK, changes={"semitrailer.payload.height": 3.4}, cheap=True)["rollover_threshold"]
    assert high.value < measure.value
    (threshold,) = high.thresholds
    distance = (high.value - 0.35) / high.sigma
    assert threshold.probability == pytest.approx(norm.cdf(distance), abs=1e-6)


def test_of_an_identification(result):
    assessment = fw.assess(result.identification, cheap=True)
    assert assessment.vehicle == result.identification.vehicle
    assert "joint covariance" in assessment.origin
    of_file = fw.assess(result.identification.vehicle, cheap=True)
    name = "rearward_amplification_peak"  # the logs contain information on the tyres
    assert assessment[name].sigma < of_file[name].sigma


def test_it_does_not_depend_on_a_truck_without_a_solution():
    """Above the critical speed only the measures that do not need a stable truck remain, and a note says so."""
    fast = fw.assess(fw.vehicle("auburn_6x4"), speed=30.0, cheap=True)
    assert "rollover_threshold" in {m.name for m in fast}
    assert any("unstable at 108 km/h" in note for note in fast.notes)
    assert fast.unstable == 1
    with pytest.raises(KeyError, match="rearward_amplification_peak: not a measure"):
        fast["rearward_amplification_peak"]


def only(monkeypatch, *families):
    """Assess only some measures."""
    module = importlib.import_module("fifthwheel.results.assess.assessment")
    monkeypatch.setattr(module, "FAMILIES", families)


def test_what_is_not_stated_is_named(monkeypatch):
    notes = fw.assess(EXACT, nonlinear=False, changes={"driveline.lowest_gear": 11.7}).notes
    body, engine = (note for note in notes if note.startswith("Not assessed"))
    assert body.endswith("state semitrailer.front_overhang, rear_overhang by body")
    assert "startability, gradeability, speed on a grade of 1 % and time for 100 m from rest" in engine
    assert "driveline.launch_torque, driveline.final_drive" in engine
    assert "lowest_gear" not in engine
    only(monkeypatch, longitudinal.measure)
    known = fw.assess(EXACT, nonlinear=False, changes={path: ENGINE[path] for path in list(ENGINE)[3:]})
    assert {"startability"} == {m.name for m in known} & {"startability", "gradeability", "grade_speed"}


def test_the_driveline_brings_its_uncertainty(monkeypatch):
    only(monkeypatch, longitudinal.measure, rollover.measure)
    assessment = fw.assess(EXACT, changes=ENGINE, nonlinear=False)
    assert any("startability" in note and "limited by" in note for note in assessment.notes)
    assert assessment.uncertain["driveline.efficiency"] == 0.01
    assert "driveline.engine_power" not in assessment.uncertain  # exact
    assert "driveline.speed_scale" not in assessment.uncertain  # of a sensor
    sigmas = {"driveline.engine_power": 40e3}
    changed = fw.assess(EXACT, changes=ENGINE, sigmas=sigmas, nonlinear=False)
    assert changed.uncertain["driveline.engine_power"] == 40e3
    assert changed["grade_speed"].sigma > 1.5 * assessment["grade_speed"].sigma
    assert changed["rollover_threshold"].sigma == pytest.approx(assessment["rollover_threshold"].sigma)


def test_a_single_unit():
    fields = TRUCK.model_dump()
    alone = type(TRUCK)(**fields | {"units": fields["units"][:1], "couplings": [], "stated": {}})
    exact = alone.with_stated(dict.fromkeys(alone.parameters(), 0.0))
    names = {m.name for m in fw.assess(exact, nonlinear=False)}
    assert not {"rearward_amplification", "rearward_amplification_set"} & names
    assert {"rollover_threshold", "load_transfer_ratio", "yaw_damping", "swept_path"} <= names


def test_every_number_of_the_table_has_the_unit_of_its_measure(assessment):
    simulated = replace(assessment, measures=tuple(replace(m, nonlinear=m.value) for m in assessment))
    for measure, (_, *numbers, _) in zip(simulated, simulated.table().rows, strict=True):
        unit = display_unit(measure.unit).name
        assert not unit or all(f" {unit}" in text for text in numbers if text), numbers


@pytest.mark.parametrize(
    ("arguments", "error", "message"),
    [
        ({"speed": 88}, SignalError, r"speed: expected 5 to 40 m/s .* got 88 m/s \(316.8 km/h\)"),
        ({"changes": {"semitrailer.payload.hight": 1.8}}, VehicleError, "semitrailer.payload.height"),
        ({"changes": {"driveline.engine_power": 340.0}}, VehicleError, "engine_power: expected 20000 to 2e.06 W"),
        (
            {"changes": ENGINE | {"driveline.launch_speed": 261.8}},
            VehicleError,
            "driveline.launch_speed: expected less than governed_speed, 199 rad/s, got 261.8 rad/s; correct one",
        ),
        ({"body": {"trailer.front_overhang": 1.0}}, VehicleError, "trailer.front_overhang: no such end"),
        ({"body": {"tractor.front_overhang": 1.0}}, VehicleError, "expected front_overhang, that of the whole truck"),
        ({"body": {"semitrailer.front_overhang": 9.0}}, VehicleError, "expected 0 to 6 m, got 9 m"),
    ],
)
def test_wrong_arguments_name_the_key_and_the_cure(arguments, error, message):
    with pytest.raises(error, match=message):
        fw.assess(TRUCK, **arguments)
