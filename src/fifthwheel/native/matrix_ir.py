"""LLVM assembly of a step of matrices: a loop over elements for each CasADi instruction.

Code without loops (`llvm_ir`) has an instruction for each element of each product. Where there are tens of thousands,
the processor waits for its code. A step written with `casadi.MX` has a loop for each of its matrix instructions, in
vector registers, and calls the functions of `casadi.SX` that it contains, which are code without loops.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as ca

from fifthwheel.native.instructions import translate
from fifthwheel.native.llvm_ir import ArrayLayout, Emitter, Register, function

WIDTH = 8
"""Elements in a vector register."""
UNROLLED = 24
"""Terms of the elements of a product, or copied elements, up to which they are written without a loop."""

_ARRAYS = ("carry", "sample", "constant")
_COPIES = (ca.OP_RESHAPE, ca.OP_ASSIGN, ca.OP_SPARSITY_CAST)
_ONCE = {"start": 0, "stop": 1, "step": 1}
_CONCATENATIONS = (ca.OP_HORZCAT, ca.OP_VERTCAT, ca.OP_DIAGCAT)


class _Lines(Emitter):
    """An emitter of vectors of a width into lines that all widths share."""

    def __init__(self, name: str, width: int, lines: list[str], declared: set[str]) -> None:
        super().__init__(name, width)
        self.loop, self.intrinsics, self.prefix = lines, declared, f"%v{width}."

    def emit(self, text: str, invariant: bool) -> Register:
        """Write an instruction; its register."""
        self.count += 1
        self.loop.append(f"  {self.prefix}{self.count} = {text}")
        return f"{self.prefix}{self.count}", False

    def reciprocal(self, register: Register) -> Register:
        """One over a register, which is not shared: another loop may have computed it."""
        return self.emit(f"fdiv {self.type} {self.constant(1.0)}, {register[0]}", False)


@dataclass
class _Block:
    """Memory, and the number of matrices in it that are still to be read."""

    start: int
    size: int
    users: int = 0


@dataclass(frozen=True)
class _Matrix:
    """Where the elements of a matrix are, by columns."""

    size: int
    base: tuple[str, int] = ("", 0)  # array, and the place of the first element in it
    block: _Block | None = None  # in the memory of the step
    register: str | None = None  # of a single element
    uniform: float | None = None  # value of all elements, which are not in memory


class _Writer:
    """Writes the instructions of a step. The matrices of the step share its memory; results are written last."""

    def __init__(self, step: ca.Function) -> None:
        self.step = step
        self.lines: list[str] = []
        self.declared = set[str]()
        self.vectors = {width: _Lines(step.name(), width, self.lines, self.declared) for width in (1, 2, 4, WIDTH)}
        self.scalar = self.vectors[1]
        self.block, self.loops = "row", 0  # the present block, and the number of loops
        self.tables: list[str] = []
        self.functions: dict[str, str] = {}
        self.memory, self.free = 0, list[_Block]()
        self.matrices: dict[int, _Matrix] = {}  # by their place in CasADi's work vector
        self.dying: set[int] = set()  # places that no later instruction reads
        self.results: list[tuple[_Matrix, int]] = []  # of the next carry, with their places in it

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
                self._leave(matrix)
        for matrix, place in self.results:
            self._copy(matrix, ("%carry.here", place))

    def _instruction(self, op: int, node: ca.MX, inputs: Sequence[int], outputs: Sequence[int]) -> None:
        if op == ca.OP_OUTPUT:
            self._result(self.matrices[inputs[0]], node.info()["ind"], node.info()["offset"])
        elif op == ca.OP_CALL:
            self._call(node.which_function(), [self.matrices[place] for place in inputs], outputs)
        elif op == ca.OP_INPUT:
            info = node.info()
            self.matrices[outputs[0]] = _Matrix(node.nnz(), (f"%{_ARRAYS[info['ind']]}.here", info["offset"]))
        elif op == ca.OP_CONST:
            self.matrices[outputs[0]] = self._constant(node.to_DM().nonzeros())
        else:
            self.matrices[outputs[0]] = self._computed(op, node, inputs)

    def _result(self, matrix: _Matrix, result: int, place: int) -> None:
        """Write an output, or note a part of the next carry, which is written when nothing reads the last carry."""
        if result:
            self._copy(matrix, ("%output.here", place))
        elif matrix.base != ("%carry.here", place):
            if matrix.base[0] == "%carry.here":
                copied = self._reserved(matrix.size)
                self._copy(matrix, copied.base)
                matrix = copied
            else:
                self._enter(matrix)
            self.results.append((matrix, place))

    def _computed(self, op: int, node: ca.MX, inputs: Sequence[int]) -> _Matrix:
        size, operands = node.nnz(), [self.matrices[place] for place in inputs]
        source = operands[0]
        if size == 0:
            return _Matrix(0)
        if op == ca.OP_MTIMES:
            return self._product(node, inputs)
        if op == ca.OP_DOT:
            return self._single(self._dot(*operands))
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

    def _least(self, matrix: _Matrix) -> str:
        least = self._element(matrix, 0)
        for i in range(1, matrix.size):
            least = self.scalar.operation(ca.OP_FMIN, [(least, False), (self._element(matrix, i), False)])[0]
        return least

    def _concatenated(self, parts: Sequence[_Matrix], size: int) -> _Matrix:
        made, offset = self._reserved(size), 0
        for part in parts:
            self._copy(part, (made.base[0], made.base[1] + offset))
            offset += part.size
        return made

    def _reserved(self, size: int) -> _Matrix:
        """A matrix in memory that is free."""
        fitting = [block for block in self.free if block.size >= size]
        if fitting:
            block = min(fitting, key=lambda block: block.size)
            self.free.remove(block)
            if block.size > size:
                self.free.append(_Block(block.start + size, block.size - size))
            block.size = size
        else:
            block = _Block(self.memory, size)
            self.memory += size
        block.users = 1
        return _Matrix(size, ("%memory", block.start), block)

    def _reusable(self, place: int, size: int) -> _Matrix:
        """The memory of a matrix that is not read again, or other memory."""
        matrix = self.matrices[place]
        if (
            place in self.dying
            and matrix.block
            and matrix.block.users == 1
            and matrix.block.size == matrix.size == size
        ):
            return self._shared(matrix)
        return self._reserved(size)

    def _shared(self, matrix: _Matrix, first: int = 0, size: int | None = None) -> _Matrix:
        """Consecutive elements of a matrix, in the same memory."""
        self._enter(matrix)
        array, begin = matrix.base
        return _Matrix(matrix.size if size is None else size, (array, begin + first), matrix.block)

    def _enter(self, matrix: _Matrix) -> None:
        if matrix.block:
            matrix.block.users += 1

    def _leave(self, matrix: _Matrix) -> None:
        """One user of a matrix less; free memory joins that beside it."""
        block = matrix.block
        if block is None:
            return
        block.users -= 1
        if block.users:
            return
        for other in list(self.free):
            if other.start + other.size == block.start or block.start + block.size == other.start:
                self.free.remove(other)
                block = _Block(min(block.start, other.start), block.size + other.size)
        self.free.append(block)

    def _single(self, register: str) -> _Matrix:
        """A matrix with one element."""
        made = self._reserved(1)
        self._put(register, made.base, 0, 1)
        return replace(made, register=register)

    def _pointer(self, base: tuple[str, int], element: int | str) -> str:
        array, first = base
        if isinstance(element, int):
            first += element
        else:
            array, _ = self.scalar.emit(f"getelementptr double, ptr {array}, i64 {element}", False)
        return self.scalar.emit(f"getelementptr double, ptr {array}, i64 {first}", False)[0]

    def _load(self, base: tuple[str, int], element: int | str, width: int) -> str:
        vector = self.vectors[width]
        return vector.emit(f"load {vector.type}, ptr {self._pointer(base, element)}, align 8", False)[0]

    def _put(self, value: str, base: tuple[str, int], element: int | str, width: int) -> None:
        pointer = self._pointer(base, element)
        self.lines.append(f"  store {self.vectors[width].type} {value}, ptr {pointer}, align 8")

    def _element(self, matrix: _Matrix, element: int | str) -> str:
        """An element of a matrix, as a scalar."""
        return matrix.register or self._elements(matrix, element, 1)

    def _elements(self, matrix: _Matrix, element: int | str, width: int) -> str:
        """Consecutive elements of a matrix."""
        if matrix.uniform is not None:
            return self.vectors[width].constant(matrix.uniform)
        return self._load(matrix.base, element, width)

    def _spread(self, scalar: str, width: int) -> str:
        """A scalar in all lanes."""
        if width == 1:
            return scalar
        vector = self.vectors[width]
        first, _ = vector.emit(f"insertelement {vector.type} poison, double {scalar}, i64 0", False)
        zeros = f"<{width} x i32> zeroinitializer"
        return vector.emit(f"shufflevector {vector.type} {first}, {vector.type} poison, {zeros}", False)[0]

    def _total(self, value: str, width: int) -> str:
        """The sum of all lanes."""
        if width == 1:
            return value
        kind, name = self.vectors[width].type, f"llvm.vector.reduce.fadd.v{width}f64"
        self.declared.add(f"declare double @{name}(double, {kind})")
        zero = self.scalar.constant(0.0)
        return self.scalar.emit(f"call reassoc double @{name}(double {zero}, {kind} {value})", False)[0]

    def _loop(
        self,
        count: int,
        body: Callable[[str, list[str]], list[tuple[str, str]]],
        initial: Sequence[tuple[str, str]] = (),
    ) -> list[str]:
        """A loop of `count` turns. `body` has the number of the turn and registers that pass from turn to turn, and
        gives their next values, each with its type; the last ones."""
        self.loops += 1
        label, before, turn = f"loop.{self.loops}", self.block, f"%loop.{self.loops}.i"
        passed = [f"%{label}.{number}" for number in range(len(initial))]
        self.lines += [f"  br label %{label}", f"{label}:"]
        place = len(self.lines)
        self.lines += [""] * (1 + len(initial))
        self.block = label
        final = body(turn, passed)
        self.lines += [
            f"  {turn}.next = add i64 {turn}, 1",
            f"  {turn}.more = icmp slt i64 {turn}.next, {count}",
            f"  br i1 {turn}.more, label %{label}, label %{label}.end",
            f"{label}.end:",
        ]
        phis = [("i64", turn, "0", f"{turn}.next")]
        phis += [
            (kind, name, first, last) for name, (_, first), (kind, last) in zip(passed, initial, final, strict=True)
        ]
        for number, (kind, name, first, last) in enumerate(phis):
            self.lines[place + number] = f"  {name} = phi {kind} [{first}, %{before}], [{last}, %{self.block}]"
        self.block = f"{label}.end"
        return [last for _, last in final]

    def _each(self, size: int, body: Callable[[int | str, int], None]) -> None:
        """Do something for all elements, as many at a time as there are in a vector."""
        whole = size // WIDTH
        begin = 0
        if whole > 4:

            def turn(number: str, _: list[str]) -> list[tuple[str, str]]:
                body(self.scalar.emit(f"mul i64 {number}, {WIDTH}", False)[0], WIDTH)
                return []

            self._loop(whole, turn)
            begin = whole * WIDTH
        for element, width in _pieces(size - begin):
            body(begin + element, width)

    def _copy(self, matrix: _Matrix, target: tuple[str, int]) -> None:
        """Copy a matrix."""
        self._each(matrix.size, lambda i, width: self._put(self._elements(matrix, i, width), target, i, width))

    def _slice(self, matrix: _Matrix, first: int, size: int) -> _Matrix:
        """Consecutive elements of a matrix."""
        if matrix.uniform is not None:
            return _Matrix(size, uniform=matrix.uniform)
        return replace(self._shared(matrix, first, size), register=matrix.register)

    def _constant(self, values: Sequence[float]) -> _Matrix:
        if len(set(values)) <= 1:
            return _Matrix(len(values), uniform=values[0] if values else 0.0)
        numbers = ", ".join(f"double {self.scalar.constant(value)}" for value in values)
        return _Matrix(len(values), (self._table(f"[{len(values)} x double] [{numbers}]"), 0))

    def _table(self, content: str) -> str:
        name = f"@table.{len(self.tables)}"
        self.tables.append(f"{name} = private unnamed_addr constant {content}")
        return name

    def _places(self, elements: Sequence[int]) -> str:
        numbers = ", ".join(f"i32 {element}" for element in elements)
        return self._table(f"[{len(elements)} x i32] [{numbers}]")

    def _from_table(self, table: str, number: str) -> str:
        pointer, _ = self.scalar.emit(f"getelementptr i32, ptr {table}, i64 {number}", False)
        return self.scalar.emit(
            f"zext i32 {self.scalar.emit(f'load i32, ptr {pointer}, align 4', False)[0]} to i64", False
        )[0]

    def _gather(self, matrix: _Matrix, elements: Sequence[int]) -> _Matrix:
        """Any elements of a matrix."""
        made, begin = self._reserved(len(elements)), 0
        if len(elements) > UNROLLED and matrix.uniform is None:
            begin = len(elements) // WIDTH * WIDTH
            table, kind = self._places(elements[:begin]), self.vectors[WIDTH].type
            name, pointers = f"llvm.masked.gather.v{WIDTH}f64.v{WIDTH}p0", f"<{WIDTH} x ptr>"
            self.declared.add(f"declare {kind} @{name}({pointers}, i32, <{WIDTH} x i1>, {kind})")
            every = "<" + ", ".join(["i1 true"] * WIDTH) + ">"

            def turn(number: str, passed: list[str]) -> list[tuple[str, str]]:
                first, _ = self.scalar.emit(f"mul i64 {number}, {WIDTH}", False)
                at, _ = self.scalar.emit(f"getelementptr i32, ptr {table}, i64 {first}", False)
                places, _ = self.scalar.emit(f"load <{WIDTH} x i32>, ptr {at}, align 4", False)
                base = self._pointer(matrix.base, 0)
                where, _ = self.scalar.emit(f"getelementptr double, ptr {base}, <{WIDTH} x i32> {places}", False)
                arguments = f"{pointers} {where}, i32 8, <{WIDTH} x i1> {every}, {kind} poison"
                self._put(self.scalar.emit(f"call {kind} @{name}({arguments})", False)[0], made.base, first, WIDTH)
                return []

            self._loop(begin // WIDTH, turn)
        for i, element in enumerate(elements[begin:], begin):
            self._put(self._element(matrix, element), made.base, i, 1)
        return made

    def _scatter(self, matrix: _Matrix, elements: Sequence[int], size: int) -> _Matrix:
        """A matrix with these elements, and zeros elsewhere."""
        made, table = self._reserved(size), self._places(elements)
        self._each(size, lambda i, width: self._put(self.vectors[width].constant(0.0), made.base, i, width))

        def turn(number: str, _: list[str]) -> list[tuple[str, str]]:
            self._put(self._element(matrix, number), made.base, self._from_table(table, number), 1)
            return []

        if elements:
            self._loop(len(elements), turn)
        return made

    def _elementwise(self, op: int, inputs: Sequence[int], size: int) -> _Matrix:
        operands = [self.matrices[place] for place in inputs]
        if size == 1:
            return self._single(self.scalar.operation(op, [(self._element(each, 0), False) for each in operands])[0])
        scalars = {i: self._element(each, 0) for i, each in enumerate(operands) if each.size == 1}
        if op == ca.OP_DIV and 1 in scalars:
            op, scalars[1] = ca.OP_MUL, self.scalar.reciprocal((scalars[1], False))[0]
        widths = {width for _, width in _pieces(size)}
        spread = {(i, width): self._spread(value, width) for i, value in scalars.items() for width in widths}
        made = self._reusable(
            next(place for place, each in zip(inputs, operands, strict=True) if each.size == size), size
        )

        def body(element: int | str, width: int) -> None:
            values = [spread.get((i, width)) or self._elements(each, element, width) for i, each in enumerate(operands)]
            value, _ = self.vectors[width].operation(op, [(each, False) for each in values])
            self._put(value, made.base, element, width)

        self._each(size, body)
        return made

    def _add_product(self, total: str, a: str, b: str, width: int) -> str:
        vector = self.vectors[width]
        product = vector.operation(ca.OP_MUL, [(a, False), (b, False)])
        return vector.operation(ca.OP_ADD, [(total, False), product])[0]

    def _dot(self, a: _Matrix, b: _Matrix) -> str:
        """Sum of the products of all elements; four sums side by side."""
        size, sums, begin = a.size, dict[int, str](), 0
        vector = self.vectors[WIDTH]
        if size >= 8 * WIDTH:
            begin = size // (4 * WIDTH) * 4 * WIDTH

            def turn(number: str, totals: list[str]) -> list[tuple[str, str]]:
                first, _ = self.scalar.emit(f"mul i64 {number}, {4 * WIDTH}", False)
                places = [self.scalar.emit(f"add i64 {first}, {k * WIDTH}", False)[0] for k in range(4)]
                return [
                    (
                        vector.type,
                        self._add_product(total, self._elements(a, i, WIDTH), self._elements(b, i, WIDTH), WIDTH),
                    )
                    for total, i in zip(totals, places, strict=True)
                ]

            total, *others = self._loop(begin // (4 * WIDTH), turn, [(vector.type, vector.constant(0.0))] * 4)
            for other in others:
                total, _ = vector.operation(ca.OP_ADD, [(total, False), (other, False)])
            sums[WIDTH] = total
        for element, width in _pieces(size - begin):
            total = sums.get(width, self.vectors[width].constant(0.0))
            factors = self._elements(a, begin + element, width), self._elements(b, begin + element, width)
            sums[width] = self._add_product(total, factors[0], factors[1], width)
        return self._sum(sums, self.scalar.constant(0.0))

    def _sum(self, sums: dict[int, str], total: str) -> str:
        for width, value in sums.items():
            lanes = self._total(value, width)
            total, _ = self.scalar.operation(ca.OP_ADD, [(total, False), (lanes, False)])
        return total

    def _product(self, node: ca.MX, inputs: Sequence[int]) -> _Matrix:
        """z + x y; all are dense."""
        if not all(node.dep(i).is_dense() for i in range(3)):
            raise NotImplementedError(
                f"{self.step.name()}: a product of sparse matrices cannot be compiled; use densify"
            )
        z, x, y = (self.matrices[place] for place in inputs)
        (rows, columns), terms = node.shape, node.dep(1).shape[1]
        alone = inputs[0] not in inputs[1:]
        made = self._reusable(inputs[0], rows * columns) if alone else self._reserved(rows * columns)
        if rows == 1:
            return self._row_product(z, x, y, (terms, columns), made)
        pieces = _pieces(rows)
        for first in range(0, len(pieces), 4):
            self._block_product(z, x, y, (rows, terms, columns), pieces[first : first + 4], made)
        return made

    def _row_product(self, z: _Matrix, x: _Matrix, y: _Matrix, shape: tuple[int, int], made: _Matrix) -> _Matrix:
        terms, columns = shape
        factors = [(i, width, self._elements(x, i, width)) for i, width in _pieces(terms)]

        def column(number: str | int, _: list[str]) -> list[tuple[str, str]]:
            at = self._times(number, terms)
            sums = dict[int, str]()
            for i, width, factor in factors:
                value = self._elements(y, self._plus(at, i), width)
                sums[width] = self._add_product(
                    sums.get(width, self.vectors[width].constant(0.0)), factor, value, width
                )
            total = self._sum(sums, self._element(z, number))
            self._put(total, made.base, number, 1)
            return [("double", total)]

        if columns == 1:
            ((_, total),) = column(0, [])
            return replace(made, register=total)
        self._loop(columns, lambda number, passed: column(number, passed)[:0])
        return made

    def _block_product(
        self,
        z: _Matrix,
        x: _Matrix,
        y: _Matrix,
        shape: tuple[int, int, int],
        pieces: Sequence[tuple[int, int]],
        made: _Matrix,
    ) -> None:
        """Some rows of a product."""
        rows, terms, columns = shape

        def add_term(term: int | str, totals: Sequence[str], of_column: int | str) -> list[str]:
            factor = self._element(y, self._plus(of_column, term))
            of_term = self._times(term, rows)
            spread = {width: self._spread(factor, width) for width in dict.fromkeys(width for _, width in pieces)}
            return [
                self._add_product(total, self._elements(x, self._plus(of_term, i), width), spread[width], width)
                for total, (i, width) in zip(totals, pieces, strict=True)
            ]

        def column(number: int | str, _: list[str]) -> list[tuple[str, str]]:
            at, of_column = self._times(number, rows), self._times(number, terms)
            totals = [self._elements(z, self._plus(at, i), width) for i, width in pieces]
            kinds = [self.vectors[width].type for _, width in pieces]
            if terms <= UNROLLED:
                for term in range(terms):
                    totals = add_term(term, totals, of_column)
            else:
                totals = self._loop(
                    terms,
                    lambda term, passed: list(zip(kinds, add_term(term, passed, of_column), strict=True)),
                    list(zip(kinds, totals, strict=True)),
                )
            for total, (i, width) in zip(totals, pieces, strict=True):
                self._put(total, made.base, self._plus(at, i), width)
            return []

        if columns == 1:
            column(0, [])
        else:
            self._loop(columns, column)

    def _times(self, number: int | str, factor: int) -> int | str:
        return number * factor if isinstance(number, int) else self.scalar.emit(f"mul i64 {number}, {factor}", False)[0]

    def _plus(self, a: int | str, b: int | str) -> int | str:
        if isinstance(a, int) and isinstance(b, int):
            return a + b
        return self.scalar.emit(f"add i64 {a}, {b}", False)[0]

    def _call(self, called: ca.Function, arguments: Sequence[_Matrix], outputs: Sequence[int]) -> None:
        """Call a function without loops."""
        name = f"function.{called.name()}"
        if name not in self.functions:
            self.functions[name] = _without_loops(called, name, self.declared)
        written = [each if each.uniform is None else self._concatenated([each], each.size) for each in arguments]
        results = [self._reserved(called.nnz_out(number)) for number in range(called.n_out())]
        pointers = [self._pointer(each.base, 0) for each in (*written, *results)]
        self.lines.append(f"  call void @{name}(i64 1, i64 1, {', '.join(f'ptr {pointer}' for pointer in pointers)})")
        for each, argument in zip(written, arguments, strict=True):
            if each is not argument:
                self._leave(each)
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


def _pieces(size: int) -> list[tuple[int, int]]:
    """First element and width of vectors that cover a number of elements."""
    pieces, begin = [], 0
    for width in (WIDTH, 4, 2, 1):
        while size - begin >= width:
            pieces.append((begin, width))
            begin += width
    return pieces


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
    return function(name, emitter, layouts)


def matrix_module(step: ca.Function) -> str:
    """LLVM assembly of `void scan(...)` as `llvm_ir.module` with one lane, of a step written with `casadi.MX`.

    A NotImplementedError if an operation of the step cannot be translated.
    """
    writer = _Writer(step)
    writer.write()
    n_carry, n_sample, n_constant = (step.numel_in(i) for i in range(3))
    newline = "\n"
    return f"""{newline.join(writer.tables)}
{newline.join(writer.functions.values())}
define void @scan(i64 %samples, i64 %groups, ptr noalias %carry, ptr noalias %sample, ptr noalias %constant,
                  ptr noalias %output) {{
entry:
  %memory = alloca [{writer.memory} x double], align 64
  %no.samples = icmp sle i64 %samples, 0
  %no.groups = icmp sle i64 %groups, 0
  %nothing = or i1 %no.samples, %no.groups
  br i1 %nothing, label %done, label %group
group:
  %g = phi i64 [0, %entry], [%g.next, %group.end]
  %carry.at = mul i64 %g, {n_carry}
  %carry.here = getelementptr double, ptr %carry, i64 %carry.at
  %constant.at = mul i64 %g, {n_constant}
  %constant.here = getelementptr double, ptr %constant, i64 %constant.at
  %first = mul i64 %g, %samples
  br label %row
row.begin:
  br label %row
row:
  %k = phi i64 [0, %group], [%k.next, %row.begin]
  %number = add i64 %first, %k
  %sample.at = mul i64 %number, {n_sample}
  %sample.here = getelementptr double, ptr %sample, i64 %sample.at
  %output.at = mul i64 %number, {step.numel_out(1)}
  %output.here = getelementptr double, ptr %output, i64 %output.at
{newline.join(writer.lines)}
  %k.next = add i64 %k, 1
  %more.rows = icmp slt i64 %k.next, %samples
  br i1 %more.rows, label %row.begin, label %group.end
group.end:
  %g.next = add i64 %g, 1
  %more.groups = icmp slt i64 %g.next, %groups
  br i1 %more.groups, label %group, label %done
done:
  ret void
}}
{newline.join(sorted(writer.declared))}
"""
