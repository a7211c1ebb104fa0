"""Score tests against joint estimates of a small linear problem, in which a considered unknown is estimated too."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.identify.doubts import ScoreTest, most_likely, score_tests

Array = np.ndarray

NAMES = ("a", "b", "c", "d", "e")
CONSIDERED = ("b", "d", "e")


class Linear:
    """Measurements y = J z + noise of variance 1, with the prior z ~ N(0, I); the considered unknowns are 0."""

    def __init__(self, jacobian: Array, y: Array) -> None:
        self.jacobian, self.y = jacobian, y

    def estimate(self, free: list[int], without_prior: tuple[int, ...] = ()) -> tuple[Array, float]:
        """The most probable z (5,) with some unknowns free, and its cost."""
        prior = np.eye(len(NAMES))
        prior[without_prior, without_prior] = 0.0
        z, J, prior = np.zeros(len(NAMES)), self.jacobian[:, free], prior[np.ix_(free, free)]
        z[free] = np.linalg.solve(prior + J.T @ J, J.T @ self.y)
        residual = self.y - self.jacobian @ z
        return z, float(residual @ residual + z[free] @ prior @ z[free]) / 2

    def tests(self, suspects: tuple[str, ...] = ()) -> list[ScoreTest]:
        free = [i for i, name in enumerate(NAMES) if name not in CONSIDERED]
        z = self.estimate(free)[0]
        gradient = z - self.jacobian.T @ (self.y - self.jacobian @ z)
        return score_tests(NAMES, gradient, self.jacobian.T @ self.jacobian, CONSIDERED, suspects)


def linear(seed: int, z: tuple[float, ...] = (1.0, 0.5, -1.0, 2.0, -0.3), scale: float = 1.0) -> Linear:
    """With correlated columns."""
    rng = np.random.default_rng(seed)
    jacobian = scale * rng.normal(size=(60, 5)) @ (np.eye(5) + 0.4 * rng.normal(size=(5, 5)))
    return Linear(jacobian, jacobian @ np.array(z) + rng.normal(size=60))


@pytest.mark.parametrize("scale", [0.02, 0.2, 2.0], ids=str)
@pytest.mark.parametrize("seed", range(5))
def test_score_test_is_the_joint_estimate(seed: int, scale: float) -> None:
    problem = linear(seed, scale=scale)
    free = [0, 2]
    fixed, cost = problem.estimate(free)
    tests = problem.tests()
    assert sorted(test.name for test in tests) == sorted(CONSIDERED)
    for test in tests:
        i = NAMES.index(test.name)
        joint, _ = problem.estimate(sorted([*free, i]))
        assert test.implied == pytest.approx(joint[i], rel=1e-9)
        assert test.shifts == pytest.approx(joint - fixed, rel=1e-9, abs=1e-12)
        _, smaller = problem.estimate(sorted([*free, i]), without_prior=(i,))
        assert test.statistic**2 / 2 == pytest.approx(cost - smaller, rel=1e-6, abs=1e-9)
        assert np.sign(test.statistic) == np.sign(joint[i])
    assert [abs(t.statistic) for t in tests] == sorted((abs(t.statistic) for t in tests), reverse=True)


def test_statistic_is_normal_if_the_assumption_holds() -> None:
    z = np.random.default_rng(7).normal(size=(2000, 5))
    z[:, [NAMES.index(name) for name in CONSIDERED]] = 0.0
    by_name: dict[str, list[float]] = {name: [] for name in CONSIDERED}
    for seed, truth in enumerate(z):
        for test in linear(seed, tuple(truth)).tests():
            by_name[test.name].append(test.statistic)
    for statistics in by_name.values():
        assert abs(np.mean(statistics)) < 4 / np.sqrt(2000)
        assert np.var(statistics) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 2000))


@pytest.mark.parametrize("suspects", [(), ("e",)], ids=["", "suspect"])
def test_usual_errors_of_all_unknowns_are_seldom_a_doubt(suspects: tuple[str, ...]) -> None:
    """Both parts of the size have at most the variance of N(0, 1), for which 0.3 % is above 3."""
    rng, unusual, tests = np.random.default_rng(8), 0, 0
    for seed in range(2000):
        z = rng.normal(size=len(NAMES))
        z[[NAMES.index(name) for name in suspects]] = 0.0
        problem = linear(seed, tuple(z))
        sizes = [test.size for test in problem.tests(suspects)]
        unusual, tests = unusual + sum(size > 3 for size in sizes), tests + len(sizes)
    assert 0 < unusual / tests < 2 * 0.0027


def test_a_usual_error_of_a_strong_cause_is_no_doubt_about_a_weak_one() -> None:
    """b acts on the measurements as d does, but a tenth as much: the error of d is nearly one of b of ten sigmas."""
    problem = linear(4)
    problem.jacobian[:, 1] = 0.1 * problem.jacobian[:, 3] + 0.02 * problem.jacobian[:, 1]
    problem.y = problem.jacobian @ np.array([0.0, 0.0, 0.0, 1.5, 0.0])
    tests = {test.name: test for test in problem.tests()}
    assert abs(tests["b"].implied) > 5
    assert most_likely(list(tests.values())) == []
    problem.y *= 4
    assert most_likely(problem.tests())[0].name == "d"


def test_without_information_there_is_no_test() -> None:
    """d has no effect on the logs; the effect of e is that of the estimated a, which its prior hardly restricts."""
    problem = linear(1)
    problem.jacobian[:, 3] = 0.0
    problem.jacobian[:, 4] = problem.jacobian[:, 0] = 1e6
    assert [test.name for test in problem.tests()] == ["b"]


@pytest.mark.parametrize("cause", CONSIDERED)
def test_the_true_cause_is_the_most_likely(cause: str) -> None:
    for seed in range(20):
        truth = dict.fromkeys(NAMES, 0.2) | dict.fromkeys(CONSIDERED, 0.0) | {cause: 6.0}
        causes = most_likely(linear(seed, tuple(truth.values())).tests())
        assert causes[0].name == cause
        assert causes[0].implied == pytest.approx(6.0, abs=2.0)


def test_a_small_change_is_not_a_doubt() -> None:
    """It is significant, but its prior explains it."""
    tests = linear(2, (0.0, 0.0, 0.0, 2.0, 0.0)).tests()
    assert abs(tests[0].statistic) > 6
    assert most_likely(tests) == []


@pytest.mark.parametrize("scale", np.geomspace(0.01, 10.0, 7), ids=str)
def test_the_statistic_is_at_least_twice_the_implied_change(scale: float) -> None:
    for seed in range(20):
        for test in linear(seed, scale=scale).tests():
            assert abs(test.statistic) > 2 * abs(test.implied) * (1 - 1e-12)


def test_causes_that_are_as_likely_as_the_first() -> None:
    """At least 85 % of the largest |t| among changes above 3 prior sigmas."""
    first = ScoreTest(name="first", statistic=-10.0, implied=-6.0, size=6.0, shifts=np.zeros(1))
    near = replace(first, name="near", statistic=8.5)
    far = replace(first, name="far", statistic=8.499)
    usual = replace(first, name="usual", statistic=12.0, size=3.0)
    least = replace(first, name="least", statistic=-9.0, size=3.001)
    assert [test.name for test in most_likely([usual, first, least, near, far])] == ["first", "least", "near"]
    assert most_likely([usual]) == []
