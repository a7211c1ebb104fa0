"""LLVM assembly of loops over the elements of matrices, which share the memory of a step; products as such loops."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as ca

from fifthwheel.base.native.llvm_ir import Emitter, Register

WIDTH = 8
"""Elements in a vector register."""
UNROLLED = 24
"""Terms of an element of a product up to which they are written without a loop."""

Address = tuple[str, int]
"""Of an element: a pointer, and the number of the element after it."""


@dataclass
class _Block:
    """Memory, and the number of matrices in it that are still to be read."""

    start: int
    size: int
    users: int = 0


@dataclass(frozen=True)
class StoredMatrix:
    """Where the elements of a matrix are, by columns."""

    size: int
    base: Address = ("%carry", 0)  # array, and the place of the first element in it
    block: _Block | None = None  # in the memory of the step
    register: str | None = None  # of a single element
    uniform: float | None = None  # value of all elements, which are not in memory

    @property
    def is_alone(self) -> bool:
        """Whether no other matrix is in its memory."""
        return self.block is not None and self.block.users == 1 and self.block.size == self.size


class Memory:
    """Reserves memory; `size` is the number of elements that are needed."""

    def __init__(self) -> None:
        self.size, self._free = 0, list[_Block]()

    def reserved(self, size: int) -> StoredMatrix:
        """A matrix in memory that is free."""
        fitting = [block for block in self._free if block.size >= size]
        if fitting:
            block = min(fitting, key=lambda block: block.size)
            self._free.remove(block)
            if block.size > size:
                self._free.append(_Block(block.start + size, block.size - size))
            block.size = size
        else:
            block = _Block(self.size, size)
            self.size += size
        block.users = 1
        return StoredMatrix(size, ("%memory", block.start), block)

    def shared(self, matrix: StoredMatrix, first: int = 0, size: int | None = None) -> StoredMatrix:
        """Consecutive elements of a matrix, in the same memory."""
        self.enter(matrix)
        array, begin = matrix.base
        return StoredMatrix(matrix.size if size is None else size, (array, begin + first), matrix.block)

    def enter(self, matrix: StoredMatrix) -> None:
        if matrix.block:
            matrix.block.users += 1

    def leave(self, matrix: StoredMatrix) -> None:
        """One user of a matrix less; free memory joins that beside it."""
        block = matrix.block
        if block is None:
            return
        block.users -= 1
        if block.users:
            return
        for other in list(self._free):
            if other.start + other.size == block.start or block.start + block.size == other.start:
                self._free.remove(other)
                block = _Block(min(block.start, other.start), block.size + other.size)
        self._free.append(block)


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


class Loops:
    """Writes loops one after another, or within another; an element is a number or a register with one."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.lines: list[str] = []
        self.declared = set[str]()
        self.tables: list[str] = []
        self.vectors = {width: _Lines(name, width, self.lines, self.declared) for width in (1, 2, 4, WIDTH)}
        self.scalar = self.vectors[1]
        self.block, self._count = "row", 0  # in which the lines end, and the number of loops

    def pointer(self, base: Address, element: int | str) -> str:
        """The address of an element after the base."""
        array, first = base
        if isinstance(element, int):
            first += element
        else:
            array, _ = self.scalar.emit(f"getelementptr double, ptr {array}, i64 {element}", False)
        return self.scalar.emit(f"getelementptr double, ptr {array}, i64 {first}", False)[0]

    def load(self, base: Address, element: int | str, width: int) -> str:
        """Consecutive elements from memory."""
        vector = self.vectors[width]
        return vector.emit(f"load {vector.type}, ptr {self.pointer(base, element)}, align 8", False)[0]

    def put(self, value: str, base: Address, element: int | str, width: int) -> None:
        """Write consecutive elements to memory."""
        pointer = self.pointer(base, element)
        self.lines.append(f"  store {self.vectors[width].type} {value}, ptr {pointer}, align 8")

    def spread(self, scalar: str, width: int) -> str:
        """A scalar in all lanes."""
        if width == 1:
            return scalar
        vector = self.vectors[width]
        first, _ = vector.emit(f"insertelement {vector.type} poison, double {scalar}, i64 0", False)
        zeros = f"<{width} x i32> zeroinitializer"
        return vector.emit(f"shufflevector {vector.type} {first}, {vector.type} poison, {zeros}", False)[0]

    def total(self, value: str, width: int) -> str:
        """The sum of all lanes."""
        if width == 1:
            return value
        kind, name = self.vectors[width].type, f"llvm.vector.reduce.fadd.v{width}f64"
        self.declared.add(f"declare double @{name}(double, {kind})")
        zero = self.scalar.constant(0.0)
        return self.scalar.emit(f"call reassoc double @{name}(double {zero}, {kind} {value})", False)[0]

    def loop(
        self,
        count: int,
        body: Callable[[str, list[str]], list[tuple[str, str]]],
        initial: Sequence[tuple[str, str]] = (),
    ) -> list[str]:
        """A loop of `count` turns. `body` has the number of the turn and registers that pass from turn to turn, and
        gives their next values, each with its type; the last ones."""
        self._count += 1
        label, before, turn = f"loop.{self._count}", self.block, f"%loop.{self._count}.i"
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

    def each(self, size: int, body: Callable[[int | str, int], None]) -> None:
        """Do something for all elements, as many at a time as there are in a vector."""
        whole = size // WIDTH
        begin = 0
        if whole > 4:

            def turn(number: str, _: list[str]) -> list[tuple[str, str]]:
                body(self.scalar.emit(f"mul i64 {number}, {WIDTH}", False)[0], WIDTH)
                return []

            self.loop(whole, turn)
            begin = whole * WIDTH
        for element, width in pieces_of(size - begin):
            body(begin + element, width)

    def table(self, content: str) -> str:
        """A constant array; its name."""
        name = f"@table.{len(self.tables)}"
        self.tables.append(f"{name} = private unnamed_addr constant {content}")
        return name

    def places(self, elements: Sequence[int]) -> str:
        """A constant array of places of elements."""
        numbers = ", ".join(f"i32 {element}" for element in elements)
        return self.table(f"[{len(elements)} x i32] [{numbers}]")

    def from_table(self, table: str, number: str) -> str:
        """An element of such an array."""
        pointer, _ = self.scalar.emit(f"getelementptr i32, ptr {table}, i64 {number}", False)
        place, _ = self.scalar.emit(f"load i32, ptr {pointer}, align 4", False)
        return self.scalar.emit(f"zext i32 {place} to i64", False)[0]

    def add_product(self, total: str, a: str, b: str, width: int) -> str:
        """total + a b."""
        vector = self.vectors[width]
        product = vector.operation(ca.OP_MUL, [(a, False), (b, False)])
        return vector.operation(ca.OP_ADD, [(total, False), product])[0]

    def sum_of(self, sums: dict[int, str], total: str) -> str:
        """A scalar and all lanes of some vectors, by their widths."""
        for width, value in sums.items():
            lanes = self.total(value, width)
            total, _ = self.scalar.operation(ca.OP_ADD, [(total, False), (lanes, False)])
        return total

    def times(self, number: int | str, factor: int) -> int | str:
        """The number of an element times a factor."""
        return number * factor if isinstance(number, int) else self.scalar.emit(f"mul i64 {number}, {factor}", False)[0]

    def plus(self, a: int | str, b: int | str) -> int | str:
        """The sum of two numbers of elements."""
        if isinstance(a, int) and isinstance(b, int):
            return a + b
        return self.scalar.emit(f"add i64 {a}, {b}", False)[0]


def pieces_of(size: int) -> list[tuple[int, int]]:
    """First element and width of vectors that cover a number of elements."""
    pieces, begin = [], 0
    for width in (WIDTH, 4, 2, 1):
        while size - begin >= width:
            pieces.append((begin, width))
            begin += width
    return pieces


class Products(Loops):
    """Writes products of dense matrices, which are stored by columns."""

    def element(self, matrix: StoredMatrix, element: int | str) -> str:
        """An element of a matrix, as a scalar."""
        return matrix.register or self.elements(matrix, element, 1)

    def elements(self, matrix: StoredMatrix, element: int | str, width: int) -> str:
        """Consecutive elements of a matrix."""
        if matrix.uniform is not None:
            return self.vectors[width].constant(matrix.uniform)
        return self.load(matrix.base, element, width)

    def dot(self, a: StoredMatrix, b: StoredMatrix) -> str:
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
                        self.add_product(total, self.elements(a, i, WIDTH), self.elements(b, i, WIDTH), WIDTH),
                    )
                    for total, i in zip(totals, places, strict=True)
                ]

            total, *others = self.loop(begin // (4 * WIDTH), turn, [(vector.type, vector.constant(0.0))] * 4)
            for other in others:
                total, _ = vector.operation(ca.OP_ADD, [(total, False), (other, False)])
            sums[WIDTH] = total
        for element, width in pieces_of(size - begin):
            total = sums.get(width, self.vectors[width].constant(0.0))
            factors = self.elements(a, begin + element, width), self.elements(b, begin + element, width)
            sums[width] = self.add_product(total, factors[0], factors[1], width)
        return self.sum_of(sums, self.scalar.constant(0.0))

    def product(
        self, z: StoredMatrix, x: StoredMatrix, y: StoredMatrix, shape: tuple[int, int, int], made: StoredMatrix
    ) -> StoredMatrix:
        """z + x y of the shape (rows, terms of an element, columns), in memory that may be that of z."""
        rows, terms, columns = shape
        if rows == 1:
            return self._row_product(z, x, y, (terms, columns), made)
        pieces = pieces_of(rows)
        for first in range(0, len(pieces), 4):
            self._block_product(z, x, y, shape, pieces[first : first + 4], made)
        return made

    def _row_product(
        self, z: StoredMatrix, x: StoredMatrix, y: StoredMatrix, shape: tuple[int, int], made: StoredMatrix
    ) -> StoredMatrix:
        terms, columns = shape
        factors = [(i, width, self.elements(x, i, width)) for i, width in pieces_of(terms)]

        def column(number: str | int, _: list[str]) -> list[tuple[str, str]]:
            at = self.times(number, terms)
            sums = dict[int, str]()
            for i, width, factor in factors:
                value = self.elements(y, self.plus(at, i), width)
                sums[width] = self.add_product(sums.get(width, self.vectors[width].constant(0.0)), factor, value, width)
            total = self.sum_of(sums, self.element(z, number))
            self.put(total, made.base, number, 1)
            return [("double", total)]

        if columns == 1:
            ((_, total),) = column(0, [])
            return replace(made, register=total)
        self.loop(columns, lambda number, passed: column(number, passed)[:0])
        return made

    def _block_product(
        self,
        z: StoredMatrix,
        x: StoredMatrix,
        y: StoredMatrix,
        shape: tuple[int, int, int],
        pieces: Sequence[tuple[int, int]],
        made: StoredMatrix,
    ) -> None:
        """Some rows of a product."""
        rows, terms, columns = shape

        def add_term(term: int | str, totals: Sequence[str], of_column: int | str) -> list[str]:
            factor = self.element(y, self.plus(of_column, term))
            of_term = self.times(term, rows)
            spread = {width: self.spread(factor, width) for width in dict.fromkeys(width for _, width in pieces)}
            return [
                self.add_product(total, self.elements(x, self.plus(of_term, i), width), spread[width], width)
                for total, (i, width) in zip(totals, pieces, strict=True)
            ]

        def column(number: int | str, _: list[str]) -> list[tuple[str, str]]:
            at, of_column = self.times(number, rows), self.times(number, terms)
            totals = [self.elements(z, self.plus(at, i), width) for i, width in pieces]
            kinds = [self.vectors[width].type for _, width in pieces]
            if terms <= UNROLLED:
                for term in range(terms):
                    totals = add_term(term, totals, of_column)
            else:
                totals = self.loop(
                    terms,
                    lambda term, passed: list(zip(kinds, add_term(term, passed, of_column), strict=True)),
                    list(zip(kinds, totals, strict=True)),
                )
            for total, (i, width) in zip(totals, pieces, strict=True):
                self.put(total, made.base, self.plus(at, i), width)
            return []

        if columns == 1:
            column(0, [])
        else:
            self.loop(columns, column)
