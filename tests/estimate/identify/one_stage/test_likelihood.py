"""Loss, gradient and information of a block of residuals, against SciPy and central differences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import special, stats
from scipy.integrate import quad

from fifthwheel.base.types import Array
from fifthwheel.estimate.identify.one_stage.likelihood import (
    ResidualBlock,
    gradient_and_information,
    log_density,
    loss,
    scores,
)

LIMIT = 1.5


def block_at(z: Array, *, varying: bool = True, missing: bool = True) -> ResidualBlock:
    """Residuals and variances (20, 3) that are linear in z (4,)."""
    rng = np.random.default_rng(2)
    jacobian, slopes = rng.normal(size=(20, 3, 4)), 0.1 * rng.normal(size=(20, 3, 4))
    error = rng.normal(size=(20, 3)) * np.where(rng.random((20, 3)) < 0.1, 6.0, 1.0) + jacobian @ z
    variance = rng.uniform(0.5, 2.0, size=(20, 3)) + (slopes @ z if varying else 0.0)
    gaps = rng.random((20, 3)) < 0.2
    return ResidualBlock(
        time=np.arange(20.0),
        error=np.where(gaps & missing, np.nan, error),
        variance=variance,
        jacobian=jacobian,
        variance_jacobian=slopes if varying else None,
        indices=np.array([0, 2, 5, 7]),
    )


@pytest.mark.parametrize("varying", [False, True])
def test_loss_is_that_of_huber(varying: bool) -> None:
    block = block_at(np.zeros(4), varying=varying)
    present = np.isfinite(block.error)
    error, variance = block.error[present], block.variance[present]
    expected = special.huber(LIMIT, error / np.sqrt(variance)).sum() + varying * np.log(variance).sum() / 2
    assert loss(block, LIMIT) == pytest.approx(expected)
    assert (np.abs(error) > LIMIT * np.sqrt(variance)).sum() > 5
    if varying:  # without outliers the logarithm of the likelihood of independent Gaussian residuals
        gaussian = -stats.norm.logpdf(error, scale=np.sqrt(variance)).sum() - present.sum() * np.log(2 * np.pi) / 2
        assert loss(block, 1e9) == pytest.approx(gaussian)


@pytest.mark.parametrize("varying", [False, True])
@pytest.mark.parametrize("limit", [LIMIT, 1e9])
def test_gradient_by_central_differences(varying: bool, limit: float) -> None:
    gradient, _ = gradient_and_information(block_at(np.zeros(4), varying=varying), limit)
    for i, shift in enumerate(1e-6 * np.eye(4)):
        higher, lower = (loss(block_at(s * shift, varying=varying), limit) for s in (1, -1))
        assert gradient[i] == pytest.approx((higher - lower) / 2e-6, rel=1e-6)
    assert scores(block_at(np.zeros(4), varying=varying), limit).sum(axis=0) == pytest.approx(gradient)


def test_information_is_the_covariance_of_the_gradient() -> None:
    """Of Gaussian residuals with these variances, drawn 4000 times."""
    block = block_at(np.zeros(4), missing=False)
    _, information = gradient_and_information(block, 1e9)
    rng, gradients = np.random.default_rng(3), []
    for _ in range(4000):
        drawn = replace(block, error=rng.normal(size=(20, 3)) * np.sqrt(block.variance))
        gradients.append(scores(drawn, 1e9).sum(axis=0))
    scale = np.sqrt(np.diag(information))
    assert np.cov(np.transpose(gradients)) / np.outer(scale, scale) == pytest.approx(
        information / np.outer(scale, scale), abs=0.08
    )


@pytest.mark.parametrize("limit", [0.7, 4.0])
def test_the_density_has_the_integral_one(limit: float) -> None:
    one = replace(block_at(np.zeros(4)), variance=np.full((1, 1), 2.3))
    edge = limit * np.sqrt(2.3)

    def density(e: float) -> float:
        return float(np.exp(log_density(replace(one, error=np.full((1, 1), e)), limit)))

    assert 2 * (quad(density, 0, edge)[0] + quad(density, edge, 60)[0]) == pytest.approx(1, rel=1e-9)
