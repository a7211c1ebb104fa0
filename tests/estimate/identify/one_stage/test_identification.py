"""Parts of the result of one stage, for posteriors that are chosen."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fifthwheel.estimate.identify.doubts import PriorTest
from fifthwheel.estimate.identify.one_stage.identification import (
    _doubtful_covariance,
    _variance_budget,
)
from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.estimate.identify.verdict import is_stated

FRONT, REAR, AXIS = "tractor.front.cornering_stiffness", "semitrailer.cornering_stiffness", "tractor.roll_axis_height"
HEIGHT, OFFSET, COG = "semitrailer.payload.height", "yaw_rate.tractor.offset", "semitrailer.cog"


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


def test_what_a_user_has_stated() -> None:
    """A payload height or a position in the vehicle that is not assumed by its class."""
    for name, stated, assumed, expected in (
        (HEIGHT, (HEIGHT,), (), True),
        (HEIGHT, (HEIGHT,), (HEIGHT,), False),
        (HEIGHT, (), (), False),
        (COG, (COG,), (), True),
        (FRONT, (FRONT,), (), False),
    ):
        assert is_stated(SimpleNamespace(stated=stated, assumed=assumed), name) == expected
