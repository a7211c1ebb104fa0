"""Causes of a contradiction, by odds of hypotheses: gross errors of a gyro, of the vehicle file and of a trailer."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

import fifthwheel as fw
from fifthwheel.apps.workflow.runs import run_states
from fifthwheel.estimate.identify.doubts import DoubtKind, PriorTest
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.one_stage import causes
from fifthwheel.estimate.identify.one_stage.causes import LARGE_DISCREPANCY, Causes, likely_causes
from fifthwheel.estimate.identify.one_stage.estimator import solve_one_stage
from fifthwheel.estimate.identify.one_stage.gauss_newton import Quadratic
from fifthwheel.estimate.identify.sensor_errors import estimate_sensor_errors
from fifthwheel.estimate.identify.unknowns.unknown import GrossError
from fifthwheel.results.report.conclusion import conclude_identification

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


@pytest.fixture
def find(monkeypatch):
    """The likely causes for chosen logarithmic odds, by name: of the linear tests, and of the fits."""

    def likely(odds, linear=None, left=None):
        left, linear, steps = left or {}, linear or dict.fromkeys(odds, 0.0), []
        fitted = {
            name: SimpleNamespace(test=SimpleNamespace(name=name), minimum=name, odds=value)
            for name, value in odds.items()
        }
        monkeypatch.setattr(causes, "_base", lambda _: None)
        monkeypatch.setattr(causes, "_corrected", lambda *_: "corrected")
        for unexplained in ("_left", "_unexplained"):
            monkeypatch.setattr(causes, unexplained, lambda minimum: left.get(minimum, 0.0))
        monkeypatch.setattr(causes, "gross_error", lambda unknown: unknown)  # the unknown "usual" has none
        monkeypatch.setattr(causes, "linear_odds", lambda test, _: linear[test.name])
        monkeypatch.setattr(causes, "_fitted", lambda _, test, error, least: fitted[test.name])
        unknowns = {name: None if name == "usual" else name for name in linear}
        solution = SimpleNamespace(minimum="all", problem=SimpleNamespace(unknowns_by_name=unknowns))
        tests = [SimpleNamespace(name=name) for name in linear]
        found = likely_causes(solution, tests, lambda *step: steps.append(step[1:]))
        fits = {total for _, total in steps}.pop() if steps else 0
        assert steps == [(done, fits) for i in range(fits) for done in (i, i + 1)]
        return found.left if found.left is not None else [test.name for test in found.likely], fits

    return likely


def test_which_hypotheses_are_causes(find):
    """Of the ten with the largest odds above exp(-5) by the linear tests those that are more probable than none, within
    a factor of 20 of the largest, the likeliest first; what has no gross error is none. One of them has to explain the
    logs: without one that does, none is named, unless delays that the samples show explain them."""
    assert find({}) == ([], 0)
    assert find({"a": 9.0}, {"a": -5.0}) == ([], 0)
    assert find({"a": 9.0}, {"a": -4.999}) == (["a"], 1)
    assert find({"usual": 9.0}, {"usual": 0.0}) == ([], 0)
    names = "abcdefghijklm"
    linear = {name: 0.1 * i for i, name in enumerate(names)}
    assert find(dict.fromkeys(names, 9.0), linear) == (list(reversed(names))[:10], 10)
    assert find({"a": 0.0, "b": -1.0}) == ([], 2)
    assert find({"a": 1e-9}) == (["a"], 1)
    assert find({"a": 0.0}, left={"all": 0.2}) == (0.2, 1)
    assert find({}, left={"all": 0.2}) == (0.2, 0)
    odds = {"a": 9.01 - math.log(20), "b": 9.0, "c": 8.99 - math.log(20), "d": 8.0}
    assert find(odds)[0] == ["b", "d", "a"]
    odds = {"a": 9.0, "b": 8.0}
    assert find(odds, left={"a": 0.2})[0] == ["b"]
    assert find(odds, left={"a": 0.2, "b": 0.3, "corrected": 0.4})[0] == 0.2
    assert find(odds, left={"a": 0.2, "b": 0.3})[0] == ["a", "b"]


class Linear:
    """y = A p + e with p = scale z, z ~ N(0, factors^2) and e ~ N(0, I), like a `Problem` of two logs."""

    names, bounds = ("a", "b", "c@0", "c@1", "roll@0.0"), (np.full(5, -1e3), np.full(5, 1e3))
    layout = SimpleNamespace(initial_states=[[np.array([4])]])

    def __init__(self, J, y, factors):
        self.J, self.y, self.factors = J, y, factors

    def cost(self, z):
        return float(np.sum((self.y - self.J @ z) ** 2) + np.sum((z / self.factors) ** 2)) / 2

    def expand(self, z):
        precision = np.diag(self.factors**-2.0)
        return Quadratic(self.cost(z), precision @ z - self.J.T @ (self.y - self.J @ z), self.J.T @ self.J + precision)

    def with_gross_error(self, name, factor, largest):
        return Linear(self.J, self.y, np.where([other == name for other in self.names], factor, 1.0))

    def log_evidence(self):
        covariance = np.eye(len(self.y)) + (self.J * self.factors**2) @ self.J.T
        return stats.multivariate_normal(cov=covariance).logpdf(self.y)


@pytest.mark.parametrize("name", ["a", "b", "c@0"])
def test_the_odds_of_a_hypothesis(monkeypatch, name):
    """Exact for a linear model: the ratio of the densities of all data. The estimates are those of the wider prior of
    the number, of which a test of its prior knows little; in one log if each log has its own."""
    monkeypatch.setattr(causes, "TOLERANCE", 1e-9)
    rng = np.random.default_rng(3)
    J = rng.normal(size=(30, 5)) * [0.3, 0.2, 0.3, 0.4, 0.5]
    problem = Linear(J, J @ [6.0, 0.5, 4.0, -3.0, 1.0] + rng.normal(size=30), np.ones(5))
    base = causes._fit(problem, np.zeros(5))
    test = PriorTest(name=name, statistic=4.0, implied=3.0, shifts=rng.normal(size=5))
    found = causes._fitted(base, test, GrossError(5.0, 2.0), least=0.0)
    i, wide = problem.names.index(name), problem.with_gross_error(name, 5.0, 3.0)
    evidence = wide.log_evidence() - problem.log_evidence()
    assert found.odds == pytest.approx(math.log(0.003 * 2.0) + evidence, rel=1e-9)
    z = np.linalg.solve(J.T @ J + np.diag(wide.factors**-2.0), J.T @ problem.y)
    assert found.test.implied == pytest.approx(z[i])
    assert found.test.shifts == pytest.approx(np.where(np.arange(5) < 4, z - base.z, 0.0))


@pytest.mark.slow
def test_a_gyro_that_is_turned_is_named_with_its_angle(truck, record):
    """23 standard deviations of its prior, far beyond the linear test, which understates it. The joint covariance
    contains the shift of the payload height, which the roll rate determines; its own sigma does not. A contradiction
    may leave a sigma above the value; a log still has sensor errors."""
    steps, log = [], turned(record, 0.4)
    result = fw.identify([log], truck, SETTINGS, progress=lambda *step: steps.append(step))
    (doubt,) = [d for d in result.doubts if d.kind is DoubtKind.ASSUMPTION]
    assert doubt.causes[0].name == f"{ROLL2}.misalignment"
    assert abs(doubt.causes[0].changes[f"{ROLL2}.misalignment"]) == pytest.approx(0.4, abs=0.06)
    assert not [d for d in result.doubts if d.kind is DoubtKind.SENSOR]
    of_causes = [(done, total) for title, done, total in steps if title == "test of assumptions"]
    assert of_causes[0][0] == 0
    assert of_causes[-1][0] == of_causes[-1][1] > 0
    height, joint = result["semitrailer.payload.height"], result.covariance
    assert height.verdict is fw.Verdict.DOUBTFUL
    assert math.sqrt(joint.among([height.name]).covariance[0, 0]) > 1.2 * height.sigma
    P = joint.covariance
    assert np.linalg.eigvalsh(P / np.sqrt(np.outer(np.diag(P), np.diag(P)))).min() > -1e-9
    conclusion = run_states([log], result.vehicle, identification=result).conclusion
    assert conclusion.headline == "The identification has estimates that are doubtful: do not rely on these states."
    assert not conclusion.good
    assert conclusion.cautions[0].startswith("Identification: The logs contradict")
    variance = 4.0 * np.diag(P) + 1e12 * (np.array(joint.names) == WIDE)
    known = replace(result, covariance=replace(joint, covariance=np.diag(variance)), surroundings={})
    _, of_log = estimate_sensor_errors(record, truck, known, 0.8)
    assert np.isfinite(of_log.covariance).all()


@pytest.mark.slow
def test_the_file_of_another_truck_is_the_cause(record):
    """No number and no delay is proposed, and the excitation is not to blame."""
    identification = fw.identify([record], fw.vehicle("auburn_6x4"), SETTINGS)
    conclusion = conclude_identification(identification, [record])
    assert conclusion.headline.startswith("The vehicle file or the signal map does not fit")
    assert conclusion.cautions[0].startswith("The vehicle file or the signal map does not fit the logs")
    assert not [caution for caution in conclusion.cautions if "They imply" in caution or "delay" in caution]
    assert {e.verdict for e in identification.parameters} == {fw.Verdict.DOUBTFUL}
    (doubt,) = [d for d in identification.doubts if d.kind in (DoubtKind.NOISE, DoubtKind.ASSUMPTION)]
    assert (doubt.kind, doubt.causes) == (DoubtKind.NOISE, ())
    assert doubt.statistic > LARGE_DISCREPANCY


@pytest.mark.slow
def test_a_validation_log_of_another_trailer_contradicts(truck, record):
    p = truck.parameters()
    lighter = {name: p[name] - 9000.0 for name in ("semitrailer.mass", "semitrailer.payload.mass")}
    other = truck.replace(lighter | {"semitrailer.yaw_inertia": 0.5 * p["semitrailer.yaw_inertia"]})
    log = replace(fw.simulate(other, count=1, seed=4), name="second")
    identification = fw.identify([record], truck, SETTINGS, validate=[log])
    validated = [fw.identify([log], truck, SETTINGS, knowledge=identification.knowledge)]
    conclusion = conclude_identification(identification, [record, log], validated=validated)
    assert "second (validation) contradicts" in conclusion.headline
    assert any(c.startswith("second (validation log) contradicts") for c in conclusion.cautions)
    assert not conclusion.good


def test_a_good_log_has_no_cause(truck, record):
    solution = solve_one_stage([record], *applied(truck, SETTINGS))
    assert likely_causes(solution, solution.linearisation.tests) == Causes()
