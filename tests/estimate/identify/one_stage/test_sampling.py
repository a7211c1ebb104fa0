"""The posterior against samples of it: means, standard deviations and quantiles by a Markov chain.

Proposals are those of Neal (1998), also called pCN, about the Gaussian approximation N(z, P): z' = z_0 + sqrt(1 - b^2)
(z - z_0) + b L w. They are accepted by the ratio of the posterior density and the approximation at both points, so that
the chain has the exact posterior as its stationary distribution, for the noise of the solution.
"""

import numpy as np
import pytest

from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.base.types import Array
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.one_stage.log_posterior import TOLERANCE, LogPosterior, log_posterior
from fifthwheel.model.manoeuvres import lane_changes
from fifthwheel.model.plant import Plant, article_sensors
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
KNOWN = {"semitrailer.rear.self_steering": "exact"}
"""The self-steering of a fixed axle is left out: it has its mode at its bound 0, and its mean above."""


def sampled(density: LogPosterior, steps: int, seed: int, b: float = 0.4) -> tuple[Array, float]:
    """Samples (steps, k) of x, and the fraction of accepted proposals."""
    centre, P = density.mean, density.covariance
    factor, precision, rng = np.linalg.cholesky(P), np.linalg.inv(P), np.random.default_rng(seed)

    def excess(x: Array) -> float:
        return -density(x) - float((x - centre) @ precision @ (x - centre)) / 2

    x, chain, accepted = centre.copy(), np.empty((steps, len(centre))), 0
    current = excess(x)
    for k in range(steps):
        proposed = centre + np.sqrt(1 - b**2) * (x - centre) + b * factor @ rng.normal(size=len(x))
        value = excess(proposed)
        if np.log(rng.uniform()) < current - value:
            x, current, accepted = proposed, value, accepted + 1
        chain[k] = x
    return chain, accepted / steps


@pytest.mark.slow
def test_means_and_sigmas_are_those_of_samples() -> None:
    record = Plant(TRUCK).drive(lane_changes(count=1), rate=50.0).record(article_sensors(TRUCK), seed=1)
    density = log_posterior([record], initial_guess(TRUCK, 1), OneStage(given=KNOWN))
    # The noise of the solution is fixed. A chain may stay in a tail for long, so the median of three counts. The
    # posterior is skew: its mode and its mean differ by up to 0.4 sigma, and medians of other chains by 0.2 sigma.
    chains = [sampled(density, 700, seed)[0][100:] for seed in range(3)]
    mean, sigma = (np.median([moment(chain, axis=0) for chain in chains], axis=0) for moment in (np.mean, np.std))
    for name in (name for name in density.solution.estimated if not name.startswith("road")):
        i = density.names.index(name)
        normal = np.sqrt(density.covariance[i, i])
        assert abs(mean[i] - density.mean[i]) < 0.7 * normal, name
        assert sigma[i] == pytest.approx(normal, rel=0.3), name


@pytest.mark.slow
def test_the_posterior_of_a_result_is_that_of_samples() -> None:
    """Without sensor errors and uncertain numbers, and with the right truck, it is nearly normal. The sigmas of the
    result allow for model error, so they are at least those of the samples."""
    names = ("tractor.front.cornering_stiffness", "semitrailer.cornering_stiffness", "semitrailer.yaw_inertia")
    settings = OneStage(given={"*": "exact", **dict.fromkeys(names, "free")}, tyres="linear")
    arguments = [simulate(TRUCK, count=1, seed=1)], TRUCK, settings
    result, density = identify(*arguments), log_posterior(*arguments)
    chain, accepted = sampled(density, 2000, seed=2, b=0.7)
    assert accepted > 0.5
    posterior = result.posterior.among(names)
    values = density.values(chain[100:])
    draws = np.column_stack([values[name] for name in posterior.names])
    relative = np.sqrt(np.diag(density.covariance))[[density.names.index(name) for name in posterior.names]]
    sigma = relative * np.array([result[name].prior / result[name].initial for name in posterior.names])
    deviations = np.log(draws / posterior.mean) / sigma
    for moment, expected in ((deviations, 0.0), (deviations**2, 1.0)):
        batches = moment[: len(draws) // 20 * 20].reshape(20, -1, len(names)).mean(axis=1)
        error = batches.std(axis=0) / np.sqrt(20)  # of sampling
        assert (error < 0.1).all()
        assert (np.abs(moment.mean(axis=0) - expected) < 1.4 * TOLERANCE + 4 * error).all()  # that of the search, too
    np.testing.assert_allclose(np.quantile(deviations, [0.05, 0.95], axis=0).T, [[-1.645, 1.645]] * 3, atol=0.3)
    np.testing.assert_allclose(np.corrcoef(draws.T), posterior.correlation(), atol=0.15)
    assert (draws.std(axis=0) < 1.1 * posterior.sigma).all()
