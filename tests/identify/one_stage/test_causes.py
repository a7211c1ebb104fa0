"""Causes of a contradiction, by fits without a prior: gross errors of a gyro, of the vehicle file and of a trailer."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.dynamics import TIME_SCALE
from fifthwheel.identify.doubts import DoubtKind, PriorTest
from fifthwheel.identify.one_stage import alternatives
from fifthwheel.identify.one_stage.alternatives import LARGE_DISCREPANCY, Causes, likely_causes
from fifthwheel.identify.one_stage.estimator import solve_one_stage
from fifthwheel.identify.one_stage.gauss_newton import Quadratic
from fifthwheel.identify.sensor_errors import estimate_sensor_errors
from fifthwheel.identify.unknowns.unknown import Unknown, UnknownKind
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
    assert likely_causes(solution, solution.linearisation.tests) == Causes()


class _Fit(str):
    """A fit that has converged, by the name of the unknown without a prior."""

    converged = True


@pytest.fixture
def causes(monkeypatch):
    """The causes for chosen statistics of the tests, and gains of the fits without their priors, by name."""

    def likely(statistics, gains, impossible=(), unusual=(), left=None):
        left = left or {}

        started = []

        def fitted(_, test):
            started.append(test.name)
            usual, possible, gain = test.name not in unusual, test.name not in impossible, gains[test.name]
            return alternatives._Alternative(
                test=test, minimum=_Fit(test.name), gain=gain, promise=gain, possible=possible, usual=usual
            )

        monkeypatch.setattr(alternatives, "_base", lambda _: None)
        monkeypatch.setattr(alternatives, "_corrected", lambda *_: "corrected")
        monkeypatch.setattr(alternatives, "_left", lambda minimum: left.get(str(minimum), 0.0))
        monkeypatch.setattr(alternatives, "_unexplained", lambda minimum: left.get(str(minimum), 0.0))
        monkeypatch.setattr(alternatives, "_without_prior", fitted)
        tests = [
            PriorTest(name=name, statistic=s, implied=s, size=abs(s), shifts=np.zeros(1)) for name, s in statistics
        ]
        found = likely_causes(SimpleNamespace(minimum="all"), tests)
        return found.left if found.left is not None else [test.name for test in found.likely], len(started)

    return likely


def test_a_contradiction_is_a_statistic_above_the_limit(causes):
    assert causes([], {}) == ([], 0)
    assert causes([("a", -3.5)], {}) == ([], 0)
    assert causes([("a", -3.501)], {"a": 7.0}) == (["a"], 1)
    assert causes([("a", -3.5)], {}, left={"all": 0.2}) == (0.2, 0)


def test_candidates_have_half_of_the_largest_statistic(causes):
    """At most twelve of them."""
    gains = dict.fromkeys("abcdefghijklmnop", 10.0)
    assert causes([("a", 8.0), ("b", -4.0), ("c", 3.99)], gains) == (["a", "b"], 2)
    assert causes([(name, 8.0) for name in gains], gains) == (list(gains)[:12], 12)


def test_the_likeliest_causes_come_first(causes):
    """Those with 85 % of the largest statistic, of which the decrease of the cost is half the square."""
    statistics = [(name, 8.0) for name in "abcd"]
    least = 0.85**2 * 40.0
    assert causes(statistics, {"a": least - 0.01, "b": 40.0, "c": least + 0.01, "d": 1.0})[0] == ["b", "c"]
    assert causes(statistics, {"a": 1.0, "b": 40.0, "c": least, "d": 41.0}, impossible="d")[0] == ["b", "c"]
    assert causes(statistics[:2], {"a": 1.0, "b": 40.0}, impossible="ab")[0] == ["b"]
    assert causes(statistics[:2], {"a": 39.0, "b": 40.0}, impossible="ab", left={"a": 0.1, "b": 0.2})[0] == 0.1


def test_a_cause_has_to_explain_a_contradiction(causes):
    """One that explains less than an unusual statistic is none; an impossible one has to explain far more."""
    statistics, least = [("a", 4.0), ("b", 3.9)], (0.85 * 3.5) ** 2 / 2
    assert causes(statistics, {"a": 0.01, "b": 6.0}, impossible="b")[0] == []
    assert causes(statistics, {"a": least - 0.01, "b": 4.0})[0] == []
    assert causes(statistics, {"a": least + 0.01, "b": 1.0})[0] == ["a"]
    assert causes(statistics, {"a": 0.01, "b": 4 * least + 0.01}, impossible="b")[0] == ["b"]
    assert causes(statistics, {"a": 0.01, "b": 6.0}, impossible="b", left={"all": 0.3})[0] == 0.3


def test_a_cause_has_to_explain_the_logs(causes):
    """Without one that does, none is named, unless delays that the samples show explain them."""
    statistics, gains = [("a", 8.0), ("b", 7.9)], {"a": 40.0, "b": 39.0}
    assert causes(statistics, gains, left={"a": 0.2})[0] == ["b"]
    assert causes(statistics, gains, left={"a": 0.2, "b": 0.3, "corrected": 0.4})[0] == 0.2
    assert causes(statistics, gains, left={"a": 0.2, "b": 0.3})[0] == ["a", "b"]


def test_a_gross_error_of_a_clock_is_behind_others_that_explain_half_as_much(causes):
    """It remains among the causes if it explains most."""
    statistics = [("clock", 8.0), ("a", 7.0)]
    assert causes(statistics, {"clock": 40.0, "a": 20.1}, unusual=["clock"])[0] == ["a", "clock"]
    assert causes(statistics, {"clock": 40.0, "a": 19.9}, unusual=["clock"])[0] == ["clock", "a"]
    assert causes(statistics, {"clock": 40.0, "a": 14.0}, unusual=["clock"])[0] == ["clock"]
    assert causes(statistics, {"clock": 40.0, "a": 39.0}, unusual=["clock"])[0] == ["a", "clock"]
    assert causes(statistics, {"clock": 20.0, "a": 39.0}, unusual=["clock"])[0] == ["a"]


@pytest.mark.parametrize(
    ("moves", "change", "usual", "possible"),
    [
        ({TIME_SCALE: 1.0}, 0.0199, True, True),
        ({TIME_SCALE: 1.0}, -0.0199, True, True),
        ({TIME_SCALE: 1.0}, 0.0201, False, True),
        ({TIME_SCALE: 1.0}, -0.0201, False, True),
        ({TIME_SCALE: 1.0}, 0.21, False, False),
        ({}, 0.21, True, True),
    ],
)
def test_what_a_fit_without_a_prior_gives(monkeypatch, moves, change, usual, possible):
    """Its gain, the change of the unknown, and whether such an error is possible, and usual of a clock: up to 2 %."""
    fields = {"lower": -1.0, "upper": 1.0, "kind": UnknownKind.UNCERTAIN, "moves": moves}
    unknown, implied, starts = Unknown(name="clock", centre=0.0, scale=1e-3, **fields), change / 1e-3, []
    problem = SimpleNamespace(
        names=("a", "clock", "roll@0.0"),
        unknowns_by_name={"clock": unknown},
        bounds=(np.full(3, -300.0), np.full(3, 300.0)),
        cost=lambda z: abs(z[1] - implied),
        layout=SimpleNamespace(initial_states=[[np.array([2])]]),
    )
    objective = SimpleNamespace(without_prior=lambda name, tail, wider: problem)
    base = SimpleNamespace(objective=objective, z=np.array([1.0, 2.0, 3.0]), model=SimpleNamespace(cost=50.0))

    model = Quadratic(10.0, np.array([2.0, 0.0, 0.0]), np.eye(3))

    def fitted(_, z, iterations):
        assert iterations == 0
        starts.append(z.tolist())
        return SimpleNamespace(objective=problem, z=np.array([5.0, implied, 9.0]), model=model)

    monkeypatch.setattr(alternatives, "_fit", fitted)
    for shift in (implied, -implied):  # the linear test gives the start only if it decreases the cost
        shifts = np.array([0.0, shift, 500.0])
        found = alternatives._without_prior(
            base, PriorTest(name="clock", statistic=8.0, implied=shift, size=8.0, shifts=shifts)
        )
        assert (found.gain, found.promise, found.rank) == (40.0, 42.0, 40.0 if usual else 20.0)
        assert (found.usual, found.possible) == (usual, possible)
        assert found.test.implied == implied
        assert found.test.shifts.tolist() == [4.0, implied - 2.0, 0.0]
    best = [1.0, float(np.clip(2.0 + implied, -300, 300)), 300.0]
    assert starts == [best, [1.0, 2.0, 3.0]]


def test_only_the_better_half_of_the_fits_goes_on(monkeypatch):
    """By what they promise, with those that are about as good as the best one; a fit that has converged takes no more
    steps."""
    steps = []

    def fit(name, gain, converged):
        minimum, promise = SimpleNamespace(converged=converged), {"f": 100.0}.get(name, gain)
        test = PriorTest(name=name, statistic=8.0, implied=8.0, size=8.0, shifts=np.zeros(1))
        return alternatives._Alternative(
            test=test, minimum=minimum, gain=gain, promise=promise, possible=name != "i", usual=True
        )

    def continued(_, alternative, iterations):
        name = alternative.test.name
        steps.append((name, iterations))
        return fit(name, {"e": 80.0}.get(name, alternative.gain), converged=name == "a")

    gains = {"a": 10.0, "b": 60.0, "c": 59.0, "d": 58.0, "e": 57.0, "f": 2.0, "g": 1.0, "i": 90.0}
    monkeypatch.setattr(alternatives, "_without_prior", lambda _, name: fit(name, gains[name], converged=False))
    monkeypatch.setattr(alternatives, "_continued", continued)
    found = alternatives._alternatives(None, list(gains), lambda *_: None)
    first, second, third = alternatives.ITERATIONS
    assert [name for name, n in steps if n == first] == list(gains)
    assert [name for name, n in steps if n == second] == ["e", "b", "c", "d", "f", "i"]
    assert [name for name, n in steps if n == third] == ["e", "b", "c", "d", "f", "i"]
    assert [a.test.name for a in found] == ["e", "b", "c", "d", "f", "i"]


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
    of_causes = [(done, total) for title, done, total in steps if title == "test of assumptions"]
    total = sum(alternatives.ITERATIONS)
    assert of_causes[0] == (0, total)
    assert of_causes[-1] == (total, total)
    assert of_causes == sorted(of_causes)


def test_the_joint_covariance_contains_the_shifts_of_the_causes(found):
    """Of the payload height, which the roll rate determines; its own sigma does not contain the shift."""
    result, _ = found
    height = result["semitrailer.payload.height"]
    stored = math.sqrt(result.covariance.among([height.name]).covariance[0, 0])
    assert height.verdict is fw.Verdict.DOUBTFUL
    assert stored > 1.2 * height.sigma
    others = result.covariance.covariance
    assert np.linalg.eigvalsh(others / np.sqrt(np.outer(np.diag(others), np.diag(others)))).min() > -1e-9


def test_the_file_of_another_truck_is_the_cause(record):
    """No number and no delay is proposed, and the excitation is not to blame."""
    found = run_identification([record], fw.vehicle("auburn_6x4"), SETTINGS)
    conclusion = found.conclusion
    assert conclusion.headline.startswith("The vehicle file or the signal map does not fit")
    assert conclusion.cautions[0].startswith("The vehicle file or the signal map does not fit the logs")
    assert not [caution for caution in conclusion.cautions if "They imply" in caution or "delay" in caution]
    assert {e.verdict for e in found.identification.parameters} == {fw.Verdict.DOUBTFUL}
    (doubt,) = [d for d in found.identification.doubts if d.kind in (DoubtKind.NOISE, DoubtKind.ASSUMPTION)]
    assert (doubt.kind, doubt.causes) == (DoubtKind.NOISE, ())
    assert doubt.statistic > LARGE_DISCREPANCY


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
