"""Tools for symbolic expressions: linear solutions, Taylor series in time, derivatives by the chain rule."""

import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, TypeVar

import casadi as ca
import numpy as np

Expressions = Mapping[str, ca.SX]
"""By name; often numbers are possible, too."""
Matrix = TypeVar("Matrix", ca.SX, ca.MX)
ORDER = 9
"""Of the Taylor series of a step: one step per 10 ms up to motorway speeds."""
LARGEST_LAG, LAG_TERMS = 4.0, 18
"""Largest step over the time of a lag, and the terms of its series, with an error below 1e-8 up to it."""
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


class MotionAhead:
    """x after a horizon, s, of x'' = A x'.

    Steps of about `STEP_AHEAD` by the two-stage singly diagonally implicit method of order 2, which is L-stable, so
    that fast states such as the slip angles of the tyres are damped (R. Alexander, SIAM Journal on Numerical Analysis
    14, 1977). With g = 1 - 1 / sqrt(2) and N = (I - g step A)^-1 a step changes x by step (g N + (1 - g) N^2) x', and
    x' becomes N (I + (1 / g - 1) (N - I)) x'.
    """

    def __init__(self, A: ca.SX, horizon: float) -> None:
        self.count, self.g = math.ceil(horizon / STEP_AHEAD - 1e-9), 1 - math.sqrt(0.5)
        self.step = horizon / self.count
        implicit = ca.SX.eye(A.shape[0]) - self.g * self.step * A
        self.solve, self.solve_row = factorised(implicit), factorised(implicit.T)

    def stages(self, rates: ca.SX) -> list[ca.SX]:
        """N x' and N^2 x' of each step, (n,), from x' now."""
        found = list[ca.SX]()
        for _ in range(self.count):
            once = self.solve(rates)
            again = self.solve(once)
            rates = once + (1 / self.g - 1) * (again - once)
            found += [once, again]
        return found

    def change(self, stages: Sequence[ca.SX]) -> ca.SX:
        """The change (n,) of x, from `stages`."""
        once, again = (ca.horzcat(*stages[first::2]) for first in (0, 1))
        return self.step * ca.sum2(self.g * once + (1 - self.g) * again)

    def rows(self, slope: ca.SX) -> tuple[ca.SX, list[ca.SX]]:
        """Row w (n,), with which y = slope x changes by w x'; and those with which dA changes it, after each of the
        `stages`."""
        g, step = self.g, self.step

        def twice(row: ca.SX) -> tuple[ca.SX, ca.SX]:
            once = self.solve_row(row)
            return once, self.solve_row(once)

        once, again = twice(slope.T)
        first = row = step * (g * once + (1 - g) * again)
        late = step * (1 - g) * once
        by_A = [g * step * row, g * step * late]
        for _ in range(self.count - 1):
            once, again = twice(row)
            row = first + once + (1 / g - 1) * (again - once)
            by_A = [g * step * row, g * step * (late + (1 / g - 1) * once), *by_A]
        return ca.densify(row), by_A


def taylor(A: ca.SX, x: ca.SX, rate: ca.SX, change: ca.SX, dt: ca.SX, order: int = ORDER) -> ca.SX:
    """Taylor series of x(dt) (n,) of x' = rate + A (x - x(0)) + change t / dt.

    The rate is x' at the beginning of the step, the change that of x' by the inputs until its end, at constant x.
    """
    term = dt * rate
    total = x + term
    for k in range(2, order + 1):
        term = (dt / k) * (A @ term + (change if k == 2 else 0))  # one division, not one for each state
        total = total + term
    return ca.densify(total)


def exponential_step(
    rate: Callable[[ca.SX, ca.SX], ca.SX], x: ca.SX, decay: ca.SX, before: ca.SX, after: ca.SX, dt: ca.SX
) -> ca.SX:
    """x(dt) (n,) of x' = rate(x, d) with inputs that change linearly from `before` to `after`, to fourth order in dt.

    The lags -decay x, (n,) and 0 or more, are integrated exactly, so that they do not limit the step: S. M. Cox and
    P. C. Matthews, Exponential Time Differencing for Stiff Systems, Journal of Computational Physics 176 (2002),
    equations (26) to (29). Their functions are series, which hold for dt times decay up to `LARGEST_LAG`.
    """

    def weights(z: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """exp(z), phi_1, phi_2 and phi_3 of each z (n,); phi_k(z) = sum of z^j / (j + k)!."""
        third = ca.SX(0.0)
        for j in reversed(range(LAG_TERMS)):
            third = third * z + 1 / math.factorial(j + 3)
        second = third * z + 1 / 2
        first = second * z + 1
        return first * z + 1, first, second, third

    def rest(state: ca.SX, d: ca.SX) -> ca.SX:
        return rate(state, d) + decay * state

    middle = (before + after) / 2
    half, first_of_half, _, _ = weights(-decay * dt / 2)
    whole, first, second, third = weights(-decay * dt)
    weight, start = first_of_half * dt / 2, rest(x, before)
    a = half * x + weight * start
    of_a = rest(a, middle)
    of_b = rest(half * x + weight * of_a, middle)
    of_c = rest(half * a + weight * (2 * of_b - start), after)
    total = (first - 3 * second + 4 * third) * start + (2 * second - 4 * third) * (of_a + of_b)
    return ca.densify(whole * x + dt * (total + (4 * third - second) * of_c))


def transition_matrix(M: Matrix, order: int = ORDER) -> Matrix:
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
    exact: ca.SX  # the same where no derivative is neglected
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
        """A variable whose derivatives are neglected, except in `gradient`."""
        return self._add(value, ca.SX(*value.shape), value)

    def _constant(self, value: ca.SX) -> ca.SX:
        """A variable whose derivatives are neglected."""
        return self._add(value, ca.SX(*value.shape))

    def solved(self, M: ca.SX, right: ca.SX, value: ca.SX) -> ca.SX:
        """A variable w with M w = right, for a symmetric positive definite M (m, m); `value` is the solution."""
        return self._add(value, right, M=M)

    def _add(self, value: ca.SX, differential: ca.SX, exact: ca.SX | None = None, M: ca.SX | None = None) -> ca.SX:
        symbol = ca.SX.sym(f"stage_{len(self._variables)}", value.shape[0])
        differential = differential if M is None else differential - M @ symbol
        exact = differential if exact is None else exact
        self._variables.append(_Variable(symbol, ca.densify(value), differential, exact, M))
        return symbol

    def expanded(self, expression: ca.SX) -> ca.SX:
        """An expression without intermediate variables."""
        symbols, values = [v.symbol for v in self._variables], [v.value for v in self._variables]
        _, (expanded,) = ca.substitute_inplace(symbols, values, [expression], False)
        return expanded

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

    def gradient(self, expression: ca.SX, by: ca.SX) -> ca.SX:
        """Derivatives (n,) of an expression (1,) by symbols (n,), expanded, of which none is neglected.

        In contrast to `jacobian` it goes from the expression to the symbols: the adjoint method, for few expressions of
        many symbols.
        """
        for variable in reversed(self._used(expression, exact=True)):
            adjoint = variable.solve(ca.gradient(expression, variable.symbol))
            expression += self._constant(adjoint).T @ variable.exact
        return self.expanded(ca.gradient(expression, by))

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

    def ahead(self, by: ca.SX, rates: ca.SX, staged: ca.SX | None = None) -> Callable[[ca.SX, float], ca.SX]:
        """A function from an expression (1,) and a horizon, s, to the value of the expression then, where the symbols
        `by` (n,) change with the rates (n,).

        Inputs are held, and the motion is linearised. `jacobian` neglects derivatives of the linearisation; `gradient`
        needs `staged` for them, the rates with variables.
        """

        @functools.cache
        def prediction(horizon: float) -> tuple[MotionAhead, list[Callable[[ca.SX], ca.SX]]]:
            """With derivatives of an expression along the change of `by`, and along each of the stages."""
            ahead = MotionAhead(self.jacobian(rates, by), horizon)
            stages = ahead.stages(rates) if staged is not None else []
            along = [ahead.change(stages), *stages] if stages else []
            return ahead, [self.rate(by, self._constant(each)) for each in along]

        def value(expression: ca.SX, horizon: float) -> ca.SX:
            ahead, along = prediction(horizon)
            row, by_A = ahead.rows(self.jacobian(expression, by))
            rows = [self._constant(each).T for each in (row, *by_A)]
            later = exact = expression + rows[0] @ rates
            if staged is not None:
                exact = expression + along[0](expression) + rows[0] @ staged
                exact += sum(of @ of_rates(staged) for of, of_rates in zip(rows[1:], along[1:], strict=True))
            return self._add(later, later, exact)

        return value

    def _used(self, expression: ca.SX, *, exact: bool = False) -> list[_Variable]:
        """The variables that an expression depends on, also through others, in order."""
        used: list[_Variable] = []
        for variable in reversed(self._variables):
            of_used = [u.exact if exact else u.differential for u in used]
            if ca.depends_on(ca.vertcat(expression, *of_used), variable.symbol):
                used.insert(0, variable)
        return used
