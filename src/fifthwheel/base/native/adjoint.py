"""The compiled loop of a step and its directional derivatives, by the reverse mode: for models with many unknowns.

With many directions it is cheaper to compute the Jacobian of each step once, by rows, and to multiply it by the
directions, than to differentiate the step along each of them (A. Griewank and A. Walther, Evaluating Derivatives, 2008,
chapter 3). The lanes of the vector registers are the rows of the Jacobian.

A Jacobian is in single precision, which halves its time; values and products are in double precision. Estimates move by
less than 1e-4 of their sigmas.
"""

import ctypes
import functools
from concurrent.futures import Future
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.native.directions import Derivatives, check, copies
from fifthwheel.base.native.scan import load, workers
from fifthwheel.base.native.step import Step, compiling
from fifthwheel.base.types import Array

Single = NDArray[np.float32]
LANES = 16
"""Rows of the Jacobian in one vector register."""
BLOCK = 64
"""Samples whose Jacobians are kept at a time; they stay in the processor's cache."""
MOST_THREADS = 4
"""That compute Jacobians. One thread computes the values before and the products after, which takes a third as long."""


class AdjointScan:
    """A compiled step with its derivatives along any number of directions, whose number hardly changes the cost.

    The step maps (carry, sample, constant, nothing, seed) to (carry, output, nothing, adjoint). Of n + m seeds, n are
    for the first n elements of the carry, x, and m for the error e. `adjoint` (n + n_p) is the product of the seeds and
    the Jacobian of (x+, e) by (x, p), at a constant discrepancy d, the next m elements of the carry; p are the first
    n_p constants. The last 3 m elements of `output` are a, b and c of the derivatives of error and discrepancy:

        e' = (Jacobian) - a d',    d+' = b d' + c e'

    The first m elements of `output` are e. The step is compiled at the first call.

    Args:
        step: CasADi function; its inputs and outputs are dense column vectors.

    Raises:
        TypeError: the step has other inputs or outputs; for a `Step`, when it is built.
    """

    def __init__(self, step: ca.Function | Step) -> None:
        self._step = Step.of(step)
        self._compiled: _Compiled | None = None
        if not isinstance(step, Step):
            check(step)

    @property
    def step(self) -> ca.Function:
        """The CasADi function."""
        check(self._step.function)
        return self._step.function

    def __call__(
        self, carry: Array, sample: Array, constant: Array, carry_dot: Array, constant_dot: Array, *, threads: int = 1
    ) -> Derivatives:
        """Process the record of one vehicle.

        Args:
            carry: (n_carry,) before the first sample.
            sample: (N, n_sample).
            constant: (n_constant,).
            carry_dot: (k, n + m), derivatives of x and d along k directions; k may be 0.
            constant_dot: (k, n_p), derivatives of p.
            threads: number of threads, of which up to `MOST_THREADS` compute Jacobians, each of some samples.

        Raises:
            TypeError: an array has another shape.
            NotImplementedError: an operation of the step cannot be compiled.
        """
        n_carry, n_sample, n_constant, _, seeds, _, outputs, _, adjoint = self._step.sizes
        n, k = adjoint - constant_dot.shape[-1], len(carry_dot)
        m = seeds - n
        arrays = (carry, sample, constant, carry_dot, constant_dot)
        expected = [(n_carry,), (len(sample), n_sample), (n_constant,), (k, seeds), (k, adjoint - n)]
        carry, sample, constant, carry_dot, constant_dot = copies(self._step, arrays, expected)
        output, output_dot = np.empty((len(sample), outputs)), np.empty((len(sample), m, k))
        carry_dot = self._compile(n, m).run(
            carry, sample, constant, carry_dot, constant_dot, output, output_dot, threads
        )
        return Derivatives(carry, output[:, : outputs - 3 * m], carry_dot, output_dot)

    def __reduce__(self) -> tuple[Any, ...]:
        return AdjointScan, (self.step,)

    def _compile(self, n: int, m: int) -> "_Compiled":
        with compiling:
            if self._compiled is None:
                self._compiled = _Compiled(self._step, n, m)
            return self._compiled


def _translation(step: Step, n: int, m: int) -> list[Any]:
    from fifthwheel.base.native.direction_ir import direction_module
    from fifthwheel.base.native.propagation_ir import propagation

    source, *numbers = direction_module(step.function, LANES, "float")
    return [source + propagation(step.sizes, n, m, LANES), *numbers]


class _Compiled:
    """The machine code of the three loops."""

    def __init__(self, step: Step, n: int, m: int) -> None:
        self.n, self.seeds, self.adjoint = n, n + m, step.sizes[8]
        self.groups = -(-self.seeds // LANES)
        # owns the memory of the code, which is optimised: it takes most of the time of an identification
        self._program = load(step, f"adjoint {LANES}", functools.partial(_translation, step, n, m), optimisation=1)
        self.shared, self.fixed = self._program.numbers
        address = self._program.engine.get_function_address
        word, pointer = ctypes.c_int64, ctypes.c_void_p
        self.nominal: Any = ctypes.CFUNCTYPE(None, *[word] * 2, *[pointer] * 6)(address("nominal"))
        self.jacobian: Any = ctypes.CFUNCTYPE(None, *[word] * 3, *[pointer] * 5)(address("directions"))
        self.propagate: Any = ctypes.CFUNCTYPE(None, *[word] * 2, *[pointer] * 7)(address("propagate"))
        seeds = np.zeros((self.groups * LANES, self.seeds), np.float32)
        np.fill_diagonal(seeds, 1.0)
        self.seed_lanes = np.ascontiguousarray(seeds.reshape(self.groups, LANES, self.seeds).transpose(0, 2, 1))

    def run(
        self,
        carry: Array,
        sample: Array,
        constant: Array,
        carry_dot: Array,
        constant_dot: Array,
        output: Array,
        output_dot: Array,
        threads: int,
    ) -> Array:
        """Process a record; the carry is updated, the outputs are written. The derivatives of the last carry."""
        k, nothing, fixed = len(carry_dot), np.empty(0, np.float32), np.empty(self.fixed, np.float32)
        slopes = np.zeros((k, self.groups * LANES))
        slopes[:, : self.seeds] = carry_dot
        first, columns, values = _sparse(constant_dot, self.n)
        count = 1 if k == 0 or threads <= 1 else min(threads, MOST_THREADS) + 1  # blocks at work
        buffers = [
            (
                np.empty((BLOCK, self.shared), np.float32),
                np.empty((BLOCK, self.adjoint, self.groups, LANES), np.float32),
            )
            for _ in range(count)
        ]

        def nominal(begin: int, shared: Single) -> int:
            rows = min(BLOCK, len(sample) - begin)
            arrays = carry, sample[begin:], constant, output[begin:]
            self.nominal(
                rows, 1, *(a.ctypes.data for a in arrays), shared.ctypes.data if k else None, fixed.ctypes.data
            )
            return rows

        def jacobian(rows: int, shared: Single, adjoint: Single) -> None:
            arrays = nothing, self.seed_lanes, adjoint, shared, fixed
            self.jacobian(rows, self.groups, self.groups, *(a.ctypes.data for a in arrays))

        def propagate(begin: int, rows: int, adjoint: Single) -> None:
            arrays = adjoint, output[begin:], slopes, first, columns, values, output_dot[begin:]
            self.propagate(rows, k, *(a.ctypes.data for a in arrays))

        waiting: list[tuple[Future[None], int, int, Single]] = []

        def finish() -> None:
            done, begin, rows, adjoint = waiting.pop(0)
            done.result()
            propagate(begin, rows, adjoint)

        for number, begin in enumerate(range(0, len(sample), BLOCK)):
            shared, adjoint = buffers[number % count]
            if len(waiting) == count:
                finish()
            rows = nominal(begin, shared)
            if count > 1:
                waiting.append((workers().submit(jacobian, rows, shared, adjoint), begin, rows, adjoint))
            elif k:
                jacobian(rows, shared, adjoint)
                propagate(begin, rows, adjoint)
        while waiting:
            finish()
        return slopes[:, : self.seeds]


def _sparse(constant_dot: Array, n: int) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """The elements of the directions that are not zero: where those of each begin (k + 1,), columns, and values."""
    rows, columns = np.nonzero(constant_dot)
    first = np.searchsorted(rows, np.arange(len(constant_dot) + 1))
    return first.astype(np.int64), (columns + n).astype(np.int64), constant_dot[rows, columns]
