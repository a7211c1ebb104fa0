"""Every operation in the emitter's tables against CasADi's interpreter."""

import casadi as ca
import numpy as np
import pytest

from fifthwheel.base.native import Scan, llvm_ir
from tests.base.native.conftest import Array, interpreted, max_difference

UNARY = {
    "neg": ca.OP_NEG,
    "sq": ca.OP_SQ,
    "twice": ca.OP_TWICE,
    "inv": ca.OP_INV,
    "sqrt": ca.OP_SQRT,
    "fabs": ca.OP_FABS,
    "exp": ca.OP_EXP,
    "log": ca.OP_LOG,
    "sin": ca.OP_SIN,
    "cos": ca.OP_COS,
    "atan": ca.OP_ATAN,
    "tanh": ca.OP_TANH,
    "sign": ca.OP_SIGN,
    "not": ca.OP_NOT,
}
BINARY = {
    "add": ca.OP_ADD,
    "sub": ca.OP_SUB,
    "mul": ca.OP_MUL,
    "div": ca.OP_DIV,
    "lt": ca.OP_LT,
    "le": ca.OP_LE,
    "eq": ca.OP_EQ,
    "ne": ca.OP_NE,
    "fmin": ca.OP_FMIN,
    "fmax": ca.OP_FMAX,
    "and": ca.OP_AND,
    "or": ca.OP_OR,
    "if_else_zero": ca.OP_IF_ELSE_ZERO,
}
SPECIAL = [0.0, 1.0, -1.0, 0.5, -3.25, 700.0, 1e-300, -1e300, np.inf, -np.inf, np.nan]


def test_every_operation_of_the_tables_is_tested() -> None:
    tested = {*UNARY.values(), *BINARY.values()}
    assert {*llvm_ir._SINGLE, *llvm_ir._COMPARE, *llvm_ir._INTRINSIC, *llvm_ir._LIBRARY} <= tested


def operations(step: ca.Function) -> set[int]:
    return {step.instruction_id(k) for k in range(step.n_instructions())}


@pytest.mark.parametrize("name", [*UNARY, *BINARY])
def test_one_operation(name: str) -> None:
    """On samples (in the loop) and on constants (before the loop), with ordinary and special numbers."""
    op = UNARY[name] if name in UNARY else BINARY[name]
    carry, sample, constant = ca.SX.sym("carry"), ca.SX.sym("sample", 2), ca.SX.sym("constant", 2)

    def apply(a: ca.SX) -> ca.SX:
        return ca.SX.unary(op, a[0]) if name in UNARY else ca.SX.binary(op, a[0], a[1])

    step = ca.Function(name, [carry, sample, constant], [carry, ca.vertcat(apply(sample), apply(constant))])
    assert op in operations(step)
    pairs = np.array([[a, b] for a in SPECIAL for b in SPECIAL] + [[2.0, 3.0], [0.1, 0.7], [-4.0, -4.0]])
    scan, lanes = Scan(step), Scan(step, 4)
    expected = interpreted(step, np.zeros(1), pairs, pairs[0])[1]
    of_constant = np.array([interpreted(step, np.zeros(1), pairs[:1], pair)[1][0, 1] for pair in pairs])
    assert max_difference(scan(np.zeros(1), pairs, pairs[0])[1], expected) <= 1e-13
    constants = np.array([scan(np.zeros(1), pairs[:1], pair)[1][0, 1] for pair in pairs])
    assert max_difference(constants, of_constant) <= 1e-13
    out = lanes.batch(np.zeros((5, 1)), pairs, np.broadcast_to(pairs[0], (5, 2)))[1]
    for each in out:
        assert max_difference(each, expected) <= 1e-13
    constants = lanes.batch(np.zeros((len(pairs), 1)), pairs[:1], pairs)[1][:, 0, 1]
    assert max_difference(constants, of_constant) <= 1e-13


def random_step(rng: np.random.Generator) -> ca.Function:
    """Sixty random operations on two carries, three samples and two constants, every value of order one."""
    carry, sample, constant = ca.SX.sym("carry", 2), ca.SX.sym("sample", 3), ca.SX.sym("constant", 2)
    pool = [*ca.vertsplit(carry), *ca.vertsplit(sample), *ca.vertsplit(constant), ca.SX(0.3), ca.SX(-1.7)]
    bounded = {
        ca.OP_INV: lambda a: 1.5 + ca.sin(a),
        ca.OP_SQRT: ca.fabs,
        ca.OP_EXP: ca.sin,
        ca.OP_LOG: lambda a: 0.2 + ca.fabs(a),
    }
    choices = [*UNARY.values(), *BINARY.values()]
    for _ in range(60):
        op = choices[rng.integers(len(choices))]
        a, b = (pool[i] for i in rng.integers(len(pool), size=2))
        if op in UNARY.values():
            value = ca.SX.unary(op, bounded.get(op, lambda a: a)(a))
        else:
            value = ca.SX.binary(op, a, 1.5 + ca.cos(b) if op == ca.OP_DIV else b)
        pool.append(value if op in llvm_ir._COMPARE else ca.fmax(ca.fmin(value, 9.0 + rng.random()), -9.0))
    branch = ca.if_else(pool[-2] > pool[1], ca.sin(pool[-3]), 0.1 * pool[1])
    results = [ca.vertcat(ca.cos(pool[-1]) * 0.5 * pool[0], branch), ca.vertcat(*pool[7:])]
    return ca.Function("random", [carry, sample, constant], results, {"cse": bool(rng.integers(2))})


SEEDS = range(6)


@pytest.mark.parametrize("seed", SEEDS)
def test_random_steps(seed: int) -> None:
    """One vehicle, and several vehicles in 1, 4 or 8 lanes; the number of lanes does not divide that of vehicles."""
    rng = np.random.default_rng(seed)
    step = random_step(rng)
    vehicles, rows = 9, 25
    carry, sample, constant = (rng.normal(size=(vehicles, *size)) for size in ((2,), (rows, 3), (2,)))
    expected = [interpreted(step, *each) for each in zip(carry, sample, constant, strict=True)]
    assert_same(Scan(step)(carry[3], sample[3], constant[3]), expected[3])
    assert_same(
        Scan(step, (1, 4, 8)[seed % 3]).batch(carry.copy(), sample, constant),
        (np.array([e[0] for e in expected]), np.array([e[1] for e in expected])),
    )


def assert_same(actual: tuple[Array, Array], expected: tuple[Array, Array]) -> None:
    for a, b in zip(actual, expected, strict=True):
        assert a.shape == b.shape
        assert max_difference(a, b) <= 1e-13


@pytest.mark.parametrize("function", [ca.tan, ca.floor, lambda x: ca.atan2(x, 2)])
def test_unknown_operation_is_refused(function: object) -> None:
    carry, sample, constant = (ca.SX.sym(name) for name in ("carry", "sample", "constant"))
    step = ca.Function("unknown", [carry, sample, constant], [carry, function(sample)])  # type: ignore[operator]
    for run in (
        lambda: Scan(step)(np.zeros(1), np.zeros((2, 1)), np.zeros(1)),
        lambda: Scan(step).batch(np.zeros((2, 1)), np.zeros((2, 1)), np.zeros((2, 1))),
    ):
        with pytest.raises(NotImplementedError, match=r"unknown: CasADi operation OP_[A-Z0-9]+"):
            run()
