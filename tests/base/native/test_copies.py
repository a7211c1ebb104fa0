"""Copies of scans, and processes forked while another thread compiles."""

import copy
import os
import pickle
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest

from fifthwheel.base.native import Scan
from tests.base.native.conftest import oscillator

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


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_a_process_forked_while_another_thread_compiles() -> None:
    """The child compiles too, in the foreground and in the background."""
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", FORK], capture_output=True, text=True, timeout=60, check=False
    )
    assert (run.stdout.strip(), run.returncode) == ("0", 0), run.stderr
