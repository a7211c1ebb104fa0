"""LLVM assembly of a symbolic step with directional derivatives: the nominal step once, the derivatives in lanes.

A step (carry, sample, constant, carry', constant') -> (carry, output, carry', output') is divided into two loops over
the samples. `nominal` computes what does not depend on a direction: carry and output, and then, if derivatives are
wanted, the values that they need. `directions` computes the rest, with one direction in each lane. `propagation` is the
product of the Jacobians of the reverse mode and directions, sample by sample.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import casadi as ca

from fifthwheel.base.native.llvm_ir import ArrayLayout, Emitter, Instruction, Register, function, instructions

_ARRAYS = ("carry", "sample", "constant", "carry", "constant")
_RESULTS = ("carry", "output")
_FIRST_DIRECTION = 3
"""Arguments from this one on differ between directions."""

_SUMS = (ca.OP_ADD, ca.OP_SUB, ca.OP_NEG)


class DirectionModule(NamedTuple):
    """The assembly of both loops, and the numbers of values that pass from the first to the second."""

    source: str
    shared: int  # for each sample
    fixed: int  # for all samples together


class _Divider:
    """Writes each instruction of a step into one of the two loops.

    A derivative is a sum of products. In `directions` each sum is written as a chain, sum + a * b + c * d + ..., which
    the compiler turns into fused multiply-adds; a division by a value that does not vary becomes a product.
    """

    def __init__(self, step: ca.Function, lanes: int, scalar: str) -> None:
        self.instructions = instructions(step)
        self.varies: list[bool] = []  # whether an instruction differs between directions
        self.invariant: list[bool] = []  # whether it is the same for all samples
        for op, operands, (argument, _), _ in self.instructions:
            is_input = op == ca.OP_INPUT
            self.varies.append(argument >= _FIRST_DIRECTION if is_input else any(self.varies[i] for i in operands))
            constant = _ARRAYS[argument] == "constant" if is_input else all(self.invariant[i] for i in operands)
            self.invariant.append(constant)
        self.nominal, self.directions = Emitter(step.name(), 1), Emitter(step.name(), lanes, scalar)
        self.registers: dict[int, Register] = {}  # of instructions, each in its own loop
        self.shared: dict[str, int] = {}  # registers of `nominal` that pass to `directions`, and their places
        self.fixed: dict[str, int] = {}  # of all samples together
        self.absorbed = self._absorbed()
        self.rest: list[str] = []  # lines of `nominal` that only derivatives need

    def _absorbed(self) -> set[int]:
        """Numbers of the instructions that only serve as a term of one sum."""
        consumers: dict[int, list[int]] = {}
        for k, instruction in enumerate(self.instructions):
            for i in instruction.operands:
                consumers.setdefault(i, []).append(k)
        absorbed = set()
        for i, numbers in consumers.items():
            if (
                len(numbers) == 1
                and self.varies[i]
                and self.instructions[i].op in (*_SUMS, ca.OP_MUL)
                and self.instructions[numbers[0]].op in _SUMS
                and self.invariant[i] == self.invariant[numbers[0]]
            ):
                absorbed.add(i)
        return absorbed

    def vector(self, number: int) -> Register:
        """The value of an instruction in `directions`; one that does not vary is passed on, the same for all lanes."""
        instruction = self.instructions[number]
        if instruction.op == ca.OP_CONST:
            return self.directions.constant(instruction.constant), True
        return self.registers[number] if self.varies[number] else self._pass(self.registers[number])

    def _pass(self, register: Register) -> Register:
        """A register of `nominal`, in `directions`, loaded wherever it is used: cheaper than to store it in between."""
        name, invariant = register
        array, places = ("fixed", self.fixed) if invariant else ("shared", self.shared)
        return self.directions.broadcast(array, places.setdefault(name, len(places)), invariant)

    def divide(self) -> None:
        """Write all instructions; a carry is read before it is written."""
        stores, operations = [], []
        loaded: dict[tuple[int, int], Register] = {}
        for k, instruction in enumerate(self.instructions):
            op, emitter = instruction.op, self.directions if self.varies[k] else self.nominal
            if op == ca.OP_CONST:
                self.registers[k] = (self.nominal.constant(instruction.constant), True)
            elif op == ca.OP_INPUT:
                if instruction.place not in loaded:
                    argument, element = instruction.place
                    loaded[instruction.place] = emitter.load(_ARRAYS[argument], element)
                self.registers[k] = loaded[instruction.place]
            elif op == ca.OP_OUTPUT:
                stores.append(instruction)
            elif not self.varies[k]:
                operations.append(k)
        of_values = self._needed([store for store in stores if store.place[0] < len(_RESULTS)])
        self._operate(k for k in operations if k in of_values)
        for store in stores:
            result, element = store.place
            if result < len(_RESULTS):
                self.nominal.store(self.registers[store.operands[0]][0], _RESULTS[result], element)
        values = len(self.nominal.loop)
        self._operate(k for k in operations if k not in of_values)
        for k in self._order(stores):
            self.registers[k] = self._derivative(k)
        self._store(stores)
        self.rest, self.nominal.loop[values:] = self.nominal.loop[values:], []

    def _needed(self, outputs: Sequence[Instruction]) -> set[int]:
        """Numbers of the instructions that outputs depend on."""
        needed, waiting = set[int](), [number for output in outputs for number in output.operands]
        while waiting:
            number = waiting.pop()
            if number not in needed:
                needed.add(number)
                waiting += self.instructions[number].operands
        return needed

    def _operate(self, numbers: Iterable[int]) -> None:
        """Write instructions that do not vary."""
        for k in numbers:
            op, operands = self.instructions[k].op, self.instructions[k].operands
            self.registers[k] = self.nominal.operation(op, [self.registers[i] for i in operands])

    def _order(self, outputs: Sequence[Instruction]) -> list[int]:
        """The instructions of `directions`, each soon before its first use: its value is then still in a register."""
        order, seen = list[int](), set[int]()
        waiting = [(number, False) for output in reversed(outputs) for number in output.operands]
        while waiting:
            number, is_next = waiting.pop()
            if is_next:
                order.append(number)
            elif self.varies[number] and number not in seen:
                seen.add(number)
                computed = number not in self.absorbed and self.instructions[number].op != ca.OP_INPUT
                waiting += [(number, True)] * computed
                waiting += [(i, False) for i in reversed(self.instructions[number].operands)]
        return order

    def _derivative(self, number: int) -> Register:
        """Write an instruction that varies."""
        op, operands = self.instructions[number].op, self.instructions[number].operands
        if op in _SUMS:
            return self._sum(number)
        if op == ca.OP_DIV and not self.varies[operands[1]]:
            reciprocal = self._pass(self.nominal.reciprocal(self.registers[operands[1]]))
            return self.directions.operation(ca.OP_MUL, [self.vector(operands[0]), reciprocal])
        return self.directions.operation(op, [self.vector(i) for i in operands])

    def _sum(self, number: int) -> Register:
        """Write a sum of all its terms, positive single terms first."""
        terms: list[tuple[bool, tuple[int, ...]]] = []  # sign, and factors
        waiting = [(False, number)]
        while waiting:
            negative, k = waiting.pop()
            op, operands = self.instructions[k].op, self.instructions[k].operands
            if k != number and (k not in self.absorbed or op == ca.OP_MUL):
                terms.append((negative, operands if k in self.absorbed else (k,)))
            elif op == ca.OP_NEG:
                waiting.append((not negative, operands[0]))
            else:
                waiting += [(negative != (op == ca.OP_SUB), operands[1]), (negative, operands[0])]
        terms.sort(key=lambda term: (term[0], len(term[1])))
        total: Register | None = None
        for negative, factors in terms:
            term = self.vector(factors[0])
            if len(factors) == 2:
                term = self.directions.operation(ca.OP_MUL, [term, self.vector(factors[1])])
            if total is None:
                total = self.directions.operation(ca.OP_NEG, [term]) if negative else term
            else:
                total = self.directions.operation(ca.OP_SUB if negative else ca.OP_ADD, [total, term])
        assert total is not None
        return total

    def _store(self, outputs: Sequence[Instruction]) -> None:
        """Store the derivatives of the results, and what passes to `directions`."""
        for instruction in outputs:
            (result, element), (number,) = instruction.place, instruction.operands
            if result < len(_RESULTS):
                continue
            value, _ = self.vector(number)
            if result == len(_RESULTS):
                self.directions.store(value, "carry", element)
            else:
                offset, _ = self.directions.emit(f"mul i64 %pitch, {element}", True)
                self.directions.store(value, "output", offset)
        for names, array in ((self.shared, "shared"), (self.fixed, "fixed")):
            for name, element in names.items():
                self.nominal.store(name, array, element, invariant=array == "fixed", scalar=self.directions.scalar)


def direction_module(
    step: ca.Function, lanes: int, scalar: str = "double", *, backwards: bool = False
) -> DirectionModule:
    """LLVM assembly of the two loops of a step; all arrays are row-major.

    `scalar` is the type of carry', constant', output', shared and fixed; "float" halves the time of the derivatives.
    All else is in double precision.

        void nominal(i64 samples, i64 1, ptr carry, ptr sample, ptr constant, ptr output, ptr shared, ptr fixed)
        void directions(i64 samples, i64 groups, i64 pitch, ptr carry', ptr constant', ptr output', ptr shared,
                        ptr fixed)

    carry (n,), sample (samples, n), constant (n,), output (samples, n), shared (samples, n), fixed (n,);
    carry' (groups, n, lanes), constant' (groups, n, lanes), output' (samples, n, pitch, lanes), of which `groups` are
    written. Both carries are updated in place. `shared` is null if no derivatives are wanted. `backwards`: `nominal`
    writes its rows from the one at `shared` towards lower addresses, so that `directions` reads the last sample first.
    A NotImplementedError if an operation of the step cannot be translated.
    """
    divider = _Divider(step, lanes, scalar)
    divider.divide()
    nominal, directions = divider.nominal, divider.directions
    n_carry, n_sample, n_constant, n_carry_dot, n_constant_dot = (step.numel_in(i) for i in range(5))
    shared, fixed = len(divider.shared), len(divider.fixed)
    source = function(
        "nominal",
        nominal,
        [
            ArrayLayout("carry", nominal.type, str(n_carry)),
            ArrayLayout("sample", nominal.type, "0", str(n_sample)),
            ArrayLayout("constant", nominal.type, str(n_constant)),
            ArrayLayout("output", nominal.type, "0", str(step.numel_out(1))),
            ArrayLayout("shared", directions.scalar, "0", str(-shared if backwards else shared)),
            ArrayLayout("fixed", directions.scalar, "0"),
        ],
        rest=divider.rest,
        of_rest="shared",
    )
    source += function(
        "directions",
        directions,
        [
            ArrayLayout("carry", directions.type, str(n_carry_dot)),
            ArrayLayout("constant", directions.type, str(n_constant_dot)),
            ArrayLayout("output", directions.type, "1", "%pitch.row"),
            ArrayLayout("shared", directions.scalar, "0", str(shared)),
            ArrayLayout("fixed", directions.scalar, "0"),
        ],
        pitch=True,
        strides=[f"  %pitch.row = mul i64 %pitch, {step.numel_out(3)}"],
    )
    intrinsics = sorted(nominal.intrinsics | directions.intrinsics)
    return DirectionModule("\n".join([source, *intrinsics, ""]), shared, fixed)


def propagation(sizes: Sequence[int], n: int, m: int, lanes: int) -> str:
    """LLVM assembly of `propagate`, for a step with `sizes` as in `directions.AdjointScan`.

        void propagate(i64 samples, i64 directions, ptr adjoint, ptr output, ptr slopes, ptr first, ptr column,
                       ptr value, ptr output')

    adjoint (samples, n + n_p, groups, lanes), in single precision; output (samples, n_output), of which the last 3 m
    are read; slopes (directions, groups, lanes), the derivatives [x', d'], updated in place; first, column and value
    are the elements of p' that are not zero; output' (samples, m, directions). For each sample and direction

        [x+', e'] = J [x', p'] - [0, a d'],    d+' = b d' + c e',

    where a lane of x has a = b = 0 and c = 1.
    """
    groups, outputs, adjoint = -(-(n + m) // lanes), sizes[6], sizes[8]
    vector, single, width = f"<{lanes} x double>", f"<{lanes} x float>", groups * lanes
    lines: list[str] = []
    count = 0

    def emit(text: str) -> str:
        nonlocal count
        count += 1
        lines.append(f"  %v{count} = {text}")
        return f"%v{count}"

    def load(kind: str, base: str, number: int | str) -> str:
        pointer = emit(f"getelementptr {kind}, ptr {base}, i64 {number}")
        return emit(f"load {kind}, ptr {pointer}, align {4 if kind == single else 8}")

    def spread(scalar: str) -> str:
        first = emit(f"insertelement {vector} poison, double {scalar}, i64 0")
        return emit(f"shufflevector {vector} {first}, {vector} poison, <{lanes} x i32> zeroinitializer")

    def add(total: str, a: str, b: str, how: str = "fadd") -> str:
        return emit(f"{how} contract {vector} {total}, {emit(f'fmul contract {vector} {a}, {b}')}")

    def literal(values: Sequence[float]) -> str:
        return "<" + ", ".join(f"double {value:.1f}" for value in values) + ">"

    def take() -> str:
        text, lines[:] = "\n".join(lines), []
        return text

    def element(base: str, number: int | str) -> str:
        return emit(f"fpext {single} {load(single, base, number)} to {vector}")

    jacobian = [[element("%J", i * groups + g) for g in range(groups)] for i in range(n)]
    in_state = [[float(g * lanes + lane < n) for lane in range(lanes)] for g in range(groups)]
    feedback = [
        [literal([0.0] * lanes) for _ in range(groups)],
        [literal([0.0] * lanes) for _ in range(groups)],
        [literal(state) for state in in_state],
    ]
    for number, vectors in enumerate(feedback):
        for i in range(m):
            g, lane = divmod(n + i, lanes)
            value = load("double", "%row.output", outputs - 3 * m + number * m + i)
            vectors[g] = emit(f"insertelement {vector} {vectors[g]}, double {value}, i64 {lane}")
    of_row = take()
    before = [load(vector, "%S", g) for g in range(groups)]
    totals = [literal([0.0] * lanes)] * groups
    for i in range(n):
        slope = spread(load("double", "%S", i))
        totals = [add(total, jacobian[i][g], slope) for g, total in enumerate(totals)]
    begin = emit("load i64, ptr %first.here, align 8")
    end = load("i64", "%first.here", 1)
    of_direction = take()
    place = emit(f"mul i64 {load('i64', '%column', '%j')}, {groups}")
    base = emit(f"getelementptr {single}, ptr %J, i64 {place}")
    slope = spread(load("double", "%value", "%j"))
    sums = [add(f"%sum.{g}", element(base, g), slope) for g in range(groups)]
    of_element = take()
    a, b, c = feedback
    results = [add(f"%total.{g}", a[g], before[g], "fsub") for g in range(groups)]
    for g in range(groups):
        later = add(emit(f"fmul contract {vector} {c[g]}, {results[g]}"), b[g], before[g])
        pointer = emit(f"getelementptr {vector}, ptr %S, i64 {g}")
        lines.append(f"  store {vector} {later}, ptr {pointer}, align 8")
    for i in range(m):
        g, lane = divmod(n + i, lanes)
        value = emit(f"extractelement {vector} {results[g]}, i64 {lane}")
        at = emit(f"add i64 %k, {emit(f'mul i64 %directions, {i}')}")
        pointer = emit(f"getelementptr double, ptr %row.slope, i64 {at}")
        lines.append(f"  store double {value}, ptr {pointer}, align 8")
    of_result = take()
    ends = list(zip(totals, sums, strict=True))
    sum_phis, total_phis = (
        "\n".join(f"  %{name}.{g} = phi {vector} [{a}, %direction], [{b}, %element]" for g, (a, b) in enumerate(ends))
        for name in ("sum", "total")
    )
    return f"""
define void @propagate(i64 %samples, i64 %directions, ptr noalias %adjoint, ptr noalias %output, ptr noalias %slopes,
                       ptr noalias %first, ptr noalias %column, ptr noalias %value, ptr noalias %slope) {{
entry:
  %pitch = mul i64 %directions, {m}
  br label %row
row:
  %t = phi i64 [0, %entry], [%t.next, %row.end]
  %J.at = mul i64 %t, {adjoint * groups}
  %J = getelementptr {single}, ptr %adjoint, i64 %J.at
  %output.at = mul i64 %t, {outputs}
  %row.output = getelementptr double, ptr %output, i64 %output.at
  %slope.at = mul i64 %t, %pitch
  %row.slope = getelementptr double, ptr %slope, i64 %slope.at
{of_row}
  br label %direction
direction:
  %k = phi i64 [0, %row], [%k.next, %result]
  %S.at = mul i64 %k, {width}
  %S = getelementptr double, ptr %slopes, i64 %S.at
  %first.here = getelementptr i64, ptr %first, i64 %k
{of_direction}
  %none = icmp sge i64 {begin}, {end}
  br i1 %none, label %result, label %element
element:
  %j = phi i64 [{begin}, %direction], [%j.next, %element]
{sum_phis}
{of_element}
  %j.next = add i64 %j, 1
  %more.elements = icmp slt i64 %j.next, {end}
  br i1 %more.elements, label %element, label %result
result:
{total_phis}
{of_result}
  %k.next = add i64 %k, 1
  %more.directions = icmp slt i64 %k.next, %directions
  br i1 %more.directions, label %direction, label %row.end
row.end:
  %t.next = add i64 %t, 1
  %more.rows = icmp slt i64 %t.next, %samples
  br i1 %more.rows, label %row, label %done
done:
  ret void
}}
"""
