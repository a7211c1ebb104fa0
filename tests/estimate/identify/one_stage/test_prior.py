"""The prior of all unknowns: of each by itself, and the information of earlier logs on some together."""

import numpy as np
import pytest

from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.estimate.identify.one_stage.prior import JointPrior, Prior

NAMES = ("a", "b", "c", "d")
C = np.array([[0.3, 0.1], [0.1, 0.2]])
EARLIER = JointPrior(names=("d", "b"), mean=np.array([0.5, -1.0]), covariance=C, widening=np.array([1.0, 2.0]))
TAILS = np.array([np.inf, 3.0, 3.0, np.inf])


def test_gradient_and_hessian_are_those_of_the_cost() -> None:
    prior, z = Prior(NAMES, TAILS, EARLIER), np.array([0.4, 1.0, -2.0, 0.3])
    model, step = prior.expand(z), 1e-5 * np.eye(4)
    gradient = [(prior.cost(z + e) - prior.cost(z - e)) / 2e-5 for e in step]
    np.testing.assert_allclose(model.gradient, gradient, atol=1e-8)
    assert model.hessian[3, 1] == pytest.approx(np.linalg.inv(C)[0, 1])


def test_a_log_gives_an_unknown_another_mean_and_sigma() -> None:
    """Of the cost, its derivatives and the spread; an earlier log replaces both."""
    own, z = {"a": (0.5, 0.2), "c": (-1.0, 3.0), "d": (9.0, 9.0)}, np.array([0.4, 1.0, -2.0, 0.3])
    prior, other = Prior(NAMES, TAILS, EARLIER, own), Prior(NAMES, TAILS, EARLIER)
    assert prior.mean.tolist() == [0.5, -1.0, -1.0, 0.5]
    assert prior.cost(prior.mean) == pytest.approx(0.0)
    np.testing.assert_allclose(prior.expand(prior.mean).hessian[[0, 2], [0, 2]], [25.0, 1 / 9])
    gradient = [(prior.cost(z + e) - prior.cost(z - e)) / 2e-5 for e in 1e-5 * np.eye(4)]
    np.testing.assert_allclose(prior.expand(z).gradient, gradient, atol=1e-6)
    ratio = np.diag(prior.spread(np.eye(4))) / np.diag(other.spread(np.eye(4)))
    np.testing.assert_allclose(ratio, [0.04, 1.0, 9.0, 1.0])


def test_the_posterior_of_earlier_logs_is_that_of_all_logs() -> None:
    """Information H1 and then H2 is that of H1 + H2, also of the widening by model error."""
    rng = np.random.default_rng(1)
    H1, H2 = (m.T @ m for m in rng.normal(size=(2, 6, 4)))
    flat = np.full(4, np.inf)
    first = ScaledPosterior.from_information(NAMES, H1, 3 * H1)
    widening = np.sqrt(np.diag(first.covariance) / np.diag(first.model_covariance))
    earlier = JointPrior(names=NAMES, mean=np.zeros(4), covariance=first.model_covariance, widening=widening)
    prior = Prior(NAMES, flat, earlier)
    then = ScaledPosterior.from_information(NAMES, H2, 3 * H2, precision=prior.expand(np.zeros(4)).hessian, prior=prior)
    both = ScaledPosterior.from_information(NAMES, H1 + H2, 3 * (H1 + H2))
    np.testing.assert_allclose(then.model_covariance, both.model_covariance, rtol=1e-9)
    np.testing.assert_allclose(then.sigma, both.sigma, rtol=0.15)  # the first widening has lost its correlations
    none = ScaledPosterior.from_information(NAMES, 0 * H2, precision=prior.expand(np.zeros(4)).hessian, prior=prior)
    np.testing.assert_allclose(none.sigma, first.sigma, rtol=1e-9)
    np.testing.assert_allclose(none.predictive, 0.0, atol=1e-6)
