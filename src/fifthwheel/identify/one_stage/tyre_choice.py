"""The choice between linear tyres and tyres that saturate, by the evidence of the logs.

Tyres that saturate are tried if the lateral acceleration is large or if the residuals of linear tyres show softening
tyres. They are chosen if the logs inform the friction and are more likely with them. The likelihood of a model without
its unknowns z is, by the approximation of Laplace (MacKay 1992),

    -ln p(y) = J(z) + sum ln s + ln det(I + H) / 2

at the minimum z of the cost J, with the standard deviations s of the innovations and the Fisher information H.
"""

import numpy as np

from fifthwheel.identify.one_stage import likelihood
from fifthwheel.identify.one_stage.solution import Solution
from fifthwheel.vehicle.parameters import FRICTION

LEAST_ACCELERATION = 1.5
"""m/s^2; above this lateral acceleration tyres soften by 1 % or more."""
CLEAR_SCORE = 3.0
"""|t| of a softening from which the residuals show it."""
CLEAR_EVIDENCE = 3.0
"""Difference of ln p(y): the logs are 20 times as likely."""


def softening_seen(solution: Solution) -> str | None:
    """Why tyres may saturate, from a solution with linear tyres; None if nothing says so."""
    largest = max(solution.lateral_accelerations, default=0.0)
    if largest > LEAST_ACCELERATION:
        return f"the lateral acceleration reaches {largest:.1f} m/s²"
    scores = [abs(t.statistic) for t in solution.linearisation.tests if t.name.endswith(".softening")]
    if max(scores, default=0.0) > CLEAR_SCORE:
        return f"the residuals of linear tyres show softening tyres ({max(scores):.1f} sigma)"
    return None


def choose(linear: Solution, saturating: Solution, reason: str) -> tuple[Solution, str]:
    """The solution with the law that the logs support, and a note that says why; `reason` is why tyres may saturate."""
    gain = log_evidence(saturating) - log_evidence(linear)
    informed = FRICTION not in saturating.uninformed
    if informed and gain > CLEAR_EVIDENCE:
        return saturating, f"tyres: saturating, because {reason} and ln p of the logs is {gain:.0f} higher."
    why = "does not support saturation" if informed else "does not inform the friction"
    return linear, f"tyres: linear. Although {reason}, the run {why} (ln p {gain:+.0f})."


def log_evidence(solution: Solution) -> float:
    """ln p(y) but for a constant that depends on the number of samples alone."""
    problem, z, limit = solution.problem, solution.minimum.z, solution.settings.outlier
    total = -float(z @ z) / 2
    for i, j in problem.segments():
        for block in problem.blocks(z, i, j, directions="none"):
            present = ~np.isnan(block.error)
            total -= likelihood.loss(block, limit)
            if block.variance_jacobian is None:  # otherwise the loss contains it
                total -= float(np.log(block.variance[present]).sum()) / 2
    return total - float(np.linalg.slogdet(solution.minimum.model.hessian)[1]) / 2
