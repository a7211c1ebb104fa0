"""LLVM assembly of a symbolic step: one line of IR for each CasADi instruction, in a loop over the samples.

Values that depend only on the constants are computed before the loop. The carry is loaded at the beginning and stored
at the end of each sample. A lane is a vehicle: with more than one lane each value is an LLVM vector, and the last
dimension of each array is the lane, so that one instruction processes `lanes` vehicles.
"""

import struct
from collections.abc import Callable, Sequence
from typing import NamedTuple, TypeVar

import casadi as ca
import numpy as np

Value = TypeVar("Value")
_SINGLE = {
    ca.OP_ADD: "fadd contract {type} {a}, {b}",
    ca.OP_SUB: "fsub contract {type} {a}, {b}",
    ca.OP_MUL: "fmul contract {type} {a}, {b}",
    ca.OP_NEG: "fneg {type} {a}",
    ca.OP_SQ: "fmul contract {type} {a}, {a}",
    ca.OP_TWICE: "fadd contract {type} {a}, {a}",
}
_COMPARE = {ca.OP_LT: "olt", ca.OP_LE: "ole", ca.OP_EQ: "oeq", ca.OP_NE: "une"}
_INTRINSIC = {
    ca.OP_SQRT: "sqrt",
    ca.OP_FABS: "fabs",
    ca.OP_EXP: "exp",
    ca.OP_LOG: "log",
    ca.OP_SIN: "sin",
    ca.OP_COS: "cos",
    ca.OP_FMIN: "minnum",
    ca.OP_FMAX: "maxnum",
}
# functions of the C library, called for each lane; older LLVM has no intrinsic for them
_LIBRARY = {ca.OP_ATAN: "atan", ca.OP_TANH: "tanh"}
_ARGUMENTS = ("carry", "sample", "constant")
ALIGNMENT = {"double": 8, "float": 4}
"""Of the types of a number, bytes."""
BLOCK = 1000
"""Lines of a basic block. LLVM needs the more time for a line, the longer its block is, so a long step is divided. A
branch whose condition is always true, which LLVM does not know, keeps the blocks apart."""


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


Register = tuple[str, bool]
"""Name of a register, and whether it is invariant, that is computed before the loop over the samples."""


class Emitter:
    """The lines of a loop over the samples of a named step; `lanes` vehicles, or directions, are one vector.

    `scalar` is the type of a number in a lane, "double" or "float".
    """

    def __init__(self, name: str, lanes: int, scalar: str = "double") -> None:
        self.name, self.lanes, self.scalar = name, lanes, scalar
        self.type = scalar if lanes == 1 else f"<{lanes} x {scalar}>"
        self.mask = "i1" if lanes == 1 else f"<{lanes} x i1>"
        bits = "f64" if scalar == "double" else "f32"
        self.suffix = bits if lanes == 1 else f"v{lanes}{bits}"
        self.once: list[str] = []  # lines before the loop
        self.loop: list[str] = []  # lines in the loop
        self.intrinsics: set[str] = set()
        self.reciprocals: dict[str, Register] = {}  # of registers
        self.count = 0

    def constant(self, value: float) -> str:
        """The literal of a number."""
        rounded = value if self.scalar == "double" else float(np.float32(value))
        bits = f"0x{struct.unpack('<Q', struct.pack('<d', rounded))[0]:016X}"
        if self.lanes == 1:
            return bits
        return "<" + ", ".join([f"{self.scalar} {bits}"] * self.lanes) + ">"

    def emit(self, text: str, invariant: bool) -> Register:
        """Write an instruction, before the loop if it is invariant; its register and `invariant`."""
        self.count += 1
        name = f"%x{self.count}"
        (self.once if invariant else self.loop).append(f"  {name} = {text}")
        return name, invariant

    def load(self, array: str, element: int) -> Register:
        """Load an element of an array; constants are invariant."""
        invariant = array == "constant"
        pointer, _ = self.emit(f"getelementptr {self.type}, ptr %{array}.here, i64 {element}", invariant)
        return self.emit(f"load {self.type}, ptr {pointer}, align {ALIGNMENT[self.scalar]}", invariant)

    def broadcast(self, array: str, element: int, invariant: bool) -> Register:
        """Load an element of an array of scalars into all lanes."""
        pointer, _ = self.emit(f"getelementptr {self.scalar}, ptr %{array}.here, i64 {element}", invariant)
        scalar, _ = self.emit(f"load {self.scalar}, ptr {pointer}, align {ALIGNMENT[self.scalar]}", invariant)
        if self.lanes == 1:
            return scalar, invariant
        first, _ = self.emit(f"insertelement {self.type} poison, {self.scalar} {scalar}, i64 0", invariant)
        zeros = f"<{self.lanes} x i32> zeroinitializer"
        return self.emit(f"shufflevector {self.type} {first}, {self.type} poison, {zeros}", invariant)

    def store(self, value: str, array: str, element: int | str, *, invariant: bool = False, scalar: str = "") -> None:
        """Store a register in an element of an array; one of a single lane is rounded to the type `scalar`."""
        kind, scalar = self.type, scalar or self.scalar
        if scalar != self.scalar:
            kind, value = scalar, self.emit(f"fptrunc {self.type} {value} to {scalar}", invariant)[0]
        pointer, _ = self.emit(f"getelementptr {kind}, ptr %{array}.here, i64 {element}", invariant)
        (self.once if invariant else self.loop).append(
            f"  store {kind} {value}, ptr {pointer}, align {ALIGNMENT[scalar]}"
        )

    def select(self, condition: str, invariant: bool, value: str, other: str) -> Register:
        """`value` where the condition is true, else `other`."""
        return self.emit(f"select {self.mask} {condition}, {self.type} {value}, {self.type} {other}", invariant)

    def truth(self, value: str, invariant: bool) -> str:
        """Whether a value is not zero, as a mask."""
        return self.emit(f"fcmp une {self.type} {value}, {self.constant(0.0)}", invariant)[0]

    def library(self, name: str, value: str, invariant: bool) -> Register:
        """Call a function of the C library for each lane."""
        self.intrinsics.add(f"declare double @{name}(double)")
        if self.lanes == 1:
            return self.emit(f"call double @{name}(double {value})", invariant)
        vector = "poison"
        for lane in range(self.lanes):
            element, _ = self.emit(f"extractelement {self.type} {value}, i32 {lane}", invariant)
            result, _ = self.emit(f"call double @{name}(double {element})", invariant)
            vector, _ = self.emit(f"insertelement {self.type} {vector}, double {result}, i32 {lane}", invariant)
        return vector, invariant

    def reciprocal(self, register: Register) -> Register:
        """One over a register. All its divisions share it: a division takes as long as several products."""
        name, invariant = register
        if name not in self.reciprocals:
            self.reciprocals[name] = self.emit(f"fdiv {self.type} {self.constant(1.0)}, {name}", invariant)
        return self.reciprocals[name]

    def operation(self, op: int, arguments: Sequence[Register]) -> Register:
        """Write an operation on registers; a NotImplementedError if no table above contains it."""
        invariant = all(invariant for _, invariant in arguments)
        a = arguments[0][0]
        b = arguments[-1][0]
        if op in _SINGLE:
            return self.emit(_SINGLE[op].format(type=self.type, a=a, b=b), invariant)
        if op in _COMPARE:
            truth, _ = self.emit(f"fcmp {_COMPARE[op]} {self.type} {a}, {b}", invariant)
            return self.select(truth, invariant, self.constant(1.0), self.constant(0.0))
        if op in _INTRINSIC:
            name = _INTRINSIC[op]
            parameters = ", ".join(f"{self.type} {argument}" for argument, _ in arguments)
            types = ", ".join([self.type] * len(arguments))
            self.intrinsics.add(f"declare {self.type} @llvm.{name}.{self.suffix}({types})")
            return self.emit(f"call {self.type} @llvm.{name}.{self.suffix}({parameters})", invariant)
        if op in _LIBRARY and self.scalar == "double":
            return self.library(_LIBRARY[op], a, invariant)
        if op == ca.OP_INV:
            return self.reciprocal(arguments[0])
        if op == ca.OP_DIV:
            return self.operation(ca.OP_MUL, [arguments[0], self.reciprocal(arguments[1])])
        if op == ca.OP_ASSIGN:
            return arguments[0]
        if op == ca.OP_IF_ELSE_ZERO:
            return self.select(self.truth(a, invariant), invariant, b, self.constant(0.0))
        if op == ca.OP_SIGN:
            above, below = (
                self.emit(f"fcmp {how} {self.type} {a}, {self.constant(0.0)}", invariant)[0] for how in ("ogt", "olt")
            )
            other, _ = self.select(below, invariant, self.constant(-1.0), a)  # 0 or NaN
            return self.select(above, invariant, self.constant(1.0), other)
        if op == ca.OP_NOT:
            return self.select(self.truth(a, invariant), invariant, self.constant(0.0), self.constant(1.0))
        if op in (ca.OP_AND, ca.OP_OR):
            name = "and" if op == ca.OP_AND else "or"
            both, _ = self.emit(f"{name} {self.mask} {self.truth(a, invariant)}, {self.truth(b, invariant)}", invariant)
            return self.select(both, invariant, self.constant(1.0), self.constant(0.0))
        names = [each for each in dir(ca) if each.startswith("OP_") and getattr(ca, each) == op]
        raise NotImplementedError(
            f"{self.name}: CasADi operation {names[0]} cannot be compiled; write the step without it"
        )


def _in_blocks(lines: Sequence[str], first: str = "row") -> tuple[str, str]:
    """The lines of a block, divided into blocks of at most `BLOCK` lines, and the name of the last block."""
    text, last = "\n".join(lines[:BLOCK]), first
    for start in range(BLOCK, len(lines), BLOCK):
        last = f"{first}.{start}"
        branch = f"  br i1 %something, label %{last}, label %done"
        text += "\n".join(["", branch, f"{last}:", *lines[start : start + BLOCK]])
    return text, last


def _with_rest(lines: Sequence[str], rest: Sequence[str], array: str) -> tuple[str, str]:
    """The lines of the block `row`, and the rest, which is skipped if an array is null, as `_in_blocks`."""
    (text, _), (more, _) = _in_blocks(lines), _in_blocks(rest, "rest")
    choice = [f"  %wanted = icmp ne ptr %{array}, null", "  br i1 %wanted, label %rest, label %row.end", "rest:"]
    return "\n".join([text, *choice, more, "  br label %row.end", "row.end:"]), "row.end"


class ArrayLayout(NamedTuple):
    """Where the elements of an array are: element e of row k of group g is at g * group + k * row + e."""

    name: str
    type: str  # type of an element
    group: str  # distance between two groups, in elements: a number or a register
    row: str = "0"  # distance between two rows, in elements; 0 if all rows share the elements


def function(
    name: str,
    emitter: Emitter,
    layouts: Sequence[ArrayLayout],
    *,
    pitch: bool = False,
    strides: Sequence[str] = (),
    attributes: str = "",
    last: str = "",
    rest: Sequence[str] = (),
    of_rest: str = "",
) -> str:
    """LLVM assembly of `void name(i64 samples, i64 groups, [i64 pitch,] ptr array, ...)`.

    The emitter has the lines for each group before its loop over the samples, and in the loop. `strides` are lines that
    compute registers for the layouts of the arrays from `samples` and `pitch`; `attributes` are those of LLVM. Lines
    that contain blocks of their own end in the block `last`; others are divided into blocks. `rest` are further lines
    of the loop, which are skipped if the array `of_rest` is null.
    """
    arguments = ["i64 %samples", "i64 %groups", *["i64 %pitch"] * pitch, *(f"ptr noalias %{a.name}" for a in layouts)]
    starts, rows = [], []
    for a in layouts:
        first, moves = (f"%{a.name}.start", True) if a.row != "0" else (f"%{a.name}.here", False)
        starts.append(f"  %{a.name}.group = mul i64 %g, {a.group}")
        starts.append(f"  {first} = getelementptr {a.type}, ptr %{a.name}, i64 %{a.name}.group")
        if moves:
            rows.append(f"  %{a.name}.row = mul i64 %k, {a.row}")
            rows.append(f"  %{a.name}.here = getelementptr {a.type}, ptr {first}, i64 %{a.name}.row")
    newline = "\n"
    lines = [*rows, *emitter.loop]
    if rest:
        loop, last = _with_rest(lines, rest, of_rest)
    else:
        loop, last = ("\n".join(lines), last) if last else _in_blocks(lines)
    return f"""
define void @{name}({", ".join(arguments)}){attributes} {{
entry:
  %no.samples = icmp sle i64 %samples, 0
  %no.groups = icmp sle i64 %groups, 0
  %nothing = or i1 %no.samples, %no.groups
  %something = xor i1 %nothing, true
{newline.join(strides)}
  br i1 %nothing, label %done, label %group
group:
  %g = phi i64 [0, %entry], [%g.next, %group.end]
{newline.join([*starts, *emitter.once])}
  br label %row
row:
  %k = phi i64 [0, %group], [%k.next, %{last}]
{loop}
  %k.next = add i64 %k, 1
  %more.rows = icmp slt i64 %k.next, %samples
  br i1 %more.rows, label %row, label %group.end
group.end:
  %g.next = add i64 %g, 1
  %more.groups = icmp slt i64 %g.next, %groups
  br i1 %more.groups, label %group, label %done
done:
  ret void
}}
"""


def scan_layouts(step: ca.Function, kind: str) -> tuple[list[ArrayLayout], list[str]]:
    """The arrays of `scan`, whose elements have this type, and the lines that compute the registers of the layouts."""
    n_carry, n_sample, n_constant = (step.numel_in(i) for i in range(3))
    n_output = step.numel_out(1)
    layouts = [
        ArrayLayout("carry", kind, str(n_carry)),
        ArrayLayout("sample", kind, "%samples.sample", str(n_sample)),
        ArrayLayout("constant", kind, str(n_constant)),
        ArrayLayout("output", kind, "%samples.output", str(n_output)),
    ]
    counts = {"sample": n_sample, "output": n_output}
    return layouts, [f"  %samples.{name} = mul i64 %samples, {count}" for name, count in counts.items()]


def module(step: ca.Function, lanes: int = 1) -> str:
    """LLVM assembly of `void scan(i64 samples, i64 groups, ptr carry, ptr sample, ptr constant, ptr output)`.

    The arrays are row-major doubles: carry (groups, n_carry, lanes), sample (groups, samples, n_sample, lanes),
    constant (groups, n_constant, lanes), output (groups, samples, n_output, lanes). The carry is updated in place. A
    NotImplementedError if an operation of the step cannot be translated.
    """
    emitter = Emitter(step.name(), lanes)
    results = translate(
        step,
        constant=lambda value: (emitter.constant(value), True),
        load=lambda argument, element: emitter.load(_ARGUMENTS[argument], element),
        operation=emitter.operation,
    )
    for place, element, (value, _) in results:  # last, so that the old carry is read before the new one is written
        emitter.store(value, ("carry", "output")[place], element)
    layouts, strides = scan_layouts(step, emitter.type)
    return function("scan", emitter, layouts, strides=strides) + "\n".join(sorted(emitter.intrinsics)) + "\n"
