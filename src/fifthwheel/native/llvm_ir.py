"""A symbolic step as LLVM assembly: one CasADi instruction, one line of IR, inside a loop over the samples.

What depends on the constants alone is computed once, before the loop. The carry is loaded when a sample begins and
stored when it ends. A lane is a vehicle: with `lanes` above one every value is an LLVM vector and every array carries
the lanes in its last dimension, so one instruction serves `lanes` vehicles.
"""

import struct

import casadi as ca

_BINARY = {ca.OP_ADD: "fadd contract", ca.OP_SUB: "fsub contract", ca.OP_MUL: "fmul contract", ca.OP_DIV: "fdiv"}
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
_LIBRARY = {ca.OP_ATAN: "atan"}  # of the C library, a lane at a time; LLVM has an intrinsic of its own only lately
_ARGUMENTS = ("carry", "sample", "constant")


class Emitter:
    """Writes the body of `scan(samples, groups, carry, sample, constant, output)` for one CasADi step.

    Args:
        step: (carry, sample, constant) -> (carry, output), three dense column vectors to two.
        lanes: vehicles in one vector.

    Raises:
        NotImplementedError: an operation of the step has no line in the tables above.
    """

    def __init__(self, step: ca.Function, lanes: int) -> None:
        self.step = step
        self.lanes = lanes
        self.type = "double" if lanes == 1 else f"<{lanes} x double>"
        self.mask = "i1" if lanes == 1 else f"<{lanes} x i1>"
        self.suffix = "f64" if lanes == 1 else f"v{lanes}f64"
        self.once: list[str] = []
        self.loop: list[str] = []
        self.intrinsics: set[str] = set()
        self.count = 0

    def constant(self, value: float) -> str:
        bits = f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"
        if self.lanes == 1:
            return bits
        return "<" + ", ".join([f"double {bits}"] * self.lanes) + ">"

    def emit(self, text: str, invariant: bool) -> tuple[str, bool]:
        self.count += 1
        name = f"%x{self.count}"
        (self.once if invariant else self.loop).append(f"  {name} = {text}")
        return name, invariant

    def load(self, argument: int, element: int) -> tuple[str, bool]:
        base = _ARGUMENTS[argument]
        invariant = base == "constant"
        pointer, _ = self.emit(f"getelementptr {self.type}, ptr %{base}.here, i64 {element}", invariant)
        return self.emit(f"load {self.type}, ptr {pointer}, align 8", invariant)

    def select(self, condition: str, invariant: bool, value: str, other: str) -> tuple[str, bool]:
        return self.emit(f"select {self.mask} {condition}, {self.type} {value}, {self.type} {other}", invariant)

    def truth(self, value: str, invariant: bool) -> str:
        return self.emit(f"fcmp une {self.type} {value}, {self.constant(0.0)}", invariant)[0]

    def library(self, name: str, value: str, invariant: bool) -> tuple[str, bool]:
        self.intrinsics.add(f"declare double @{name}(double)")
        if self.lanes == 1:
            return self.emit(f"call double @{name}(double {value})", invariant)
        found = "poison"
        for lane in range(self.lanes):
            element, _ = self.emit(f"extractelement {self.type} {value}, i32 {lane}", invariant)
            result, _ = self.emit(f"call double @{name}(double {element})", invariant)
            found, _ = self.emit(f"insertelement {self.type} {found}, double {result}, i32 {lane}", invariant)
        return found, invariant

    def operation(self, op: int, arguments: list[tuple[str, bool]]) -> tuple[str, bool]:
        invariant = all(known for _, known in arguments)
        a = arguments[0][0]
        b = arguments[-1][0]
        if op in _BINARY:
            return self.emit(f"{_BINARY[op]} {self.type} {a}, {b}", invariant)
        if op in _COMPARE:
            truth, _ = self.emit(f"fcmp {_COMPARE[op]} {self.type} {a}, {b}", invariant)
            return self.select(truth, invariant, self.constant(1.0), self.constant(0.0))
        if op in _INTRINSIC:
            name = _INTRINSIC[op]
            parameters = ", ".join(f"{self.type} {argument}" for argument, _ in arguments)
            types = ", ".join([self.type] * len(arguments))
            self.intrinsics.add(f"declare {self.type} @llvm.{name}.{self.suffix}({types})")
            return self.emit(f"call {self.type} @llvm.{name}.{self.suffix}({parameters})", invariant)
        if op in _LIBRARY:
            return self.library(_LIBRARY[op], a, invariant)
        if op == ca.OP_NEG:
            return self.emit(f"fneg {self.type} {a}", invariant)
        if op == ca.OP_SQ:
            return self.emit(f"fmul contract {self.type} {a}, {a}", invariant)
        if op == ca.OP_TWICE:
            return self.emit(f"fadd contract {self.type} {a}, {a}", invariant)
        if op == ca.OP_INV:
            return self.emit(f"fdiv {self.type} {self.constant(1.0)}, {a}", invariant)
        if op == ca.OP_ASSIGN:
            return arguments[0]
        if op == ca.OP_IF_ELSE_ZERO:
            return self.select(self.truth(a, invariant), invariant, b, self.constant(0.0))
        if op == ca.OP_NOT:
            return self.select(self.truth(a, invariant), invariant, self.constant(0.0), self.constant(1.0))
        if op in (ca.OP_AND, ca.OP_OR):
            word = "and" if op == ca.OP_AND else "or"
            both, _ = self.emit(f"{word} {self.mask} {self.truth(a, invariant)}, {self.truth(b, invariant)}", invariant)
            return self.select(both, invariant, self.constant(1.0), self.constant(0.0))
        raise NotImplementedError(f"{self.step.name()}: CasADi operation {op} has no translation to LLVM")

    def translate(self) -> None:
        """Fill `once` and `loop`; outputs are stored last, so that the carry is read whole before it is written."""
        step = self.step
        register: dict[int, tuple[str, bool]] = {}
        stores: list[tuple[int, int, str]] = []
        loaded: dict[tuple[int, int], tuple[str, bool]] = {}
        for k in range(step.n_instructions()):
            op = step.instruction_id(k)
            inputs, outputs = step.instruction_input(k), step.instruction_output(k)
            if op == ca.OP_CONST:
                register[outputs[0]] = (self.constant(step.instruction_constant(k)), True)
            elif op == ca.OP_INPUT:
                place = (inputs[0], inputs[1])
                if place not in loaded:
                    loaded[place] = self.load(*place)
                register[outputs[0]] = loaded[place]
            elif op == ca.OP_OUTPUT:
                stores.append((outputs[0], outputs[1], register[inputs[0]][0]))
            else:
                register[outputs[0]] = self.operation(op, [register[i] for i in inputs])
        for argument, element, value in stores:
            base = ("carry", "output")[argument]
            pointer, _ = self.emit(f"getelementptr {self.type}, ptr %{base}.here, i64 {element}", False)
            self.loop.append(f"  store {self.type} {value}, ptr {pointer}, align 8")


def module(step: ca.Function, lanes: int = 1) -> str:
    """The LLVM assembly of `void scan(i64 samples, i64 groups, ptr carry, ptr sample, ptr constant, ptr output)`.

    Row-major arrays of double: carry (groups, n_carry, lanes), sample (groups, samples, n_sample, lanes),
    constant (groups, n_constant, lanes), output (groups, samples, n_output, lanes). The carry is changed in place.
    """
    emitter = Emitter(step, lanes)
    emitter.translate()
    kind = emitter.type
    n_carry, n_sample, n_constant = (step.numel_in(i) for i in range(3))
    n_output = step.numel_out(1)
    newline = "\n"
    arrays = ", ".join(f"ptr noalias %{name}" for name in ("carry", "sample", "constant", "output"))
    return f"""
define void @scan(i64 %samples, i64 %groups, {arrays}) {{
entry:
  %no.samples = icmp sle i64 %samples, 0
  %no.groups = icmp sle i64 %groups, 0
  %nothing = or i1 %no.samples, %no.groups
  br i1 %nothing, label %done, label %group
group:
  %g = phi i64 [0, %entry], [%g.next, %group.end]
  %g.carry = mul i64 %g, {n_carry}
  %g.constant = mul i64 %g, {n_constant}
  %g.first = mul i64 %g, %samples
  %carry.here = getelementptr {kind}, ptr %carry, i64 %g.carry
  %constant.here = getelementptr {kind}, ptr %constant, i64 %g.constant
{newline.join(emitter.once)}
  br label %row
row:
  %k = phi i64 [0, %group], [%k.next, %row]
  %row.number = add i64 %g.first, %k
  %row.sample = mul i64 %row.number, {n_sample}
  %row.output = mul i64 %row.number, {n_output}
  %sample.here = getelementptr {kind}, ptr %sample, i64 %row.sample
  %output.here = getelementptr {kind}, ptr %output, i64 %row.output
{newline.join(emitter.loop)}
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
{newline.join(sorted(emitter.intrinsics))}
"""
