"""The instructions of a symbolic step, in their order, for a writer of code in any language."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import casadi as ca

Value = TypeVar("Value")


class Instruction(NamedTuple):
    """An instruction of a step in static single assignment form: operands are numbers of instructions."""

    op: int
    operands: tuple[int, ...]
    place: tuple[int, int] = (0, 0)  # argument or result, and its element, of an input or output
    constant: float = 0.0


def instructions(step: ca.Function) -> list[Instruction]:
    """All instructions of a step with dense column vectors as arguments and results."""
    found: list[Instruction] = []
    written: dict[int, int] = {}  # number of the last instruction that wrote a place of CasADi's work vector
    for k in range(step.n_instructions()):
        op, inputs, outputs = step.instruction_id(k), step.instruction_input(k), step.instruction_output(k)
        if op == ca.OP_CONST:
            found.append(Instruction(op, (), constant=step.instruction_constant(k)))
        elif op == ca.OP_INPUT:
            found.append(Instruction(op, (), (inputs[0], inputs[1])))
        elif op == ca.OP_OUTPUT:
            found.append(Instruction(op, (written[inputs[0]],), (outputs[0], outputs[1])))
        else:
            found.append(Instruction(op, tuple(written[i] for i in inputs)))
        if op != ca.OP_OUTPUT:
            written[outputs[0]] = k
    return found


def translate(
    step: ca.Function,
    constant: Callable[[float], Value],
    load: Callable[[int, int], Value],
    operation: Callable[[int, Sequence[Value]], Value],
) -> list[tuple[int, int, Value]]:
    """Write all instructions of a step: numbers, elements (argument, element) of arguments, each once, and operations.

    Returns (result, element, value) of each element of the results.
    """
    values: dict[int, Value] = {}
    loaded: dict[tuple[int, int], Value] = {}
    results: list[tuple[int, int, Value]] = []
    for k, (op, operands, place, number) in enumerate(instructions(step)):
        if op == ca.OP_CONST:
            values[k] = constant(number)
        elif op == ca.OP_INPUT:
            if place not in loaded:
                loaded[place] = load(*place)
            values[k] = loaded[place]
        elif op == ca.OP_OUTPUT:
            results.append((*place, values[operands[0]]))
        else:
            values[k] = operation(op, [values[i] for i in operands])
    return results
