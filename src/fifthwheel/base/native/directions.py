"""The compiled loop of a step and its directional derivatives over the samples of a record."""

import ctypes
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from fifthwheel.base.native.scan import load, workers
from fifthwheel.base.native.step import Step, compiling
from fifthwheel.base.types import Array

BUFFER = 400_000
"""Bytes of the values that pass from the nominal step to the derivatives; they stay in the processor's cache."""


class Derivatives(NamedTuple):
    """Result of a `DirectionScan` for N samples and k directions."""

    carry: Array  # (n_carry,) after the last sample
    output: Array  # (N, n_output)
    carry_dot: Array  # (k, n_carry_dot) after the last sample
    output_dot: Array  # (N, n_output_dot, k)


class DirectionScan:
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
        self._step, self.lanes = Step.of(step), lanes
        self._compiled: _Compiled | None = None
        if not isinstance(step, Step):
            check(step)

    @property
    def step(self) -> ca.Function:
        """The CasADi function."""
        check(self._step.function)
        return self._step.function

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of elements of the five inputs, then of the four outputs."""
        return self._step.sizes

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
        carry, sample, constant, carry_dot, constant_dot = copies(self._step, arrays, expected)
        compiled = self._compile()
        groups = -(-directions // self.lanes)
        output = np.empty((rows, sizes[6]))
        output_dot = np.empty((rows, sizes[8], groups, self.lanes))
        dots = [self._to_lanes(array, groups) for array in (carry_dot, constant_dot)]
        count = max(min(threads, groups), 1)
        edges = np.linspace(0, groups, count + 1).astype(int).tolist()
        carries = [carry.copy() for _ in range(count)]
        outputs = [output, *[np.empty_like(output) for _ in range(count - 1)]]

        def process(number: int) -> None:
            first, last = edges[number : number + 2]
            carry_dot, constant_dot = (dot[first:last] for dot in dots)
            slopes = output_dot[:, :, first:last]
            compiled.run(carries[number], sample, constant, outputs[number], carry_dot, constant_dot, slopes)

        if count == 1:
            process(0)
        else:
            list(workers().map(process, range(count)))
        last_dot = np.moveaxis(dots[0], -1, 1).reshape(groups * self.lanes, sizes[3])[:directions]
        slopes = output_dot.reshape(rows, output_dot.shape[1], groups * self.lanes)[..., :directions]
        return Derivatives(carries[0], output, last_dot, slopes)

    def __reduce__(self) -> tuple[Any, ...]:
        return DirectionScan, (self.step, self.lanes)

    def _compile(self) -> "_Compiled":
        with compiling:
            if self._compiled is None:
                self._compiled = _Compiled(self)
            return self._compiled

    def _to_lanes(self, array: Array, groups: int) -> Array:
        """(k, n) to (groups, n, lanes); unused lanes are zero."""
        padded = np.zeros((groups * self.lanes, array.shape[1]))
        padded[: len(array)] = array
        return np.ascontiguousarray(padded.reshape(groups, self.lanes, array.shape[1]).transpose(0, 2, 1))


def check(step: ca.Function) -> None:
    """A TypeError if a function is not a step with directions."""
    if step.n_in() != 5 or step.n_out() != 4:
        raise TypeError(
            f"{step.name()}: expected a step from (carry, sample, constant, carry_dot, constant_dot) to (carry, "
            f"output, carry_dot, output_dot), got {step}"
        )


def copies(step: Step, arrays: Sequence[Array], shapes: Sequence[tuple[int, ...]]) -> list[Array]:
    """Contiguous copies of the arguments of a step; a TypeError if one has another shape."""
    copied = [np.array(array, dtype=np.float64, order="C") for array in arrays]
    for array, shape in zip(copied, shapes, strict=True):
        if array.shape != shape:
            raise TypeError(f"{step.function.name()}: expected an array of shape {shape}, got {array.shape}")
    return copied


def _translation(scan: DirectionScan) -> list[Any]:
    from fifthwheel.base.native.direction_ir import direction_module

    return list(direction_module(scan.step, scan.lanes))


class _Compiled:
    """The machine code of both loops."""

    def __init__(self, scan: DirectionScan) -> None:
        translate = functools.partial(_translation, scan)
        # owns the memory of the code, which is optimised: it takes most of the time of an identification
        self._program = load(scan._step, f"directions {scan.lanes}", translate, optimisation=1)
        self.shared, self.fixed = self._program.numbers
        address = self._program.engine.get_function_address
        word, pointer = ctypes.c_int64, ctypes.c_void_p
        self.nominal: Any = ctypes.CFUNCTYPE(None, *[word] * 2, *[pointer] * 6)(address("nominal"))
        self.directions: Any = ctypes.CFUNCTYPE(None, *[word] * 3, *[pointer] * 5)(address("directions"))

    def run(
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
        size = max(BUFFER // (8 * max(self.shared, 1)), 16)
        buffers = np.empty((size, self.shared)), np.empty(self.fixed)
        shared, fixed = (buffer.ctypes.data for buffer in buffers)
        wanted = shared if len(carry_dot) else None
        state, source, numbers, result, state_dot, numbers_dot, result_dot = (
            array.ctypes.data for array in (carry, sample, constant, output, carry_dot, constant_dot, output_dot)
        )
        groups, pitch = len(carry_dot), output_dot.strides[1] // (8 * output_dot.shape[3])
        for begin in range(0, len(sample), size):
            rows = min(size, len(sample) - begin)
            here, there = source + begin * sample.strides[0], result + begin * output.strides[0]
            self.nominal(rows, 1, state, here, numbers, there, wanted, fixed)
            if groups:
                slopes = result_dot + begin * output_dot.strides[0]
                self.directions(rows, groups, pitch, state_dot, numbers_dot, slopes, shared, fixed)
