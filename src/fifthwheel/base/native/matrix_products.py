"""Products of matrices as loops."""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from fifthwheel.base.native.loops import WIDTH, Loops, pieces_of
from fifthwheel.base.native.matrix_memory import StoredMatrix

UNROLLED = 24
"""Terms of an element of a product up to which they are written without a loop."""


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
