"""Kalman filter of the grade that whitens the speed and its regressors, and their least squares.

The grade is a random process over the travelled distance: white noise through two poles, the lengths of hills and of
vertical curves. Grade and noise are estimated by maximum a posteriori, the coefficients by generalised least squares
(de Jong 1991, The diffuse Kalman filter).
"""

import casadi as ca
import numpy as np

from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.estimate.filters.kalman import joseph
from fifthwheel.estimate.filters.model import pack, partitioned, unpack

STEP = 0.2
"""Of the filter, s; samples within it are averaged."""
TOLERANCE = {"xatol": 0.02, "fatol": 0.02}
"""Of the logarithms of the noise, and of -2 ln of its density."""
UNKNOWN = 10.0
"""Standard deviation of the speed after a step with unknown force, m/s: nothing is known."""
NOISE_PRIOR = {
    "speed": (0.01, 1.0),  # m/s, white noise of a sample
    "acceleration": (0.01, 1.5),  # m/s^2 sqrt(s), white: gusts, driveline torsion
    "slope": (0.2, 0.7),  # m/s^2, of the slope: a grade of 2 %
    "known slope": (0.03, 0.7),  # m/s^2, of the error of a logged grade
    "hill": (400.0, 0.7),  # m, over which the grade is correlated
    "vertical curve": (50.0, 0.7),  # m, over which its change is correlated
}
"""Median, and standard deviation of the logarithm, of the standard deviations and length that the noise has."""


def noise_prior(*, has_grade: bool) -> tuple[Array, Array]:
    """Means and standard deviations of the logarithms of the noise: speed, acceleration, slope, and its two lengths."""
    keys = ("speed", "acceleration", "known slope" if has_grade else "slope", "hill", "vertical curve")
    medians, sigmas = np.array([NOISE_PRIOR[key] for key in keys]).T
    return np.log(medians), sigmas


def fitted_noise(rows: Array, start: Array, prior: tuple[Array, Array], delay: float) -> Array:
    """The logarithms of the noise with the largest posterior density, from a start; see `least_squares`."""
    from scipy.optimize import minimize  # slow to import

    def cost(noise: Array) -> float:
        return least_squares(rows, noise, delay)[0] + float(np.sum(((noise - prior[0]) / prior[1]) ** 2))

    return np.asarray(minimize(cost, start, method="Nelder-Mead", options=TOLERANCE).x)


def least_squares(rows: Array, noise: Array, delay: float) -> tuple[float, Array, float]:
    """-2 ln likelihood, and the coefficients (k,), with the standard deviation of the first one, that of the force.

    The other coefficients have the prior N(0, 1); `delay` is what the speed has been corrected for, in units of its
    prior.
    """
    speed, acceleration, slope, hill, curve = np.exp(noise)
    moved, distance, *_ = rows.T
    k = rows.shape[1] - 5
    decays = np.exp(-distance[:, None] / [hill, curve])
    bend = slope**2 * (hill + curve) / (hill**2 * curve)  # variance of the change of the slope over the distance
    sample = np.column_stack(
        [
            moved,
            distance,
            decays,
            np.where(moved > 0, acceleration**2 * STEP, UNKNOWN**2),
            bend * (1 - decays[:, 1] ** 2),
            rows[:, 2:],
        ]
    )
    carry = np.zeros(6 + 3 * (k + 1))
    carry[:6] = UNKNOWN**2, 0.0, 0.0, slope**2, bend * hill * curve / (hill + curve), bend
    _, output = _whitening_step(k)(carry, sample, np.array([speed**2]))
    present = rows[:, 3] > 0
    variance, innovations = output[present, 0], output[present, 1:] / np.sqrt(output[present, :1])
    y, X = innovations[:, 0], -innovations[:, 1:]
    prior = np.zeros(k)
    prior[1] = -delay
    stacked, target = np.vstack([X, np.eye(k)[1:]]), np.concatenate([y, prior[1:]])
    Q, R = np.linalg.qr(stacked)
    beta = np.linalg.solve(R, Q.T @ target)
    residuals = target - stacked @ beta
    sigma = float(np.linalg.norm(np.linalg.inv(R)[0]))
    return float(np.sum(np.log(variance)) + residuals @ residuals), beta, sigma


@compiled(Scan)
def _whitening_step(k: int) -> ca.Function:
    """Kalman filter of the speed v, the slope s and its change c over the distance, for v (column 0) and k regressors.

    carry = [P packed, x (3, 1 + k)]; sample = [moved, distance, decays of s and c, variances of v and c, y, weight,
    inputs (1 + k)]; constant = [variance of y]; output = [innovation variance, innovations (1 + k)].
    """
    carry, P, flat = partitioned("carry", 6, 3 * (k + 1))
    sample, moved, distance, decays, q, y, weight, inputs = partitioned("sample", 1, 1, 2, 2, 1, 1, k + 1)
    r = ca.SX.sym("r")
    F = ca.vertcat(ca.horzcat(1, -STEP * moved, 0), ca.horzcat(0, decays[0], distance), ca.horzcat(0, 0, decays[1]))
    covariance = F @ unpack(P, 3) @ F.T + ca.diag(ca.vertcat(q[0], 0, q[1]))
    x = F @ ca.reshape(flat, 3, k + 1) + ca.vertcat(STEP * inputs.T, ca.SX.zeros(2, k + 1))
    row = ca.SX([[1, 0, 0]])
    variance, cross = covariance[0, 0] + r, covariance[:, 0]
    gain = weight * cross / variance
    innovations = ca.horzcat(y, ca.SX.zeros(1, k)) - x[0, :]
    carried = ca.vertcat(pack(joseph(covariance, cross, gain, row, r)), ca.reshape(x + gain @ innovations, -1, 1))
    output = ca.vertcat(variance, innovations.T)
    return ca.Function("gross_mass", [carry, sample, r], [ca.densify(carried), ca.densify(output)], {"cse": True})
