"""Taylor series in time of a linear system."""

import math

import casadi as ca


def taylor(A: ca.SX, x: ca.SX, rate: ca.SX, change: ca.SX, dt: ca.SX, order: int) -> ca.SX:
    """Taylor series of x(dt) of x' = rate + A (x - x(0)) + change t / dt.

    Args:
        A: (n, n).
        x: state at the beginning of the step (n,).
        rate: x' at the beginning of the step (n,).
        change: of x' by the inputs from the beginning to the end of the step (n,), at constant x.
        dt: s.
        order: of the series.
    """
    term = dt * rate
    total = x + term
    for k in range(2, order + 1):
        term = (dt / k) * (A @ term + (change if k == 2 else 0))  # one division, not one for each state
        total = total + term
    return ca.densify(total)


def transition_matrix(A: ca.SX, dt: ca.SX, order: int) -> ca.SX:
    """Taylor series of exp(A dt) (n, n), the derivative of `taylor` with respect to x.

    Paterson and Stockmeyer (1973): I + M + M^2/2 + M^3 (I/3! + M/4! + M^2/5! + M^3 (I/6! + ...)), which needs few
    products of matrices.
    """
    n = A.shape[0]
    M = A * dt
    powers = [ca.SX.eye(n), M, M @ M]
    cube = powers[2] @ M
    total = ca.SX(n, n)
    for first in reversed(range(0, order + 1, 3)):
        last = min(first + 2, order)
        terms = sum((powers[k - first] / math.factorial(k) for k in range(first, last + 1)), ca.SX(n, n))
        total = terms + (cube @ total if last < order else 0)
    return ca.densify(total)
