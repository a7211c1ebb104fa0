"""Parts of the result of one stage, for posteriors that are chosen."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fifthwheel.estimate.identify.doubts import PriorTest
from fifthwheel.estimate.identify.one_stage.identification import (
    _correlated,
    _doubtful_covariance,
    _implausible,
    _variance_budget,
    _without_number,
)
from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.estimate.identify.verdict import Verdict, is_stated

FRONT, REAR, AXIS = "tractor.front.cornering_stiffness", "semitrailer.cornering_stiffness", "tractor.roll_axis_height"
HEIGHT, OFFSET, COG = "semitrailer.payload.height", "yaw_rate.tractor.offset", "semitrailer.cog"


@pytest.mark.parametrize(
    ("name", "single", "several"),
    [
        (FRONT, FRONT, FRONT),
        (f"{OFFSET}@0", OFFSET, f"{OFFSET}@0"),
        (f"{OFFSET}@12", OFFSET, f"{OFFSET}@12"),
        ("bank.road@1.0", "bank.road", "bank.road"),
    ],
)
def test_the_number_of_a_log_is_shown_if_there_are_several(name: str, single: str, several: str) -> None:
    assert _without_number(name, True) == single
    assert _without_number(name, False) == several


def unknown(name: str, reported: bool = True) -> Unknown:
    return Unknown(name=name, centre=2.0, scale=0.1, lower=1.0, upper=4.0, logarithmic=True, reported=reported)


def test_the_variance_budget_is_what_an_exact_number_would_save() -> None:
    """With every uncertain number, the largest first: against fits without the unknown."""
    rng = np.random.default_rng(1)
    H = np.cov(rng.normal(size=(50, 4)).T) * 3
    names = (FRONT, REAR, AXIS, "mass_scale")
    posterior = ScaledPosterior.from_information(names, H)
    uncertain = [unknown(name, reported=False) for name in names[2:]]
    problem = SimpleNamespace(unknowns=[unknown(FRONT), unknown(REAR), *uncertain])
    budget = _variance_budget(problem, posterior, names[:2])
    for i, name in enumerate(names[:2]):
        expected = {}
        for j in (2, 3):
            kept = [k for k in range(4) if k != j]
            without = np.linalg.inv(np.eye(3) + H[np.ix_(kept, kept)])
            expected[names[j]] = 1 - without[i, i] / posterior.covariance[i, i]
        assert budget[name] == pytest.approx(expected)
        assert list(budget[name].values()) == sorted(budget[name].values(), reverse=True)
    problem.unknowns[3] = replace(problem.unknowns[3], per_log=True)
    assert {tuple(terms) for terms in _variance_budget(problem, posterior, names[:2]).values()} == {(AXIS,)}


@pytest.mark.parametrize(
    ("reported", "deviation", "noted"),
    [
        (False, 11.9, False),  # a factor of 3.29
        (False, -12.1, True),
        (True, -12.1, False),  # has a verdict
    ],
)
def test_an_impossible_uncertain_number_is_noted(reported: bool, deviation: float, noted: bool) -> None:
    problem = SimpleNamespace(names=(AXIS,), unknowns_by_name={AXIS: unknown(AXIS, reported)})
    solution = SimpleNamespace(problem=problem, minimum=SimpleNamespace(z=np.array([deviation])))
    assert [note.partition(":")[0] for note in _implausible(solution)] == [AXIS] * noted


def test_which_unknowns_a_parameter_is_correlated_with() -> None:
    """Without initial states; one that limits it if there is no other reason, and none for a missing roll rate."""
    names = (FRONT, f"{OFFSET}@0", "yaw_rate.tractor", HEIGHT)
    row = np.array([[1.0, 1.0, 0.0, 0.0], [1.0, 0.0, -1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])

    def correlated(
        name: str, verdict: Verdict, rows: np.ndarray, logs: int = 1, excited: float = 0.7
    ) -> tuple[str, ...]:
        solution = SimpleNamespace(
            problem=SimpleNamespace(
                model=SimpleNamespace(states=("yaw_rate.tractor",)), setup=SimpleNamespace(without_roll_rate={HEIGHT})
            ),
            dataset=SimpleNamespace(logs=[None] * logs),
            settings=SimpleNamespace(excited=excited),
        )
        return _correlated(solution, ScaledPosterior.from_information(names, 1e6 * rows.T @ rows), name, verdict)

    assert correlated(FRONT, Verdict.CONVERGED, row[:1]) == (OFFSET,)
    assert correlated(FRONT, Verdict.CONVERGED, row[:1], logs=2) == (f"{OFFSET}@0",)
    assert correlated(FRONT, Verdict.CONVERGED, row[1:2]) == ()
    assert correlated(HEIGHT, Verdict.NOT_IDENTIFIABLE, row) == ()
    weak = np.array([[1.0, 0.3, 0.3, 0.3]])
    assert correlated(FRONT, Verdict.CONVERGED, weak) == ()
    confounded = correlated(FRONT, Verdict.NOT_IDENTIFIABLE, weak)
    assert len(confounded) == 1
    assert confounded[0] != FRONT
    assert correlated(FRONT, Verdict.NOT_IDENTIFIABLE, weak, excited=1e-9) == ()


def test_a_cause_of_a_contradiction_widens_the_covariance() -> None:
    """By the mean square of the shifts of all causes; by the step that the search would still take, and by the prior
    too where nothing explains the logs."""
    covariance, prior = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([1.0, 4.0])
    solution = SimpleNamespace(
        linearisation=SimpleNamespace(posterior=SimpleNamespace(covariance=covariance)),
        problem=SimpleNamespace(prior=SimpleNamespace(variance=prior)),
    )
    shifts = (np.array([1.0, 3.0]), np.array([-1.0, 1.0]))
    causes = [PriorTest(name="a", statistic=5.0, implied=4.0, shifts=shift) for shift in shifts]
    none, step = np.zeros(2), np.array([-1.0, 2.0])
    assert _doubtful_covariance(solution, [], none, explained=True).tolist() == covariance.tolist()
    assert _doubtful_covariance(solution, causes, none, explained=True).tolist() == [[3.0, 1.5], [1.5, 6.0]]
    assert _doubtful_covariance(solution, [], step, explained=True).tolist() == [[3.0, -1.5], [-1.5, 5.0]]
    assert _doubtful_covariance(solution, [], none, explained=False).tolist() == [[3.0, 0.5], [0.5, 5.0]]
    assert covariance.tolist() == [[2.0, 0.5], [0.5, 1.0]]


@pytest.mark.parametrize(
    ("name", "stated", "assumed", "expected"),
    [
        (HEIGHT, (HEIGHT,), (), True),
        (HEIGHT, (HEIGHT,), (HEIGHT,), False),
        (HEIGHT, (), (), False),
        (COG, (COG,), (), True),
        (FRONT, (FRONT,), (), False),
    ],
)
def test_what_a_user_has_stated(name, stated, assumed, expected) -> None:
    """A payload height or a position in the vehicle that is not assumed by its class."""
    vehicle = SimpleNamespace(stated=stated, assumed=assumed)
    assert is_stated(vehicle, name) == expected
