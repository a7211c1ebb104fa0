"""The instructions of a symbolic step, in their order, for a writer of code in any language."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import casadi as ca

Value = TypeVar("Value")


def translate(
    step: ca.Function,
    constant: Callable[[float], Value],
    load: Callable[[int, int], Value],
    operation: Callable[[int, Sequence[Value]], Value],
) -> list[tuple[int, int, Value]]:
    """Write all instructions of a step, each by a call of one of the functions.

    Args:
        step: with dense column vectors as arguments and results.
        constant: writes a number.
        load: writes the element (argument, element) of an argument; it is called once for each.
        operation: writes a CasADi operation (`casadi.OP_ADD`, ...) on values.

    Returns:
        (result, element, value) of each element of the results.
    """
    values: dict[int, Value] = {}
    loaded: dict[tuple[int, int], Value] = {}
    results: list[tuple[int, int, Value]] = []
    for k in range(step.n_instructions()):
        op = step.instruction_id(k)
        inputs, outputs = step.instruction_input(k), step.instruction_output(k)
        if op == ca.OP_CONST:
            values[outputs[0]] = constant(step.instruction_constant(k))
        elif op == ca.OP_INPUT:
            source = (inputs[0], inputs[1])
            if source not in loaded:
                loaded[source] = load(*source)
            values[outputs[0]] = loaded[source]
        elif op == ca.OP_OUTPUT:
            results.append((outputs[0], outputs[1], values[inputs[0]]))
        else:
            values[outputs[0]] = operation(op, [values[i] for i in inputs])
    return results
