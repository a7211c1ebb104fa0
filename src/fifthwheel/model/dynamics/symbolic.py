"""Tools for symbolic expressions: linear solutions, Taylor series in time, derivatives by the chain rule."""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeVar

import casadi as ca
import numpy as np

Expressions = Mapping[str, ca.SX]
"""By name; often numbers are possible, too."""
Matrix = TypeVar("Matrix", ca.SX, ca.MX)
STEP_AHEAD = 0.3
"""Longest step of a prediction, s; a laden truck rolls with a period of 1.2 s or more."""


def solve_positive_definite(M: ca.SX, right: ca.SX) -> ca.SX:
    """M^-1 right by the factorisation L D L' without pivoting, for a symmetric positive definite M."""
    n = M.shape[0]
    L, D = ca.SX.eye(n), [ca.SX(0)] * n
    for j in range(n):
        D[j] = M[j, j] - sum((L[j, k] ** 2 * D[k] for k in range(j)), ca.SX(0))
        for i in range(j + 1, n):
            L[i, j] = (M[i, j] - sum((L[i, k] * L[j, k] * D[k] for k in range(j)), ca.SX(0))) / D[j]
    rows = [right[i, :] for i in range(n)]
    for i in range(n):
        for k in range(i):
            rows[i] = rows[i] - L[i, k] * rows[k]
    rows = [row / D[i] for i, row in enumerate(rows)]
    for i in reversed(range(n)):
        for k in range(i + 1, n):
            rows[i] = rows[i] - L[k, i] * rows[k]
    return ca.vertcat(*rows)


def factorised(M: ca.SX) -> Callable[[ca.SX], ca.SX]:
    """The solution of M w = right as a function of `right`, by the factorisation L U without pivoting."""
    n, L, U = M.shape[0], ca.SX.eye(M.shape[0]), ca.SX(M)
    for j in range(n):
        for i in range(j + 1, n):
            L[i, j] = U[i, j] / U[j, j]
            U[i, j:] -= L[i, j] * U[j, j:]

    def solution(right: ca.SX) -> ca.SX:
        rows = [right[i, :] for i in range(n)]
        for i in range(n):
            rows[i] = rows[i] - sum((L[i, k] * rows[k] for k in range(i)), ca.SX(1, right.shape[1]))
        for i in reversed(range(n)):
            rows[i] = (rows[i] - sum((U[i, k] * rows[k] for k in range(i + 1, n)), ca.SX(1, right.shape[1]))) / U[i, i]
        return ca.vertcat(*rows)

    return solution


def change_ahead(A: ca.SX, slope: ca.SX, horizon: float) -> ca.SX:
    """Row w (1, n), with which y changes by w x' until a horizon, s, for y = slope x and x'' = A x'.

    Steps of about `STEP_AHEAD` by the two-stage singly diagonally implicit method of order 2, which is L-stable, so
    that fast states such as the slip angles of the tyres are damped (R. Alexander, SIAM Journal on Numerical Analysis
    14, 1977). With g = 1 - 1 / sqrt(2) and N = (I - g step A)^-1 a step changes x by step (g N + (1 - g) N^2) x', and
    x' becomes N (I + (1 / g - 1) (N - I)) x'.
    """
    count, g = math.ceil(horizon / STEP_AHEAD - 1e-9), 1 - math.sqrt(0.5)
    step = horizon / count
    solution = factorised((ca.SX.eye(A.shape[0]) - g * step * A).T)

    def twice(row: ca.SX) -> tuple[ca.SX, ca.SX]:
        once = solution(row.T)
        return once.T, solution(once).T

    once, again = twice(slope)
    first = row = step * (g * once + (1 - g) * again)
    for _ in range(count - 1):
        once, again = twice(row)
        row = first + once + (1 / g - 1) * (again - once)
    return row


def taylor(A: ca.SX, x: ca.SX, rate: ca.SX, change: ca.SX, dt: ca.SX, order: int) -> ca.SX:
    """Taylor series of x(dt) (n,) of x' = rate + A (x - x(0)) + change t / dt.

    The rate is x' at the beginning of the step, the change that of x' by the inputs until its end, at constant x.
    """
    term = dt * rate
    total = x + term
    for k in range(2, order + 1):
        term = (dt / k) * (A @ term + (change if k == 2 else 0))  # one division, not one for each state
        total = total + term
    return ca.densify(total)


def transition_matrix(M: Matrix, order: int) -> Matrix:
    """Taylor series of exp(M) (n, n); with M = A dt the derivative of `taylor` with respect to x.

    Paterson and Stockmeyer (1973): I + M + M^2/2 + M^3 (I/3! + M/4! + M^2/5! + M^3 (I/6! + ...)), which needs few
    products of matrices.
    """
    n, kind = M.shape[0], type(M)
    powers = [kind.eye(n), M, M @ M]
    cube = powers[2] @ M
    total = kind(n, n)
    for first in reversed(range(0, order + 1, 3)):
        last = min(first + 2, order)
        terms = sum((powers[k - first] / math.factorial(k) for k in range(first, last + 1)), kind(n, n))
        if last < order:
            # of the highest power a multiple of the identity may be left, which needs no product of matrices
            terms += cube / math.factorial(order) if first + 3 == order else cube @ total
        total = terms
    return ca.densify(total)


class _Variable(NamedTuple):
    """One intermediate variable."""

    symbol: ca.SX  # (m,)
    value: ca.SX  # (m,), of earlier ones
    differential: ca.SX  # (m,): its derivatives at a constant symbol, divided by the matrix, are those of the variable
    matrix: ca.SX | None = None  # (m, m)

    def solve(self, derivative: ca.SX) -> ca.SX:
        """Derivative of the variable from that of the differential (m, k)."""
        return derivative if self.matrix is None else solve_positive_definite(self.matrix, derivative)


class Stages:
    """Intermediate variables, each a column of symbols with a value that depends on earlier ones.

    Where an expression of many variables is one of few intermediate variables, its Jacobian is the product of two small
    Jacobians. That of the whole expression would contain the derivatives of the intermediate ones once for each
    variable (A. Griewank and A. Walther, Evaluating Derivatives, 2008, chapter 9). A variable w that solves M w = f has
    dw = M^-1 (df - dM w), so that the factorisation of M is not differentiated.

    >>> x, stages = ca.SX.sym("x"), Stages()
    >>> square = stages.variable(x**2)
    >>> stages.jacobian(square + ca.sin(square), x)
    SX(((1+cos(sq(x)))*(2.*x)))
    """

    def __init__(self) -> None:
        self._variables: list[_Variable] = []

    def variable(self, value: ca.SX) -> ca.SX:
        """A variable with a value (m,)."""
        return self._add(value, value)

    def held(self, value: ca.SX) -> ca.SX:
        """A variable whose derivatives are neglected."""
        return self._add(value, ca.SX(*value.shape))

    def solved(self, M: ca.SX, right: ca.SX, value: ca.SX) -> ca.SX:
        """A variable w with M w = right, for a symmetric positive definite M (m, m); `value` is the solution."""
        return self._add(value, right, M)

    def _add(self, value: ca.SX, differential: ca.SX, M: ca.SX | None = None) -> ca.SX:
        symbol = ca.SX.sym(f"stage_{len(self._variables)}", value.shape[0])
        differential = differential if M is None else differential - M @ symbol
        self._variables.append(_Variable(symbol, ca.densify(value), differential, M))
        return symbol

    def expanded(self, expression: ca.SX) -> ca.SX:
        """An expression without intermediate variables."""
        for variable in reversed(self._variables):
            expression = ca.substitute(expression, variable.symbol, variable.value)
        return expression

    def jacobian(self, expression: ca.SX, by: ca.SX) -> ca.SX:
        """Derivatives (m, n) of an expression (m,) by symbols (n,), expanded."""
        symbols, derivatives = [by], [ca.SX.eye(by.shape[0])]

        def derivative(of: ca.SX) -> ca.SX:
            edges = np.cumsum([0, *(symbol.shape[0] for symbol in symbols)]).tolist()
            parts = ca.horzsplit(ca.jacobian(of, ca.vertcat(*symbols)), edges)
            return sum((part @ J for part, J in zip(parts, derivatives, strict=True)), ca.SX(of.shape[0], by.shape[0]))

        for variable in self._used(expression):
            derivatives.append(variable.solve(derivative(variable.differential)))
            symbols.append(variable.symbol)
        return self.expanded(derivative(expression))

    def rate(self, by: ca.SX, rates: ca.SX) -> Callable[[ca.SX], ca.SX]:
        """A function from an expression (m,) to its derivative with respect to time (m,), where the symbols `by` (n,)
        change with the rates (n,). The derivatives of the variables become variables."""
        changing, speeds = [by], [rates]

        def of_time(expression: ca.SX) -> ca.SX:
            return ca.jtimes(expression, ca.vertcat(*changing), ca.vertcat(*speeds))

        def rate_of(expression: ca.SX) -> ca.SX:
            for variable in self._used(expression):
                if not any(variable.symbol is symbol for symbol in changing):
                    speeds.append(self.variable(variable.solve(of_time(variable.differential))))
                    changing.append(variable.symbol)
            return of_time(expression)

        return rate_of

    def ahead(self, by: ca.SX, rates: ca.SX) -> Callable[[ca.SX, float], ca.SX]:
        """A function from an expression (1,) and a horizon, s, to the value of the expression then, where the symbols
        `by` (n,) change with the rates (n,).

        Inputs are held, and the motion is linearised. Derivatives of the linearisation are neglected.
        """

        def value(expression: ca.SX, horizon: float) -> ca.SX:
            row = change_ahead(self.jacobian(rates, by), self.jacobian(expression, by), horizon)
            return expression + self.held(ca.densify(row.T)).T @ rates

        return value

    def _used(self, expression: ca.SX) -> list[_Variable]:
        """The variables that an expression depends on, also through others, in order."""
        used: list[_Variable] = []
        for variable in reversed(self._variables):
            if ca.depends_on(ca.vertcat(expression, *[u.differential for u in used]), variable.symbol):
                used.insert(0, variable)
        return used
