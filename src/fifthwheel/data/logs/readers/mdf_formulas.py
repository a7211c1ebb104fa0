"""Formulas in MDF files, without running code: asammdf passes them to numexpr and sympy, which evaluate Python."""

import ast
import operator
import sys
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from asammdf.blocks import v2_v3_blocks, v4_blocks

from fifthwheel.base.types import Array

MAX_LENGTH = 1000
"""Characters of a formula; a longer one is refused."""

_NAMES = ("X", "X1", "P1", "P2", "P3", "P4", "P5", "P6", "INF", "NaN")
_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    name: getattr(np, name)
    for name in (
        *("sin", "cos", "tan", "arcsin", "arccos", "arctan", "arctan2", "sinh", "cosh", "tanh"),
        *("arcsinh", "arccosh", "arctanh", "exp", "expm1", "log", "log10", "log1p", "sqrt", "abs"),
    )
} | {"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": np.arctan2, "pow": np.power}


def evaluate(formula: str, variables: Mapping[str, Any]) -> Array:
    """Value of a formula such as "3*X1+sin(X1)": numbers, + - * / **, brackets, elementary functions, and the variables
    X, X1, P1 to P6, INF and NaN.

    A ValueError for anything else in the formula, or more than `MAX_LENGTH` characters.
    """
    if len(formula) > MAX_LENGTH:
        raise ValueError(f"a formula of {len(formula)} characters; at most {MAX_LENGTH} are supported")
    try:
        tree = ast.parse(formula.strip(), mode="eval")
        with np.errstate(all="ignore"):  # a value outside of a function's domain is NaN
            return np.asarray(_value(tree.body, variables), dtype=np.float64)
    except (SyntaxError, TypeError, ValueError, LookupError, RecursionError, MemoryError, OverflowError):
        raise ValueError(f"the formula {formula[:60]!r} is not supported") from None


def _value(node: ast.AST, variables: Mapping[str, Any]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return np.float64(number)
        case ast.Name(id=name) if name in _NAMES:
            return np.asarray(variables[name], dtype=np.float64)
        case ast.BinOp(left=left, op=sign, right=right):
            return _OPERATORS[type(sign)](_value(left, variables), _value(right, variables))
        case ast.UnaryOp(op=sign, operand=operand):
            return _OPERATORS[type(sign)](_value(operand, variables))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return _FUNCTIONS[name](*(_value(argument, variables) for argument in arguments))
    raise ValueError


def replace_evaluation() -> None:
    """Let asammdf evaluate formulas by `evaluate` only; an unsupported one is an error, not a raw value."""

    def evaluate_locally(formula: str) -> Array:
        return evaluate(formula, sys._getframe(1).f_locals)  # as numexpr does

    def refuse(*_: object, **__: object) -> None:
        raise ValueError("a formula is not supported")

    modules: tuple[Any, ...] = (v2_v3_blocks, v4_blocks)
    for blocks in modules:
        blocks.evaluate = evaluate_locally
        blocks.symbols = blocks.lambdify = refuse
