"""LLVM assembly of loops over vectors of elements."""

from collections.abc import Callable, Sequence

import casadi as ca

from fifthwheel.base.native.llvm_ir import Emitter, Register

WIDTH = 8
"""Elements in a vector register."""

Address = tuple[str, int]
"""Of an element: a pointer, and the number of the element after it."""


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
