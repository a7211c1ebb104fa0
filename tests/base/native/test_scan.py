"""Scans over records and vehicles: shapes, order, constants, threads, copies, and the lifetime of compiled code."""

import copy
import gc
import os
import pickle
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from fifthwheel.base.native import Scan, compile_in_background, llvm_ir
from tests.base.native.conftest import Array, interpreted, max_difference, oscillator, times

STEP = oscillator()


def random_inputs(vehicles: int, rows: int, seed: int = 0) -> tuple[Array, Array, Array]:
    rng = np.random.default_rng(seed)
    sample = np.stack([rng.normal(size=(vehicles, rows)), rng.uniform(0.01, 0.1, size=(vehicles, rows))], axis=-1)
    return rng.normal(size=(vehicles, 2)), sample, rng.uniform(0.1, 2.0, size=(vehicles, 3))


@pytest.fixture(scope="module")
def scan() -> Scan:
    return Scan(STEP)


def test_one_vehicle(scan: Scan) -> None:
    carry, sample, constant = (array[0] for array in random_inputs(1, 200))
    copies = [array.copy() for array in (carry, sample, constant)]
    actual, expected = scan(carry, sample, constant), interpreted(STEP, carry, sample, constant)
    assert max_difference(actual[0], expected[0]) <= 1e-13
    assert max_difference(actual[1], expected[1]) <= 1e-13
    for array, before in zip((carry, sample, constant), copies, strict=True):
        assert np.array_equal(array, before)
    half, first = scan(carry, sample[:17], constant)
    last, second = scan(half, sample[17:], constant)
    assert np.array_equal(last, actual[0])
    assert np.array_equal(np.vstack([first, second]), actual[1])
    constant *= 2.0  # the same array, changed in place
    assert max_difference(scan(carry, sample, constant)[1], interpreted(STEP, carry, sample, constant)[1]) <= 1e-13
    constant /= 2.0
    assert np.array_equal(scan(carry, sample, constant)[1], actual[1])


def test_order_of_carries_and_outputs_that_are_inputs() -> None:
    x, none = ca.SX.sym("x", 3), ca.SX.sym("none", 0)
    step = ca.Function("turn", [x, none, none], [ca.vertcat(x[1], x[2], x[0]), x])
    carry, out = Scan(step)(np.array([1.0, 2, 3]), np.empty((4, 0)), np.empty(0))
    assert carry.tolist() == [2, 3, 1]
    assert out.tolist() == [[1, 2, 3], [2, 3, 1], [3, 1, 2], [1, 2, 3]]
    carry, sample, constant = (ca.SX.sym(name) for name in ("carry", "sample", "constant"))
    step = ca.Function("plain", [carry, sample, constant], [carry, ca.vertcat(constant, 2.5, sample, sample)])
    carry, out = Scan(step)(np.ones(1), np.array([[7.0], [8.0]]), np.array([3.0]))
    assert carry.tolist() == [1]
    assert out.tolist() == [[3, 2.5, 7, 7], [3, 2.5, 8, 8]]


def test_arrays_of_any_order_and_type(scan: Scan) -> None:
    carry, sample, constant = (array[0] for array in random_inputs(1, 20))
    expected = scan(carry, sample, constant)
    wide = np.zeros((40, 5))
    wide[::2, 1:4:2] = sample
    for other in (np.asfortranarray(sample), wide[::2, 1:4:2], sample[::-1].copy()[::-1], sample.tolist()):
        actual = scan(carry[::-1].copy()[::-1], other, constant.tolist())
        assert np.array_equal(actual[0], expected[0])
        assert np.array_equal(actual[1], expected[1])
    counted = scan(np.array([1, 2]), np.ones((3, 2), dtype=np.int64), np.array([1, 1, 1], dtype=np.float32))
    assert np.array_equal(counted[1], scan(np.array([1.0, 2.0]), np.ones((3, 2)), np.ones(3))[1])


@pytest.mark.parametrize(("vehicles", "lanes"), [(3, 1), (1, 4), (8, 8), (11, 4)])
def test_vehicles_and_lanes(vehicles: int, lanes: int) -> None:
    arrays = carry, sample, constant = random_inputs(vehicles, 30)
    copies = [array.copy() for array in arrays]
    actual = Scan(STEP, lanes).batch(*arrays)
    for array, before in zip(arrays, copies, strict=True):
        assert np.array_equal(array, before)
    each = Scan(STEP, lanes).batch(carry, np.broadcast_to(sample[0], sample.shape), constant)
    for one, other in zip(Scan(STEP, lanes).batch(carry, sample[0], constant), each, strict=True):
        assert np.array_equal(one, other)  # one record for all vehicles
    assert actual[0].shape == (vehicles, 2)
    assert actual[1].shape == (vehicles, 30, 3)
    for i in range(vehicles):
        expected = interpreted(STEP, carry[i], sample[i], constant[i])
        assert max_difference(actual[0][i], expected[0]) <= 1e-13
        assert max_difference(actual[1][i], expected[1]) <= 1e-13


WRONG = [
    ("carry", (3,), (5, 2), (3,)),
    ("carry", (1, 2), (5, 2), (3,)),
    ("sample", (2,), (5, 1), (3,)),
    ("sample", (2,), (10,), (3,)),
    ("sample", (2,), (1, 5, 2), (3,)),
    ("constant", (2,), (5, 2), (3, 1)),
]
WRONG_OF_MANY = [
    ("carry", (6, 3), (6, 5, 2), (6, 3)),
    ("constant", (6, 2), (6, 5, 2), (6, 2)),
    ("constant", (6, 2), (6, 5, 2), (5, 3)),
    ("sample", (6, 2), (5, 1), (6, 3)),
    ("sample", (6, 2), (4, 5, 2), (6, 3)),
    ("sample", (6, 2), (10,), (6, 3)),
]


def test_wrong_shapes(scan: Scan) -> None:
    for call, cases in ((scan, WRONG), (scan.batch, WRONG_OF_MANY)):
        for name, *shapes in cases:
            with pytest.raises(TypeError, match=rf"oscillator: expected {name} of shape"):
                call(*[np.zeros(shape) for shape in shapes])


def test_other_functions_are_no_steps() -> None:
    a, b, c, d = (ca.SX.sym(name, 2) for name in "abcd")
    for inputs, outputs in (([a, b], [a, b]), ([a, b, c, d], [a, b]), ([a, b, c], [a[0], a])):
        with pytest.raises(TypeError, match="expected a step from"):
            Scan(ca.Function("step", inputs, outputs))
    with pytest.raises(TypeError, match="sparse: expected dense inputs and outputs"):
        Scan(ca.Function("sparse", [a, b, c], [a, ca.vertcat(ca.SX(1, 1), b)]))


def test_nothing_to_process(scan: Scan) -> None:
    """No samples, no vehicles, or no samples of many vehicles, which have one record or each its own."""
    carry, sample, constant = random_inputs(6, 5)
    for records in (sample[0, :0], sample[:, :0]):
        after, out = scan.batch(carry, records, constant)
        assert np.array_equal(after, carry)
        assert out.shape == (6, 0, 3)
    after, out = scan(carry[0], sample[0, :0], constant[0])
    assert np.array_equal(after, carry[0])
    assert out.shape == (0, 3)
    after, out = scan.batch(carry[:0], sample[0], constant[:0])
    assert (after.shape, out.shape) == ((0, 2), (0, 5, 3))


def test_divisions_share_a_reciprocal_and_constants_are_before_the_loop() -> None:
    before, loop = llvm_ir.module(STEP).split("\nrow:\n")
    assert "@llvm.exp" in before
    assert "@llvm.exp" not in loop.split("\ndone:\n")[0]
    x, u = ca.SX.sym("x", 3), ca.SX.sym("u")
    step = ca.Function("divide", [x, u, ca.SX.sym("c", 1)], [x / u, 3 * x[::-1] / u])
    assert llvm_ir.module(step).count("fdiv") == 1
    _, output = Scan(step)(np.array([1.0, 2.0, 4.0]), np.array([[0.7]]), np.zeros(1))
    np.testing.assert_allclose(output[0], np.array([12.0, 6.0, 3.0]) / 0.7, rtol=1e-15)


@pytest.mark.slow
def test_compiled_code_is_freed() -> None:
    """Scans that are deleted in any order have no effect on other scans."""
    gc.freeze()  # the objects of other tests, which a collection would go through each time
    sample = np.arange(5.0)[:, None]
    kept = Scan(times(0.25))
    expected = kept(np.zeros(1), sample, np.ones(1))[1]
    dropped = []
    for factor in range(9):
        scan = Scan(times(float(factor)))
        assert scan(np.zeros(1), sample, np.ones(1))[0].item() == 10 * factor
        if factor % 3:
            scan.batch(np.zeros((5, 1)), sample, np.ones((5, 1)))
        dropped.append(weakref.ref(scan))
        if factor % 2:
            del scan
            gc.collect()
    scan = kept
    gc.collect()
    gc.unfreeze()
    assert not any(reference() for reference in dropped)
    assert np.array_equal(kept(np.zeros(1), sample, np.ones(1))[1], expected)


def test_calls_from_several_threads() -> None:
    """Concurrent first calls compile once, and all threads get the result of one thread."""
    carry, sample, constant = random_inputs(8, 2000)
    expected = [interpreted(STEP, carry[i], sample[i, :50], constant[i]) for i in range(8)]
    scan, start = Scan(STEP), threading.Barrier(8)

    def run(i: int) -> tuple[Array, Array]:
        start.wait()
        for _ in range(20):
            scan(carry[i], sample[i], constant[i])
        return scan(carry[i], sample[i, :50], constant[i])

    with ThreadPoolExecutor(8) as pool:
        for actual, values in zip(pool.map(run, range(8)), expected, strict=True):
            assert max_difference(actual[0], values[0]) <= 1e-13
            assert max_difference(actual[1], values[1]) <= 1e-13


def test_compiled_in_the_background(cache_folder: Path) -> None:
    """A background compilation fills the cache; a step that cannot be compiled raises its error when it is called."""
    scans = [Scan(times(factor)) for factor in (1.0, 2.0, 3.0)]
    compile_in_background(*scans)
    for i, scan in enumerate(scans):
        assert scan(np.zeros(1), np.ones((4, 1)), np.ones(1))[0].item() == 4.0 * (i + 1)
    another = Scan(times(4.0))
    compile_in_background(another)
    limit = time.monotonic() + 10
    while len(list(cache_folder.glob("*.o"))) < 4 and time.monotonic() < limit:
        time.sleep(0.01)
    assert len(list(cache_folder.glob("*.o"))) == 4
    carry = ca.SX.sym("carry")
    refused = Scan(ca.Function("refused", [carry, ca.SX.sym("a"), ca.SX.sym("b")], [ca.tan(carry), carry]))
    compile_in_background(refused)
    for _ in range(2):
        with pytest.raises(NotImplementedError, match="refused"):
            refused(np.zeros(1), np.zeros((1, 1)), np.zeros(1))


SAMPLE, CONSTANT = np.random.default_rng(0).uniform(0.1, 1.0, size=(20, 2)), np.array([0.5, 0.2, 0.1])

COPIES = {"copy": copy.copy, "deepcopy": copy.deepcopy, "pickle": lambda scan: pickle.loads(pickle.dumps(scan))}

FORK = """
import multiprocessing, threading, time
import casadi as ca, numpy as np
from fifthwheel.base.native import Scan, compile_in_background, scan as module

started, slow = threading.Event(), module._compile
def slow_compile(*arguments):
    started.set()
    time.sleep(0.5)
    return slow(*arguments)
module._compile = slow_compile

x, u, k = (ca.SX.sym(name) for name in "xuk")
scans = [Scan(ca.Function("step", [x, u, k], [x + i * k * u, x])) for i in range(1, 4)]
compile_in_background(scans[0])
started.wait()
def work():
    compile_in_background(scans[2])
    values = [scan(np.zeros(1), np.ones((5, 1)), np.ones(1))[0].item() for scan in scans[:2]]
    while 1 not in scans[2]._compiled:
        time.sleep(0.01)
    raise SystemExit(0 if values == [5.0, 10.0] else 3)
child = multiprocessing.get_context("fork").Process(target=work)
child.start()
child.join(20)
print(child.exitcode)
child.kill()
assert scans[0](np.zeros(1), np.ones((5, 1)), np.ones(1))[0].item() == 5.0
"""


@pytest.mark.parametrize("name", COPIES)
def test_a_copy_gives_the_same(name: str) -> None:
    scan = Scan(oscillator(), lanes=2)
    make: Callable[[Scan], Scan] = COPIES[name]
    before = make(scan)
    expected = scan(np.ones(2), SAMPLE, CONSTANT)
    for one in (before, make(scan)):
        assert one.lanes == 2
        for actual, values in zip(one(np.ones(2), SAMPLE, CONSTANT), expected, strict=True):
            np.testing.assert_array_equal(actual, values)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_a_process_forked_while_another_thread_compiles() -> None:
    """The child compiles too, in the foreground and in the background."""
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", FORK], capture_output=True, text=True, timeout=60, check=False
    )
    assert (run.stdout.strip(), run.returncode) == ("0", 0), run.stderr
