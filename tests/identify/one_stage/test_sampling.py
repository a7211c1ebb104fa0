"""The posterior against samples of it: means and standard deviations by a Markov chain.

Proposals are those of Neal (1998), also called pCN, about the Gaussian approximation N(z, P): z' = z_0 + sqrt(1 - b^2)
(z - z_0) + b L w. They are accepted by the ratio of the posterior density and the approximation at both points, so that
the chain has the exact posterior as its stationary distribution, for the noise of the solution.
"""

import numpy as np
import pytest

from fifthwheel._types import Array
from fifthwheel.identify import OneStage
from fifthwheel.identify.one_stage.estimator import solve_one_stage
from fifthwheel.identify.one_stage.solution import Solution
from fifthwheel.manoeuvres import lane_changes
from fifthwheel.plant import Plant, article_sensors
from fifthwheel.studies.scenarios import initial_guess
from fifthwheel.vehicle import get

TRUCK = get("cheng_cebon_2011")


def sampled(solution: Solution, steps: int, seed: int, b: float = 0.25) -> tuple[Array, float]:
    """Samples (steps, k) of z, and the fraction of accepted proposals."""
    problem, centre, P = solution.problem, solution.minimum.z, solution.linearisation.posterior.model_covariance
    factor, precision, rng = np.linalg.cholesky(P), np.linalg.inv(P), np.random.default_rng(seed)
    lower, upper = problem.bounds

    def excess(z: Array) -> float:
        inside = ((z >= lower) & (z <= upper)).all()
        return problem.cost(z) - float((z - centre) @ precision @ (z - centre)) / 2 if inside else np.inf

    z, chain, accepted = centre.copy(), np.empty((steps, len(centre))), 0
    current = excess(z)
    for k in range(steps):
        proposed = centre + np.sqrt(1 - b**2) * (z - centre) + b * factor @ rng.normal(size=len(z))
        value = excess(proposed)
        if np.log(rng.uniform()) < current - value:
            z, current, accepted = proposed, value, accepted + 1
        chain[k] = z
    return chain, accepted / steps


@pytest.mark.slow
@pytest.mark.parametrize("tyres", ["linear", "saturating"])
def test_means_and_sigmas_are_those_of_samples(tyres: str) -> None:
    record = Plant(TRUCK).drive(lane_changes(count=1)).record(article_sensors(TRUCK), seed=1)
    # The self-steering of a fixed axle is left out: it has its mode at its bound 0, and its mean above.
    consider = {name: sigma for name, sigma in OneStage().consider.items() if name != "fixed_axles"}
    solution = solve_one_stage([record], initial_guess(TRUCK, 1), OneStage(tyres=tyres, consider=consider))
    # The noise of the solution is fixed. With saturating tyres the posterior is skew: its mode and its mean differ.
    skew = 0.4 if tyres == "linear" else 0.8
    chain, accepted = sampled(solution, 6000, seed=2)
    assert accepted > 0.1
    P = solution.linearisation.posterior.model_covariance
    for name in (name for name in solution.estimated if not name.startswith("road")):
        i = solution.problem.names.index(name)
        sigma = np.sqrt(P[i, i])
        assert abs(chain[500:, i].mean() - solution.minimum.z[i]) < skew * sigma, name
        assert chain[500:, i].std() == pytest.approx(sigma, rel=0.3), name
