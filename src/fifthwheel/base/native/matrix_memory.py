"""Memory of the matrices of a step, which share it: a matrix is there until nothing reads it."""

from dataclasses import dataclass

from fifthwheel.base.native.loops import Address


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
