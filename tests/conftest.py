"""Settings of all tests: one thread for BLAS in each test process, because its threads only spin on thin matrices.

At the end the number of steps is printed that were compiled, which is that of all distinct ones with an empty cache.
"""

import os
import time
from collections.abc import Iterator

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.fixture(scope="session", autouse=True)
def one_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """All FMUs, also those of another test process, share the run-time library of the compiler and its object files."""
    folder = tmp_path_factory.getbasetemp()
    folder = folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ZIG_GLOBAL_CACHE_DIR", str(folder / "zig"))
        yield


STARTED = time.time()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print how many steps the tests have compiled, or that the cache did not have before."""
    from fifthwheel.base.native import cache

    folder = cache.folder()
    new = [path for path in folder.glob("*.o") if path.stat().st_mtime > STARTED] if folder else []
    compiled = sum(path.read_bytes()[64:68] == b"\x7fELF" for path in new)  # behind key and digest
    terminalreporter.write_line(f"{compiled} steps compiled")
