"""The compiled loop of a step and its directional derivatives over the samples of a record, by either mode.

`DirectionScan` differentiates the step along each direction, in forward mode. With many unknowns it is cheaper to
compute the Jacobian of each step once, by rows, and to multiply it by the directions (A. Griewank and A. Walther,
Evaluating Derivatives, 2008, chapter 3), as `AdjointScan` does. There the lanes of the vector registers are the rows of
the Jacobian, which is in single precision. That halves its time; values and products are in double precision. Estimates
move by less than 1e-4 of their sigmas.
"""

import ctypes
import functools
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.native.scan import load, workers
from fifthwheel.base.native.step import Step, compiling
from fifthwheel.base.types import Array

BUFFER = 400_000
"""Bytes of the values that pass from the nominal step to the derivatives; they stay in the processor's cache."""
ROWS = 16
"""Rows of the Jacobian in one vector register."""
BLOCK = 64
"""Samples whose Jacobians are kept at a time; they stay in the processor's cache."""
MOST_THREADS = 4
"""That compute Jacobians. One thread computes the values before and the products after, which takes a third as long."""

Single = NDArray[np.float32]


class Derivatives(NamedTuple):
    """Result of a `DirectionScan` or `AdjointScan` for N samples and k directions."""

    carry: Array  # (n_carry,) after the last sample
    output: Array  # (N, n_output)
    carry_dot: Array  # (k, n_carry_dot) after the last sample
    output_dot: Array  # (N, n_output_dot, k)


class _Scan:
    """A step with derivatives, which is compiled at the first call."""

    def __init__(self, step: ca.Function | Step) -> None:
        self._step = Step.of(step)
        self._loops: _Loops | None = None
        if not isinstance(step, Step):
            _check(step)

    @property
    def step(self) -> ca.Function:
        """The CasADi function."""
        _check(self._step.function)
        return self._step.function

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of elements of the five inputs, then of the four outputs."""
        return self._step.sizes

    def _compiled(self, form: str, translate: Callable[[], list[Any]]) -> "_Loops":
        with compiling:
            if self._loops is None:
                self._loops = _Loops(self._step, form, translate)
            return self._loops

    def _copies(self, arrays: Sequence[Array], shapes: Sequence[tuple[int, ...]]) -> list[Array]:
        """Contiguous copies of the arguments; a TypeError if one has another shape."""
        copied = [np.array(array, dtype=np.float64, order="C") for array in arrays]
        for array, shape in zip(copied, shapes, strict=True):
            if array.shape != shape:
                raise TypeError(f"{self.step.name()}: expected an array of shape {shape}, got {array.shape}")
        return copied


class _Loops:
    """The machine code of the loops of a step, see `direction_ir`; it is optimised, because it takes most of the time
    of an identification."""

    def __init__(self, step: Step, form: str, translate: Callable[[], list[Any]]) -> None:
        self._program = load(step, form, translate, optimisation=1)  # owns the memory of the code
        self.shared, self.fixed = self._program.numbers
        self.nominal = self.function("nominal", 2, 6)
        self.directions = self.function("directions", 3, 5)

    def function(self, name: str, numbers: int, arrays: int) -> Any:
        """A loop, which takes numbers and then addresses of arrays."""
        prototype = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * numbers, *[ctypes.c_void_p] * arrays)
        return prototype(self._program.engine.get_function_address(name))


class DirectionScan(_Scan):
    """A compiled step with its derivatives along any number of directions.

    The step maps (carry, sample, constant, carry', constant') to (carry, output, carry', output'). What does not depend
    on a direction is computed once for all. The step is compiled at the first call.

    Args:
        step: CasADi function; its inputs and outputs are dense column vectors.
        lanes: number of directions in one vector register.

    Raises:
        TypeError: the step has other inputs or outputs; for a `Step`, when it is built.
    """

    def __init__(self, step: ca.Function | Step, lanes: int = 8) -> None:
        super().__init__(step)
        self.lanes = lanes

    def __reduce__(self) -> tuple[Any, ...]:
        return DirectionScan, (self.step, self.lanes)

    def __call__(
        self, carry: Array, sample: Array, constant: Array, carry_dot: Array, constant_dot: Array, *, threads: int = 1
    ) -> Derivatives:
        """Process the record of one vehicle.

        Args:
            carry: (n_carry,) before the first sample.
            sample: (N, n_sample).
            constant: (n_constant,).
            carry_dot: (k, n_carry_dot), derivatives of the carry along k directions; k may be 0.
            constant_dot: (k, n_constant_dot).
            threads: number of threads; each processes some of the directions.

        Raises:
            TypeError: an array has another shape.
            NotImplementedError: an operation of the step cannot be compiled.
        """
        rows, directions, sizes = len(sample), len(carry_dot), self.sizes
        arrays = (carry, sample, constant, carry_dot, constant_dot)
        expected = [(sizes[0],), (rows, sizes[1]), (sizes[2],), (directions, sizes[3]), (directions, sizes[4])]
        carry, sample, constant, carry_dot, constant_dot = self._copies(arrays, expected)
        groups = -(-directions // self.lanes)
        output = np.empty((rows, sizes[6]))
        output_dot = np.empty((rows, sizes[8], groups, self.lanes))
        dots = [self._to_lanes(array, groups) for array in (carry_dot, constant_dot)]
        count = max(min(threads, groups), 1)
        edges = [groups * number // count for number in range(count + 1)]
        carries = [carry.copy() for _ in range(count)]
        outputs = [output, *[np.empty_like(output) for _ in range(count - 1)]]

        def process(number: int) -> None:
            first, last = edges[number : number + 2]
            carry_dot, constant_dot = (dot[first:last] for dot in dots)
            slopes = output_dot[:, :, first:last]
            self._run(carries[number], sample, constant, outputs[number], carry_dot, constant_dot, slopes)

        if count == 1:
            process(0)
        else:
            list(workers().map(process, range(count)))
        last_dot = np.moveaxis(dots[0], -1, 1).reshape(groups * self.lanes, sizes[3])[:directions]
        slopes = output_dot.reshape(rows, output_dot.shape[1], groups * self.lanes)[..., :directions]
        return Derivatives(carries[0], output, last_dot, slopes)

    def _run(
        self,
        carry: Array,
        sample: Array,
        constant: Array,
        output: Array,
        carry_dot: Array,
        constant_dot: Array,
        output_dot: Array,
    ) -> None:
        """Process a record; the carries are updated, and the outputs are written.

        carry_dot and constant_dot are (groups, n, lanes), output_dot (N, n_output_dot, groups, lanes) is a view of an
        array with more groups.
        """
        loops = self._compiled(f"directions {self.lanes}", self._translation)
        size = max(BUFFER // (8 * max(loops.shared, 1)), 16)
        buffers = np.empty((size, loops.shared)), np.empty(loops.fixed)
        shared, fixed = (buffer.ctypes.data for buffer in buffers)
        wanted = shared if len(carry_dot) else None
        state, source, numbers, result, state_dot, numbers_dot, result_dot = (
            array.ctypes.data for array in (carry, sample, constant, output, carry_dot, constant_dot, output_dot)
        )
        groups, pitch = len(carry_dot), output_dot.strides[1] // (8 * output_dot.shape[3])
        for begin in range(0, len(sample), size):
            rows = min(size, len(sample) - begin)
            here, there = source + begin * sample.strides[0], result + begin * output.strides[0]
            loops.nominal(rows, 1, state, here, numbers, there, wanted, fixed)
            if groups:
                slopes = result_dot + begin * output_dot.strides[0]
                loops.directions(rows, groups, pitch, state_dot, numbers_dot, slopes, shared, fixed)

    def _translation(self) -> list[Any]:
        from fifthwheel.base.native.direction_ir import direction_module

        return list(direction_module(self.step, self.lanes))

    def _to_lanes(self, array: Array, groups: int) -> Array:
        """(k, n) to (groups, n, lanes); unused lanes are zero."""
        padded = np.zeros((groups * self.lanes, array.shape[1]))
        padded[: len(array)] = array
        return np.ascontiguousarray(padded.reshape(groups, self.lanes, array.shape[1]).transpose(0, 2, 1))


class AdjointScan(_Scan):
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

    def __reduce__(self) -> tuple[Any, ...]:
        return AdjointScan, (self.step,)

    def __call__(
        self, carry: Array, sample: Array, constant: Array, carry_dot: Array, constant_dot: Array, *, threads: int = 1
    ) -> Derivatives:
        """Process the record of one vehicle; else as a `DirectionScan`.

        Args:
            carry: (n_carry,) before the first sample.
            sample: (N, n_sample).
            constant: (n_constant,).
            carry_dot: (k, n + m), derivatives of x and d along k directions; k may be 0.
            constant_dot: (k, n_p), derivatives of p.
            threads: number of threads, of which up to `MOST_THREADS` compute Jacobians, each of some samples.
        """
        n_carry, n_sample, n_constant, _, seeds, _, outputs, _, adjoint = self.sizes
        n, k, rows = adjoint - constant_dot.shape[-1], len(carry_dot), len(sample)
        m = seeds - n
        arrays = (carry, sample, constant, carry_dot, constant_dot)
        expected = [(n_carry,), (rows, n_sample), (n_constant,), (k, seeds), (k, adjoint - n)]
        carry, sample, constant, carry_dot, constant_dot = self._copies(arrays, expected)
        output, output_dot = np.empty((rows, outputs)), np.empty((rows, m, k))
        loops = self._compiled(f"adjoint {ROWS}", functools.partial(self._translation, n, m))
        propagation, groups = loops.function("propagate", 2, 7), -(-seeds // ROWS)
        slopes = np.zeros((k, groups * ROWS))
        slopes[:, :seeds] = carry_dot
        first, columns, values = _sparse(constant_dot, n)
        nothing, seed_lanes, fixed = np.empty(0, np.float32), _seed_lanes(seeds), np.empty(loops.fixed, np.float32)
        count = 1 if k == 0 or threads <= 1 else min(threads, MOST_THREADS) + 1  # blocks at work
        shapes = (BLOCK, loops.shared), (BLOCK, adjoint, groups, ROWS)
        buffers = [[np.empty(shape, np.float32) for shape in shapes] for _ in range(count)]

        def nominal(begin: int, shared: Single) -> int:
            size = min(BLOCK, rows - begin)
            here = carry, sample[begin:], constant, output[begin:]
            loops.nominal(size, 1, *_addresses(*here), shared.ctypes.data if k else None, fixed.ctypes.data)
            return size

        def jacobian(size: int, shared: Single, jacobians: Single) -> None:
            loops.directions(size, groups, groups, *_addresses(nothing, seed_lanes, jacobians, shared, fixed))

        def propagate(begin: int, size: int, jacobians: Single) -> None:
            here = jacobians, output[begin:], slopes, first, columns, values, output_dot[begin:]
            propagation(size, k, *_addresses(*here))

        waiting: list[tuple[Future[None], int, int, Single]] = []

        def finish() -> None:
            done, begin, size, jacobians = waiting.pop(0)
            done.result()
            propagate(begin, size, jacobians)

        for number, begin in enumerate(range(0, rows, BLOCK)):
            shared, jacobians = buffers[number % count]
            if len(waiting) == count:
                finish()
            size = nominal(begin, shared)
            if count > 1:
                waiting.append((workers().submit(jacobian, size, shared, jacobians), begin, size, jacobians))
            elif k:
                jacobian(size, shared, jacobians)
                propagate(begin, size, jacobians)
        while waiting:
            finish()
        return Derivatives(carry, output[:, : outputs - 3 * m], slopes[:, :seeds], output_dot)

    def _translation(self, n: int, m: int) -> list[Any]:
        from fifthwheel.base.native.direction_ir import direction_module, propagation

        source, *numbers = direction_module(self._step.function, ROWS, "float")
        return [source + propagation(self.sizes, n, m, ROWS), *numbers]


class GradientScan(_Scan):
    """A compiled step with the gradient of a function of its outputs, which takes the time of a few steps.

    The step maps (carry, sample, constant, gradient, nothing) to (carry, output, gradient, nothing). The last elements
    of a sample are the derivatives of the function by the outputs there. `gradient` is that by the carry after the
    step and by constants; the step adds its own part and gives that by the carry before it. Samples are processed
    forwards and then, in blocks from stored carries, backwards. The step is compiled at the first call.

    Args:
        step: CasADi function; its inputs and outputs are dense column vectors.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return GradientScan, (self.step,)

    def __call__(self, carry: Array, sample: Array, constant: Array, derivatives: Callable[[Array], Array]) -> Array:
        """The gradient (n_gradient,) before the first sample.

        Args:
            carry: (n_carry,) before the first sample.
            sample: (N, n), without derivatives.
            constant: (n_constant,).
            derivatives: those of the function (N, n_sample - n), from the outputs (N, n_output).

        Raises:
            TypeError, NotImplementedError: as for a `DirectionScan`.
        """
        (rows, given), sizes = sample.shape, self.sizes
        seeds = np.zeros((rows, sizes[1] - given))
        arrays = carry, np.hstack([sample, seeds]), constant
        carry, sample, constant = self._copies(arrays, [(sizes[0],), (rows, sizes[1]), (sizes[2],)])
        loops = self._compiled("gradient", self._translation)
        output, gradient, nothing = np.empty((rows, sizes[6])), np.zeros(sizes[3]), np.empty(0)
        shared, fixed = np.empty((BLOCK, loops.shared)), np.empty(loops.fixed)

        def nominal(begin: int, carry: Array, *, wanted: bool) -> int:
            size: int = min(BLOCK, rows - begin)
            here, last = (carry, sample[begin:], constant, output[begin:]), shared[size - 1].ctypes.data
            loops.nominal(size, 1, *_addresses(*here), last if wanted else None, fixed.ctypes.data)
            return size

        carries = []
        for begin in range(0, rows, BLOCK):
            carries.append(carry.copy())
            nominal(begin, carry, wanted=False)
        sample[:, given:] = derivatives(output)
        for number, start in reversed(list(enumerate(carries))):
            size = nominal(number * BLOCK, start, wanted=True)
            loops.directions(size, 1, 1, *_addresses(gradient, nothing, nothing, shared, fixed))
        return gradient

    def _translation(self) -> list[Any]:
        from fifthwheel.base.native.direction_ir import direction_module

        return list(direction_module(self.step, 1, backwards=True))


def _check(step: ca.Function) -> None:
    """A TypeError if a function is not a step with directions."""
    if step.n_in() != 5 or step.n_out() != 4:
        raise TypeError(
            f"{step.name()}: expected a step from (carry, sample, constant, carry_dot, constant_dot) to (carry, "
            f"output, carry_dot, output_dot), got {step}"
        )


def _addresses(*arrays: NDArray[Any]) -> list[int]:
    return [array.ctypes.data for array in arrays]


def _seed_lanes(seeds: int) -> Single:
    """(groups, seeds, lanes): a lane has the seed of its row of the Jacobian."""
    groups = -(-seeds // ROWS)
    rows = np.eye(groups * ROWS, seeds, dtype=np.float32)
    return np.ascontiguousarray(rows.reshape(groups, ROWS, seeds).transpose(0, 2, 1))


def _sparse(constant_dot: Array, n: int) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """The elements of the directions that are not zero: where those of each begin (k + 1,), columns, and values."""
    rows, columns = np.nonzero(constant_dot)
    first = np.searchsorted(rows, np.arange(len(constant_dot) + 1))
    return first.astype(np.int64), (columns + n).astype(np.int64), constant_dot[rows, columns]
