"""LLVM assembly of a step of matrices: a loop over elements for each CasADi instruction.

Code without loops (`llvm_ir`) has an instruction for each element of each product. Where there are tens of thousands,
the processor waits for its code. A step written with `casadi.MX` has a loop for each of its matrix instructions, in
vector registers, and calls the functions of `casadi.SX` that it contains, which are code without loops.
"""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from fifthwheel.base.native.llvm_ir import ArrayLayout, Emitter, function, scan_layouts, translate
from fifthwheel.base.native.matrix_loops import WIDTH, Address, Memory, Products, StoredMatrix, pieces_of

COPIED = 24
"""Elements that are copied without a loop, at most."""

_ARRAYS = ("carry", "sample", "constant")
_COPIES = (ca.OP_RESHAPE, ca.OP_ASSIGN, ca.OP_SPARSITY_CAST)
_ONCE = {"start": 0, "stop": 1, "step": 1}
_CONCATENATIONS = (ca.OP_HORZCAT, ca.OP_VERTCAT, ca.OP_DIAGCAT)


class _Writer(Products):
    """Writes the instructions of a step. The matrices of the step share its memory; results are written last."""

    def __init__(self, step: ca.Function) -> None:
        super().__init__(step.name())
        self.step, self.memory = step, Memory()
        self.functions: dict[int, tuple[str, str]] = {}  # name and code of each function that it calls, by its hash
        self.matrices: dict[int, StoredMatrix] = {}  # by their place in CasADi's work vector
        self.dying: set[int] = set()  # places that no later instruction reads
        self.results: list[tuple[StoredMatrix, int]] = []  # of the next carry, with their places in it

    def write(self) -> None:
        """Write all instructions."""
        step = self.step
        last = _last_uses(step)
        for k in range(step.n_instructions()):
            op, inputs, outputs = step.instruction_id(k), step.instruction_input(k), step.instruction_output(k)
            self.dying = last[k]
            old = [self.matrices[place] for place in last[k]]
            self._instruction(op, step.instruction_MX(k), inputs, outputs)
            for matrix in old:
                self.memory.leave(matrix)
        for matrix, place in self.results:
            self._copy(matrix, ("%carry.here", place))

    def _instruction(self, op: int, node: ca.MX, inputs: Sequence[int], outputs: Sequence[int]) -> None:
        if op == ca.OP_OUTPUT:
            self._result(self.matrices[inputs[0]], node.info()["ind"], node.info()["offset"])
        elif op == ca.OP_CALL:
            self._call(node.which_function(), [self.matrices[place] for place in inputs], outputs)
        elif op == ca.OP_INPUT:
            info = node.info()
            self.matrices[outputs[0]] = StoredMatrix(node.nnz(), (f"%{_ARRAYS[info['ind']]}.here", info["offset"]))
        elif op == ca.OP_CONST:
            self.matrices[outputs[0]] = self._constant(node.to_DM().nonzeros())
        else:
            self.matrices[outputs[0]] = self._computed(op, node, inputs)

    def _result(self, matrix: StoredMatrix, result: int, place: int) -> None:
        """Write an output, or note a part of the next carry, which is written when nothing reads the last carry."""
        if result:
            self._copy(matrix, ("%output.here", place))
        elif matrix.base != ("%carry.here", place):
            if matrix.base[0] == "%carry.here":
                copied = self.memory.reserved(matrix.size)
                self._copy(matrix, copied.base)
                matrix = copied
            else:
                self.memory.enter(matrix)
            self.results.append((matrix, place))

    def _computed(self, op: int, node: ca.MX, inputs: Sequence[int]) -> StoredMatrix:
        size, operands = node.nnz(), [self.matrices[place] for place in inputs]
        source = operands[0]
        if size == 0:
            return StoredMatrix(0)
        if op == ca.OP_MTIMES:
            return self._matrix_product(node, inputs)
        if op == ca.OP_DOT:
            return self._single(self.dot(*operands))
        if op == ca.OP_MMIN:
            return self._single(self._least(source))
        if op in _COPIES:
            return self._slice(source, 0, size)
        if op == ca.OP_GETNONZEROS:
            elements = _taken(node)
            if elements == [*range(elements[0], elements[-1] + 1)]:
                return self._slice(source, elements[0], size)
            return self._gather(source, elements)
        if op == ca.OP_TRANSPOSE and node.is_dense():
            rows, columns = node.shape
            return self._gather(source, [j + columns * i for j in range(columns) for i in range(rows)])
        if op == ca.OP_PROJECT and node.is_dense():
            at = zip(*node.dep(0).sparsity().get_triplet(), strict=True)
            return self._scatter(source, [i + node.shape[0] * j for i, j in at], size)
        if op in _CONCATENATIONS:
            return self._concatenated(operands, size)
        return self._elementwise(op, inputs, size)

    def _least(self, matrix: StoredMatrix) -> str:
        least = self.element(matrix, 0)
        for i in range(1, matrix.size):
            least = self.scalar.operation(ca.OP_FMIN, [(least, False), (self.element(matrix, i), False)])[0]
        return least

    def _concatenated(self, parts: Sequence[StoredMatrix], size: int) -> StoredMatrix:
        made, offset = self.memory.reserved(size), 0
        for part in parts:
            self._copy(part, (made.base[0], made.base[1] + offset))
            offset += part.size
        return made

    def _reusable(self, place: int, size: int) -> StoredMatrix:
        """The memory of a matrix that is not read again, or other memory."""
        memory, matrix = self.memory, self.matrices[place]
        alone = place in self.dying and matrix.is_alone and matrix.size == size
        return memory.shared(matrix) if alone else memory.reserved(size)

    def _single(self, register: str) -> StoredMatrix:
        """A matrix with one element."""
        made = self.memory.reserved(1)
        self.put(register, made.base, 0, 1)
        return replace(made, register=register)

    def _copy(self, matrix: StoredMatrix, target: Address) -> None:
        """Copy a matrix."""
        self.each(matrix.size, lambda i, width: self.put(self.elements(matrix, i, width), target, i, width))

    def _slice(self, matrix: StoredMatrix, first: int, size: int) -> StoredMatrix:
        """Consecutive elements of a matrix."""
        if matrix.uniform is not None:
            return StoredMatrix(size, uniform=matrix.uniform)
        return replace(self.memory.shared(matrix, first, size), register=matrix.register)

    def _constant(self, values: Sequence[float]) -> StoredMatrix:
        if len(set(values)) <= 1:
            return StoredMatrix(len(values), uniform=values[0] if values else 0.0)
        numbers = ", ".join(f"double {self.scalar.constant(value)}" for value in values)
        return StoredMatrix(len(values), (self.table(f"[{len(values)} x double] [{numbers}]"), 0))

    def _gather(self, matrix: StoredMatrix, elements: Sequence[int]) -> StoredMatrix:
        """Any elements of a matrix."""
        made, begin = self.memory.reserved(len(elements)), 0
        if len(elements) > COPIED and matrix.uniform is None:
            begin = len(elements) // WIDTH * WIDTH
            table, kind = self.places(elements[:begin]), self.vectors[WIDTH].type
            name, pointers = f"llvm.masked.gather.v{WIDTH}f64.v{WIDTH}p0", f"<{WIDTH} x ptr>"
            self.declared.add(f"declare {kind} @{name}({pointers}, i32, <{WIDTH} x i1>, {kind})")
            every = "<" + ", ".join(["i1 true"] * WIDTH) + ">"

            def turn(number: str, passed: list[str]) -> list[tuple[str, str]]:
                first, _ = self.scalar.emit(f"mul i64 {number}, {WIDTH}", False)
                at, _ = self.scalar.emit(f"getelementptr i32, ptr {table}, i64 {first}", False)
                places, _ = self.scalar.emit(f"load <{WIDTH} x i32>, ptr {at}, align 4", False)
                base = self.pointer(matrix.base, 0)
                where, _ = self.scalar.emit(f"getelementptr double, ptr {base}, <{WIDTH} x i32> {places}", False)
                arguments = f"{pointers} {where}, i32 8, <{WIDTH} x i1> {every}, {kind} poison"
                self.put(self.scalar.emit(f"call {kind} @{name}({arguments})", False)[0], made.base, first, WIDTH)
                return []

            self.loop(begin // WIDTH, turn)
        for i, element in enumerate(elements[begin:], begin):
            self.put(self.element(matrix, element), made.base, i, 1)
        return made

    def _scatter(self, matrix: StoredMatrix, elements: Sequence[int], size: int) -> StoredMatrix:
        """A matrix with these elements, and zeros elsewhere."""
        made, table = self.memory.reserved(size), self.places(elements)
        self.each(size, lambda i, width: self.put(self.vectors[width].constant(0.0), made.base, i, width))

        def turn(number: str, _: list[str]) -> list[tuple[str, str]]:
            self.put(self.element(matrix, number), made.base, self.from_table(table, number), 1)
            return []

        if elements:
            self.loop(len(elements), turn)
        return made

    def _elementwise(self, op: int, inputs: Sequence[int], size: int) -> StoredMatrix:
        operands = [self.matrices[place] for place in inputs]
        if size == 1:
            return self._single(self.scalar.operation(op, [(self.element(each, 0), False) for each in operands])[0])
        scalars = {i: self.element(each, 0) for i, each in enumerate(operands) if each.size == 1}
        if op == ca.OP_DIV and 1 in scalars:
            op, scalars[1] = ca.OP_MUL, self.scalar.reciprocal((scalars[1], False))[0]
        widths = {width for _, width in pieces_of(size)}
        spread = {(i, width): self.spread(value, width) for i, value in scalars.items() for width in widths}
        made = self._reusable(
            next(place for place, each in zip(inputs, operands, strict=True) if each.size == size), size
        )

        def body(element: int | str, width: int) -> None:
            values = [spread.get((i, width)) or self.elements(each, element, width) for i, each in enumerate(operands)]
            value, _ = self.vectors[width].operation(op, [(each, False) for each in values])
            self.put(value, made.base, element, width)

        self.each(size, body)
        return made

    def _matrix_product(self, node: ca.MX, inputs: Sequence[int]) -> StoredMatrix:
        """z + x y; all are dense."""
        if not all(node.dep(i).is_dense() for i in range(3)):
            raise NotImplementedError(f"{self.name}: a sparse matrix cannot be multiplied; use casadi.densify")
        z, x, y = (self.matrices[place] for place in inputs)
        (rows, columns), terms = node.shape, node.dep(1).shape[1]
        is_factor, size = inputs[0] in inputs[1:], rows * columns
        made = self.memory.reserved(size) if is_factor else self._reusable(inputs[0], size)
        return self.product(z, x, y, (rows, terms, columns), made)

    def _call(self, called: ca.Function, arguments: Sequence[StoredMatrix], outputs: Sequence[int]) -> None:
        """Call a function without loops."""
        key = hash(called)
        if key not in self.functions:
            name = f"function.{len(self.functions)}"
            self.functions[key] = name, _without_loops(called, name, self.declared)
        name, _ = self.functions[key]
        written = [each if each.uniform is None else self._concatenated([each], each.size) for each in arguments]
        results = [self.memory.reserved(called.nnz_out(number)) for number in range(called.n_out())]
        pointers = [self.pointer(each.base, 0) for each in (*written, *results)]
        self.lines.append(f"  call void @{name}(i64 1, i64 1, {', '.join(f'ptr {pointer}' for pointer in pointers)})")
        for each, argument in zip(written, arguments, strict=True):
            if each is not argument:
                self.memory.leave(each)
        self.matrices |= {place: result for place, result in zip(outputs, results, strict=True) if place >= 0}


def _last_uses(step: ca.Function) -> list[set[int]]:
    """Of each instruction the places of CasADi's work vector whose matrix no later one reads."""
    last, number = [set[int]() for _ in range(step.n_instructions())], dict[int, int]()
    for k in range(step.n_instructions()):
        for place in step.instruction_input(k) if step.instruction_id(k) != ca.OP_INPUT else ():
            number[place] = k
        for place in step.instruction_output(k) if step.instruction_id(k) != ca.OP_OUTPUT else ():
            if place in number:
                last[number.pop(place)].add(place)
    for place, k in number.items():
        last[k].add(place)
    return last


def _taken(node: ca.MX) -> list[int]:
    """The elements that an instruction takes from a matrix."""
    info = node.info()
    if "nz" in info:
        return list(info["nz"])
    inner, outer = (
        range(part["start"], part["stop"], part["step"])
        for part in (info["inner" if "inner" in info else "slice"], info.get("outer", _ONCE))
    )
    return [i + j for j in outer for i in inner]


def _without_loops(called: ca.Function, name: str, declared: set[str]) -> str:
    """A function of `casadi.SX`."""
    emitter = Emitter(called.name(), 1)
    results = translate(
        called,
        constant=lambda value: (emitter.constant(value), False),
        load=lambda argument, element: emitter.load(f"a{argument}", element),
        operation=emitter.operation,
    )
    for place, element, (value, _) in results:
        emitter.store(value, f"r{place}", element)
    declared |= emitter.intrinsics
    layouts = [ArrayLayout(f"a{i}", "double", "0") for i in range(called.n_in())]
    layouts += [ArrayLayout(f"r{i}", "double", "0") for i in range(called.n_out())]
    # to optimise them takes the compiler four times as long, for at most 5 % of a sample, and C rounds differently then
    return function(name, emitter, layouts, attributes=" optnone noinline")


def matrix_module(step: ca.Function) -> str:
    """LLVM assembly of `void scan(...)` as `llvm_ir.module` with one lane, of a step written with `casadi.MX`.

    A NotImplementedError if an operation of the step cannot be translated.
    """
    writer = _Writer(step)
    writer.write()
    layouts, strides = scan_layouts(step, "double")
    strides.append(f"  %memory = alloca [{writer.memory.size} x double], align 64")
    scan = function("scan", writer.scalar, layouts, strides=strides, last=writer.block)
    called = [code for _, code in writer.functions.values()]
    return "\n".join([*writer.tables, *called, scan, *sorted(writer.declared), ""])
