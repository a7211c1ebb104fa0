"""The compiled loop of a symbolic step over the samples of a record, for one vehicle or for many."""

import ctypes
import functools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import casadi as ca
import llvmlite
import llvmlite.binding as llvm
import numpy as np

from fifthwheel.base.native import cache
from fifthwheel.base.native.step import Step, compiling
from fifthwheel.base.types import Array


class Scan:
    """A compiled step, and its loops over samples and vehicles.

    The step maps (carry, sample, constant) to (carry, output). It is compiled at the first call. The loop over the
    samples allocates no memory, does not enter the Python interpreter, and releases its lock. A copy, also in another
    process, is a scan of the same step that is compiled again or read from the cache.

    Args:
        step: CasADi function; its inputs and outputs are dense column vectors.
        lanes: number of vehicles in one vector register in `batch`.
        matrices: the step is written with `casadi.MX`, and has loops over elements (`matrix_ir`) in place of lanes.
        optimised: by LLVM's code generator (`load`), as a step with matrices always is.

    Raises:
        TypeError: the step has other inputs or outputs; for a `Step`, when it is built.
    """

    def __init__(
        self, step: ca.Function | Step, lanes: int = 4, *, matrices: bool = False, optimised: bool = False
    ) -> None:
        self._step = Step.of(step)
        self.lanes, self._matrices, self._optimised = 1 if matrices else lanes, matrices, matrices or optimised
        self._compiled: dict[int, Any] = {}
        self._engines: list[Any] = []  # they own the memory of the code
        if not isinstance(step, Step):
            _check(step)

    @property
    def step(self) -> ca.Function:
        """The CasADi function."""
        _check(self._step.function)
        return self._step.function

    @property
    def n_carry(self) -> int:
        """Number of elements of the carry."""
        return self._step.sizes[0]

    @property
    def n_sample(self) -> int:
        """Number of elements of a sample."""
        return self._step.sizes[1]

    @property
    def n_constant(self) -> int:
        """Number of elements of the constant."""
        return self._step.sizes[2]

    @property
    def n_output(self) -> int:
        """Number of elements of an output."""
        return self._step.sizes[4]

    def __call__(self, carry: Array, sample: Array, constant: Array) -> tuple[Array, Array]:
        """Process the record of one vehicle.

        Args:
            carry: (n_carry,) before the first sample.
            sample: (N, n_sample).
            constant: (n_constant,).

        Returns:
            The carry after the last sample (n_carry,) and the outputs (N, n_output).

        Raises:
            TypeError: an array has another shape.
            NotImplementedError: an operation of the step cannot be compiled.
        """
        carry = np.array(carry, dtype=np.float64)
        sample = np.ascontiguousarray(sample, dtype=np.float64)
        constant = np.ascontiguousarray(constant, dtype=np.float64)
        rows = len(sample)
        self._expect("carry", carry.shape, (self.n_carry,))
        self._expect("sample", sample.shape, (rows, self.n_sample))
        self._expect("constant", constant.shape, (self.n_constant,))
        output = np.empty((rows, self.n_output))
        self.single(rows, 1, carry.ctypes.data, sample.ctypes.data, constant.ctypes.data, output.ctypes.data)
        return carry, output

    def batch(self, carry: Array, sample: Array, constant: Array) -> tuple[Array, Array]:
        """Process the records of B vehicles, `lanes` at a time.

        Args:
            carry: (B, n_carry).
            sample: (B, N, n_sample), or (N, n_sample) if all vehicles have the same record.
            constant: (B, n_constant).

        Returns:
            The carries (B, n_carry) and the outputs (B, N, n_output).

        Raises:
            TypeError, NotImplementedError: as for one vehicle.
        """
        vehicles, rows = len(carry), sample.shape[-2] if sample.ndim > 1 else 0
        records = (vehicles,) * (sample.ndim == 3)
        self._expect("sample", sample.shape, (*records, rows, self.n_sample))
        sample = np.broadcast_to(sample, (vehicles, rows, self.n_sample))
        self._expect("carry", carry.shape, (vehicles, self.n_carry))
        self._expect("constant", constant.shape, (vehicles, self.n_constant))
        carry, sample, constant = (self._to_lanes(array) for array in (carry, sample, constant))
        output = np.empty((len(carry), rows, self.n_output, self.lanes))
        self.vector(rows, len(carry), *(array.ctypes.data for array in (carry, sample, constant, output)))
        return self._from_lanes(carry, vehicles), self._from_lanes(output, vehicles)

    def bound(self, carry: Array, sample: Array, constant: Array, output: Array) -> Callable[[], None]:
        """A call that processes one sample in the memory of these arrays, (n,) each, which it keeps. It checks nothing:
        they must be as `__call__` makes them."""
        one, arrays = ctypes.c_int64(1), (carry, sample, constant, output)
        return functools.partial(self.single, one, one, *(a.ctypes.data_as(ctypes.c_void_p) for a in arrays))

    @property
    def single(self) -> Any:
        """The compiled loop for one vehicle; its arguments are addresses (see `llvm_ir.module`)."""
        return self._compiled.get(1) or self._compile(1)

    @property
    def vector(self) -> Any:
        """The compiled loop for `lanes` vehicles at a time; its arguments are addresses."""
        return self._compiled.get(self.lanes) or self._compile(self.lanes)

    def __reduce__(self) -> tuple[Any, ...]:
        return functools.partial(Scan, matrices=self._matrices, optimised=self._optimised), (self.step, self.lanes)

    def _compile(self, lanes: int) -> Any:
        def translate() -> list[Any]:
            from fifthwheel.base.native import llvm_ir  # what translates a step is imported if the cache lacks one
            from fifthwheel.base.native.matrix_ir import matrix_module

            return [matrix_module(self.step) if self._matrices else llvm_ir.module(self.step, lanes)]

        with compiling:
            if lanes not in self._compiled:
                program = load(self._step, f"scan {lanes}", translate, optimisation=int(self._optimised))
                self._engines.append(program)
                prototype = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 2, *[ctypes.c_void_p] * 4)
                self._compiled[lanes] = prototype(program.engine.get_function_address("scan"))
            return self._compiled[lanes]

    def _to_lanes(self, array: Array) -> Array:
        """(B, ...) to (groups, ..., lanes); unused lanes repeat the last vehicle."""
        missing = -len(array) % self.lanes
        if missing:
            array = np.concatenate([array, np.repeat(array[-1:], missing, axis=0)])
        grouped = array.reshape(len(array) // self.lanes, self.lanes, *array.shape[1:])
        return np.array(np.moveaxis(grouped, 1, -1), dtype=np.float64, order="C")

    def _from_lanes(self, array: Array, vehicles: int) -> Array:
        """(groups, ..., lanes) to (B, ...)."""
        grouped = np.moveaxis(array, -1, 1)
        return np.ascontiguousarray(grouped.reshape(len(grouped) * self.lanes, *grouped.shape[2:])[:vehicles])

    def _expect(self, name: str, shape: tuple[int, ...], expected: tuple[int, ...]) -> None:
        if shape != expected:
            raise TypeError(f"{self.step.name()}: expected {name} of shape {expected}, got {shape}")


def _check(step: ca.Function) -> None:
    """A TypeError if a function is not a step."""
    if step.n_in() != 3 or step.n_out() != 2 or step.numel_out(0) != step.numel_in(0):
        raise TypeError(f"{step.name()}: expected a step from (carry, sample, constant) to (carry, output), got {step}")
    patterns = [*map(step.sparsity_in, range(3)), *map(step.sparsity_out, range(2))]
    if not all(pattern.is_dense() for pattern in patterns):
        raise TypeError(f"{step.name()}: expected dense inputs and outputs, got sparse ones; use casadi.densify")


_processes = [1]


def share_cores(processes: int) -> None:
    """Say how many processes like this one share the cores."""
    _processes[:] = [processes]


def threads() -> int:
    """The threads that a scan may use."""
    return max((os.cpu_count() or 1) // _processes[0], 1)


@functools.cache
def workers() -> ThreadPoolExecutor:
    """The threads of all scans."""
    return ThreadPoolExecutor(threads(), thread_name_prefix="scan")


@functools.cache
def _background() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, thread_name_prefix="compile")


def _after_fork_in_child() -> None:
    """Forget the threads, which only the parent has."""
    workers.cache_clear()
    _background.cache_clear()
    compiling.release()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=compiling.acquire, after_in_parent=compiling.release, after_in_child=_after_fork_in_child
    )


def compile_in_background(*scans: Scan) -> None:
    """Compile the loops for one vehicle in a background thread, one after another."""
    for scan in scans:
        _background().submit(getattr, scan, "single")


@functools.cache
def _platform() -> tuple[str, str, str, bytes]:
    """Target triple, processor, its features, and the identity of compiler and processor for the cache's key."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    triple = llvm.get_process_triple()
    versions = (llvmlite.__version__, ".".join(map(str, llvm.llvm_version_info)))
    return triple, cpu, features, "\n".join((*versions, triple, cpu, features)).encode()


def _machine(optimisation: int = 0) -> Any:
    """A new target machine for this processor; an engine takes ownership of its machine."""
    triple, cpu, features, _ = _platform()
    return llvm.Target.from_triple(triple).create_target_machine(cpu=cpu, features=features, opt=optimisation, jit=True)


class Program(NamedTuple):
    """Machine code in memory."""

    code: bytes  # object code; the engine refers to it
    engine: Any  # executes the code
    numbers: list[int]  # what its callers need to know of the code


def load(step: Step, form: str, translate: Callable[[], list[Any]], *, optimisation: int = 0) -> Program:
    """The program of a step in a form of its translation, LLVM assembly and numbers, from the cache or the compiler.

    `optimisation` is the level of LLVM's code generator. At 1 compilation takes four times as long; what it gains is
    the choice of registers. At 0 each value that is used again goes through the stack.
    """
    translation = functools.cache(translate)

    def compute() -> list[Any]:
        source, *numbers = translation()
        return [_key(source, optimisation).hex(), *numbers]

    key, *numbers = step.recall(form, compute)
    code = cache.read(bytes.fromhex(key))
    if code is None:
        key, *numbers = step.recall(form, compute, again=True)
        code = _compile(translation()[0], optimisation)
        cache.write(bytes.fromhex(key), code)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return Program(code, engine, numbers)


def _key(source: str, optimisation: int) -> bytes:
    """Key of the object code of LLVM assembly on this machine."""
    *_, platform = _platform()
    return cache.DIGEST(b"\0".join([platform, str(optimisation).encode(), source.encode()])).digest()


def _compile(source: str, optimisation: int) -> bytes:
    """Object code of LLVM assembly, without IR passes: CasADi shares subexpressions, `llvm_ir` hoists invariants."""
    parsed = llvm.parse_assembly(source)
    parsed.verify()
    return bytes(_machine(optimisation).emit_object(parsed))
