"""C99 of a symbolic step: one statement for each CasADi instruction, without loops, branches or memory of its own.

The real type is `fw_real`; literals are wrapped in `FW_REAL(...)`, and functions are `FW_SQRT`, `FW_EXP`, `FW_LOG`,
`FW_ABS`, `FW_SIN`, `FW_COS`, `FW_ATAN` and `FW_TANH`, so that one text serves float and double.
"""

import math
from collections.abc import Sequence

import casadi as ca

from fifthwheel.base.native.llvm_ir import translate

_TEMPLATES = {
    ca.OP_ADD: "{a} + {b}",
    ca.OP_SUB: "{a} - {b}",
    ca.OP_MUL: "{a} * {b}",
    ca.OP_NEG: "-{a}",
    ca.OP_SQ: "{a} * {a}",
    ca.OP_TWICE: "{a} + {a}",
    ca.OP_FMIN: "({a} < {b}) ? {a} : {b}",
    ca.OP_FMAX: "({a} > {b}) ? {a} : {b}",
    ca.OP_IF_ELSE_ZERO: "({a} != {zero}) ? {b} : {zero}",
    ca.OP_SIGN: "({a} > {zero}) ? {one} : ({a} < {zero}) ? -{one} : {a}",
    ca.OP_NOT: "({a} == {zero}) ? {one} : {zero}",
    ca.OP_AND: "(({a} != {zero}) && ({b} != {zero})) ? {one} : {zero}",
    ca.OP_OR: "(({a} != {zero}) || ({b} != {zero})) ? {one} : {zero}",
    ca.OP_LT: "({a} < {b}) ? {one} : {zero}",
    ca.OP_LE: "({a} <= {b}) ? {one} : {zero}",
    ca.OP_EQ: "({a} == {b}) ? {one} : {zero}",
    ca.OP_NE: "({a} != {b}) ? {one} : {zero}",
    ca.OP_SQRT: "FW_SQRT({a})",
    ca.OP_FABS: "FW_ABS({a})",
    ca.OP_EXP: "FW_EXP({a})",
    ca.OP_LOG: "FW_LOG({a})",
    ca.OP_SIN: "FW_SIN({a})",
    ca.OP_COS: "FW_COS({a})",
    ca.OP_ATAN: "FW_ATAN({a})",
    ca.OP_TANH: "FW_TANH({a})",
}
"""Expression of each operation on the values a and b."""
ONE, ZERO = "FW_REAL(1.0)", "FW_REAL(0.0)"


def literal(value: float) -> str:
    """A finite number as a C literal that gives the same double."""
    if not math.isfinite(value):
        raise NotImplementedError(f"{value} has no literal in C")
    return f"FW_REAL({value!r})"


def by_rows(matrix: ca.SX) -> ca.SX:
    """The elements of a matrix in the order of C, as a dense vector."""
    return ca.vec(ca.densify(matrix).T)


def step(name: str, arguments: Sequence[ca.SX], results: Sequence[ca.SX]) -> ca.Function:
    """A symbolic function for `function`: its results are dense and share what they have in common."""
    return ca.Function(name, list(arguments), list(map(ca.densify, results)), {"cse": True})


def function(
    step: ca.Function, name: str, arguments: Sequence[str], results: Sequence[str], *, static: bool = True
) -> str:
    """C99 of `static void name(const fw_real *argument, ..., fw_real *result, ...)`.

    All arguments are read before the first result is written, so a result may be the memory of an argument. A
    NotImplementedError if an operation of the step cannot be translated.
    """
    lines: list[str] = []
    read = set[int]()
    reciprocals: dict[str, str] = {}

    def load(place: int, element: int) -> str:
        read.add(place)
        return assign(f"{arguments[place]}[{element}]")

    def assign(text: str) -> str:
        lines.append(f"    const fw_real v{len(lines)} = {text};")
        return f"v{len(lines) - 1}"

    def reciprocal(value: str) -> str:
        """One over a value; all its divisions share it, as in machine code."""
        if value not in reciprocals:
            reciprocals[value] = assign(f"{ONE} / {value}")
        return reciprocals[value]

    def operation(op: int, values: Sequence[str]) -> str:
        a, b = values[0], values[-1]
        if op == ca.OP_DIV:
            return assign(f"{a} * {reciprocal(b)}")
        if op == ca.OP_INV:
            return reciprocal(a)
        if op == ca.OP_ASSIGN:
            return a
        if op in _TEMPLATES:
            return assign(_TEMPLATES[op].format(a=a, b=b, one=ONE, zero=ZERO))
        raise NotImplementedError(f"{name}: CasADi operation {op} cannot be written in C; write the step without it")

    stores = translate(step, literal, load, operation)
    lines += [f"    {results[place]}[{element}] = {value};" for place, element, value in stores]
    lines += [f"    (void){name};" for place, name in enumerate(arguments) if place not in read]
    parameters = [*(f"const fw_real *{a}" for a in arguments), *(f"fw_real *{r}" for r in results)]
    return "\n".join([f"{'static ' if static else ''}void {name}({', '.join(parameters)})", "{", *lines, "}"]) + "\n"
