"""Shared libraries of an FMU, compiled by zig from the package ziglang, which has compilers for every platform.

The libraries need no C library: `freestanding` declares the few functions, and their code comes from the run-time
library of the compiler. So a library runs with every version of the C library, and that of the target does not have to
be compiled first, which takes minutes.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from fifthwheel.base.atomic import cleaned_up
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.lazy import require


class Platform(NamedTuple):
    """A platform for which FMUs are compiled."""

    target: str  # of zig
    fmi2: str  # folder of the library in an FMU of FMI 2.0
    suffix: str
    extra: tuple[str, ...]  # more arguments of the compiler


PLATFORMS = {
    "x86_64-linux": Platform("x86_64-linux-gnu", "linux64", ".so", ()),
    "x86_64-windows": Platform("x86_64-windows-gnu", "win64", ".dll", ("windows.c", "-lkernel32")),
}
"""Platforms by their names in FMI 3.0."""

_OPTIONS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-fvisibility=hidden", "-shared", "-s")
_WITHOUT_C_LIBRARY = ("-nostdlib", "-rtlib=compiler-rt", "-Ifreestanding")


def libraries(sources: Mapping[str, str], identifier: str, platforms: Iterable[str]) -> dict[str, bytes]:
    """The shared library of each of some `PLATFORMS`, of C files and headers by name.

    The cache of the compiler is temporary, unless its variable ZIG_GLOBAL_CACHE_DIR names another one.

    Raises:
        FifthwheelError: ziglang is not installed, or the compiler fails.
    """
    require("ziglang", "fmu")
    with (
        TemporaryDirectory(prefix="fifthwheel-", ignore_cleanup_errors=True) as name,
        cleaned_up(lambda: shutil.rmtree(name, ignore_errors=True)),
    ):
        folder = Path(name)
        for file, text in sources.items():
            (folder / file).write_text(text, encoding="utf-8")
        (folder / "freestanding").mkdir()
        for given in (resources.files("fifthwheel.results.export.fmu") / "freestanding").iterdir():
            place = folder if given.name.endswith(".c") else folder / "freestanding"
            (place / given.name).write_bytes(given.read_bytes())
        return {platform: _library(folder, sources, identifier, PLATFORMS[platform]) for platform in platforms}


def _library(folder: Path, sources: Iterable[str], identifier: str, platform: Platform) -> bytes:
    result = folder / f"{identifier}{platform.suffix}"
    files = [name for name in sources if name.endswith(".c")]
    command = [sys.executable, "-m", "ziglang", "cc", "-target", platform.target, *_OPTIONS, *_WITHOUT_C_LIBRARY]
    cache = str(folder / "cache")
    done = subprocess.run(
        [*command, *files, "atan.c", *platform.extra, "-o", result.name],
        cwd=folder,
        env={"ZIG_GLOBAL_CACHE_DIR": cache, "ZIG_LOCAL_CACHE_DIR": cache} | os.environ,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode or not result.is_file():
        raise FifthwheelError(f"{platform.target}: the compiler failed; install ziglang again: {done.stderr[-1000:]}")
    return result.read_bytes()
