"""Functions of a user's own module that return expressions of CasADi: how they are named, checked, saved and found.

A function is at the top level of a module, so that processes and saved results find it by its name, module:function.
"""

import inspect
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from types import FunctionType
from typing import Any

import casadi as ca

from fifthwheel.base.errors import SignalError
from fifthwheel.base.native import cache

Fault = tuple[str, str, str]
"""What was expected of a function, what it has, and the cure."""
TOLERANCE = 1e-6
"""Relative, of values that shall be equal."""


def name_of(function: Any) -> str:
    """module:function"""
    return f"{getattr(function, '__module__', None)}:{getattr(function, '__qualname__', function)}"


def find(name: str) -> Any:
    """What an imported module has under module:name; None if nothing: a file must not import code."""
    module, _, function = name.partition(":")
    return getattr(sys.modules.get(module), function, None)


def digest(function: ca.Function) -> str:
    """All that determines a function: machine code of one is never that of another."""
    from fifthwheel.base.native.llvm_ir import instructions

    return cache.DIGEST(repr(instructions(function)).encode()).hexdigest()


def definition_faults(function: Any, arguments: Sequence[str]) -> Iterator[Fault]:
    """Why this is no function of these arguments at the top level of a module."""
    if not isinstance(function, FunctionType) or find(name_of(function)) is not function:
        yield "a function at the top level of a module", "another object", "define it there with def"
    names = tuple(inspect.signature(function).parameters)
    if names != tuple(arguments):
        yield f"the arguments {', '.join(arguments)}", ", ".join(names) or "none", "name them so, in this order"


def expression_fault(error: Exception) -> Fault:
    """The fault of a function that raises an error."""
    got = f"{type(error).__name__} ({(str(error).strip() or 'without a message').splitlines()[-1]})"
    return "an expression of CasADi", got, "return one, with the functions of casadi in place of those of math"


def code_faults(symbols: Sequence[ca.SX], results: Sequence[ca.SX]) -> Iterator[Fault]:
    """Why there is no C code of results: an operation of them, or of the derivatives among them."""
    from fifthwheel.base.native import c_code

    arguments, outputs = ([f"{kind}{i}" for i in range(len(of))] for kind, of in (("a", symbols), ("r", results)))
    try:
        c_code.function(c_code.step("own", symbols, results), "own", arguments, outputs)
    except NotImplementedError as error:
        yield "sqrt, fabs, exp, log, sin, cos, atan, tanh and arithmetic", "another function", str(error)


def restored(key: str, name: str, expected: Mapping[str, float], require: Any, values: Any) -> Any:
    """The function of a name if its module is imported, `require` accepts it and it has the expected `values`.

    Raises:
        SignalError: it is not imported, or has other values.
    """
    if (function := find(name)) is None:
        module = name.partition(":")[0]
        raise SignalError(f"{key}: expected the function {name}, which is not imported; import {module} first")
    require(function)
    found = values(function)
    for place, value in expected.items():
        if not math.isclose(found.get(place, math.nan), value, rel_tol=TOLERANCE):
            raise SignalError(
                f"{key}, {name}: expected the function of this result, with {value:g} {place}, got another one, with "
                f"{found.get(place, math.nan):g}; restore the function"
            )
    return function
