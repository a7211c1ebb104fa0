"""Causes of a contradiction, by fits without a prior: gross errors of a gyro, of the vehicle file and of a trailer."""

import math
from dataclasses import replace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.identify.doubts import DoubtKind
from fifthwheel.identify.one_stage.alternatives import likely_causes
from fifthwheel.identify.one_stage.estimator import solve_one_stage
from fifthwheel.identify.sensor_errors import estimate_sensor_errors
from fifthwheel.workflow.identification import run_identification
from fifthwheel.workflow.states import run_states

YAW2, ROLL2, WIDE = "yaw_rate.semitrailer", "roll_rate.semitrailer", "semitrailer.cornering_stiffness"
SETTINGS = fw.OneStage(tyres="linear")


@pytest.fixture(scope="module")
def truck():
    return fw.vehicle("cheng_cebon_2011")


@pytest.fixture(scope="module")
def record(truck):
    return fw.simulate(truck, count=1, seed=3)


def turned(record, angle):
    """The log with the roll rate gyro of the trailer turned by an angle."""
    roll, yaw = record.signals[ROLL2], record.signals[YAW2]
    return record.with_signals({ROLL2: math.cos(angle) * roll + math.sin(angle) * yaw})


def test_a_good_log_has_no_cause_and_needs_no_fit(truck, record, monkeypatch):
    solution = solve_one_stage([record], truck, SETTINGS)
    monkeypatch.setattr("fifthwheel.identify.one_stage.alternatives.minimise", None)
    assert likely_causes(solution, solution.linearisation.tests) == []


@pytest.fixture(scope="module")
def found(truck, record):
    """The identification of a log with a turned gyro, and its progress."""
    steps = []
    result = fw.identify([turned(record, 0.4)], truck, SETTINGS, progress=lambda *step: steps.append(step))
    return result, steps


def test_a_gyro_that_is_turned_is_named_with_its_angle(found):
    """35 standard deviations of its prior, far beyond the linear test, which understates it or names another cause."""
    result, steps = found
    (doubt,) = [d for d in result.doubts if d.kind is DoubtKind.ASSUMPTION]
    assert doubt.causes[0].name == f"{ROLL2}.misalignment"
    assert abs(doubt.causes[0].changes[f"{ROLL2}.misalignment"]) == pytest.approx(0.4, abs=0.06)
    assert not [d for d in result.doubts if d.kind is DoubtKind.SENSOR]
    of_causes = [(done, total) for title, done, total in steps if title == "causes of a contradiction"]
    assert of_causes == [(done, len(of_causes) - 1) for done in range(len(of_causes))]


def test_the_joint_covariance_contains_the_shifts_of_the_causes(found):
    """Of the payload height, which the roll rate determines; its own sigma does not contain the shift."""
    result, _ = found
    height = result["semitrailer.payload.height"]
    stored = math.sqrt(result.covariance.among([height.name]).covariance[0, 0])
    assert height.verdict is fw.Verdict.DOUBTFUL
    assert stored > 1.2 * height.sigma
    others = result.covariance.covariance
    assert np.linalg.eigvalsh(others / np.sqrt(np.outer(np.diag(others), np.diag(others)))).min() > -1e-9


@pytest.mark.parametrize("foreign", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_a_validation_log_of_another_trailer_contradicts(truck, record, foreign):
    p = truck.parameters()
    lighter = {name: p[name] - 9000.0 for name in ("semitrailer.mass", "semitrailer.payload.mass")}
    other = truck.replace(lighter | {"semitrailer.yaw_inertia": 0.5 * p["semitrailer.yaw_inertia"]})
    log = fw.simulate(other if foreign else truck, count=1, seed=4)
    log = fw.Record(time=log.time, signals=log.signals, name="second")
    conclusion = run_identification([record], truck, SETTINGS, validate=[log]).conclusion
    assert ("second (validation) contradicts" in conclusion.headline) == foreign
    assert any(c.startswith("second (validation log) contradicts") for c in conclusion.cautions) == foreign
    assert conclusion.good != foreign


def test_states_of_a_doubtful_identification_say_so(record, found):
    identification, _ = found
    log = turned(record, 0.4)
    conclusion = run_states([log], identification.vehicle, identification=identification).conclusion
    assert conclusion.headline == "The identification has estimates that are doubtful: do not rely on these states."
    assert not conclusion.good
    assert conclusion.cautions[0].startswith("Identification: The logs contradict")


def test_a_log_with_a_truck_that_is_hardly_known_has_sensors(truck, record, found):
    """A contradiction may leave a sigma above the value; a log still has sensor errors."""
    identification, _ = found
    covariance = identification.covariance
    wide = replace(covariance, covariance=4.0 * np.diag(np.diag(covariance.covariance)) + 1e12 * _of(covariance, WIDE))
    _, joint = estimate_sensor_errors(record, truck, known=wide, friction=0.8)
    assert np.isfinite(joint.covariance).all()


def _of(uncertainty, name):
    """1 at the variance of a name, else 0."""
    selected = np.array([other == name for other in uncertainty.names], dtype=float)
    return np.diag(selected)
