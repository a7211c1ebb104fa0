"""Covariances, confusions and verdicts on problems small enough to know."""

import numpy as np
import pytest

from fifthwheel.identify import Verdict
from fifthwheel.identify.posterior import posterior, verdicts

NAMES = ("a", "b", "c")


def information(jacobian: np.ndarray, sigma: float) -> np.ndarray:
    return jacobian.T @ jacobian / sigma**2


@pytest.fixture(scope="module")
def jacobian() -> np.ndarray:
    return np.random.default_rng(0).normal(size=(200, 3))


def test_a_right_model_has_the_inverse_of_its_information(jacobian: np.ndarray) -> None:
    H = information(jacobian, 2.0)
    known = posterior(NAMES, H)
    assert known.covariance == pytest.approx(np.linalg.inv(np.eye(3) + H))
    assert posterior(NAMES, H, H).covariance == pytest.approx(known.covariance)
    assert known.sigma == pytest.approx(np.sqrt(np.diag(known.covariance)))


def test_scores_that_scatter_more_widen_every_sigma(jacobian: np.ndarray) -> None:
    H = 100 * information(jacobian, 1.0)
    usual, wider = posterior(NAMES, H, H), posterior(NAMES, H, 9 * H)
    assert wider.sigma == pytest.approx(3 * usual.sigma, rel=1e-3)
    # less scatter than there should be is luck, not knowledge
    assert posterior(NAMES, H, H / 9).sigma == pytest.approx(usual.sigma)


def test_what_is_considered_moves_the_rest_as_it_would(jacobian: np.ndarray) -> None:
    """Against many draws of data and of the considered unknown, fitted without it."""
    rng, sigma = np.random.default_rng(1), 5.0
    H = information(jacobian, sigma)
    known = posterior(NAMES, H, considered=["c"])
    P = np.linalg.inv(np.eye(2) + H[:2, :2])
    errors = []
    for _ in range(20_000):
        z = rng.normal(size=3)
        gradient = jacobian.T @ (jacobian @ z + sigma * rng.normal(size=len(jacobian))) / sigma**2
        errors.append([*(P @ gradient[:2] - z[:2]), -z[2]])  # c is kept at 0, its prior's mean
    assert known.covariance == pytest.approx(np.cov(np.array(errors).T), abs=0.02)
    assert known.sigma[2] == 1.0
    assert np.linalg.eigvalsh(known.covariance).min() > 0
    assert (known.sigma[:2] > posterior(NAMES, H).sigma[:2]).all()


def test_what_is_confused_with_what() -> None:
    """Only the sum of a and b shows."""
    row = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    known = posterior(NAMES, information(row, 0.01))
    assert known.confused(0) == [1]
    assert known.confused(2) == []
    assert known.worst_companion(1) == 0
    assert known.alone(0) == pytest.approx(0.01, rel=1e-2)
    assert known.sigma[0] == pytest.approx(np.sqrt(0.5), rel=1e-2)
    assert known.held(0, 1) == pytest.approx(0.01, rel=1e-2)
    assert verdicts(known, [0, 2], 0.5) == {0: Verdict.NOT_IDENTIFIABLE, 2: Verdict.CONVERGED}


def test_nothing_moves_and_nothing_shows() -> None:
    assert set(verdicts(posterior(NAMES, np.zeros((3, 3))), [0, 1, 2], 0.7).values()) == {Verdict.NOT_EXCITED}
    seen = posterior(NAMES, np.diag([100.0, 0.0, 0.0]))  # b shows in no channel of a drive that tells of a
    assert verdicts(seen, [0, 1], 0.7) == {0: Verdict.CONVERGED, 1: Verdict.NOT_IDENTIFIABLE}


def test_the_little_that_a_sensors_zero_tells_is_no_excitation() -> None:
    """a times the zero c shows very well, but c itself is not known."""
    H = information(np.array([[1.0, 0.0, 1.0]]), 0.01)
    assert posterior(NAMES, H).alone(0) == pytest.approx(0.01, rel=1e-2)
    assert posterior(NAMES, H, nuisances=[2]).alone(0) == pytest.approx(np.sqrt(0.5), rel=1e-2)
