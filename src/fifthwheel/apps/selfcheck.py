"""What an installation needs to be trusted: a cache of its own, right machine code, a disk and a clock that work."""

import math
import os
import shutil
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.native import cache
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.truck import get

STORED = {
    "sideslip.semitrailer": -0.005643731822539835,
    "roll.semitrailer": 0.006597411370523357,
    "load_transfer.semitrailer.sigma": 0.09115137257197746,
}
"""States of the truck of the article after a second of `_sample`, computed on another machine."""
MACHINE_CODE = "machine code"
"""Name of the check without which no state can be trusted."""
AGREES = 1e-9
"""Largest relative difference of machine code on two processors."""
LEAST_SPACE = 100e6
"""Free space, bytes, below which a record of some hours does not fit."""
OLDEST = 1.75e9
"""s since 1970; a clock before it has not been set."""
WATCHED = 0.05
"""Time for which the clocks are compared, s."""


@dataclass(frozen=True, kw_only=True)
class SelfCheck:
    """The result of one check."""

    name: str
    passed: bool
    text: str
    """What was found; if it is wrong, with the cure."""


def self_check(folder: Path) -> tuple[SelfCheck, ...]:
    """Check cache, machine code, the disk of a folder, and the clock. No check raises an exception.

    Example:
        >>> from pathlib import Path
        >>> all(check.passed for check in self_check(Path(".")))
        True
    """
    checks: dict[str, Callable[[], tuple[bool, str]]] = {
        "cache": _cache,
        MACHINE_CODE: _machine_code,
        "disk": lambda: _disk(folder),
        "clock": _clock,
    }
    found = []
    for name, check in checks.items():
        try:
            passed, text = check()
        except Exception as error:  # of whatever is broken; the other checks go on
            passed, text = False, f"{type(error).__name__}: {error}"
        found.append(SelfCheck(name=name, passed=passed, text=text))
    return tuple(found)


def _cache() -> tuple[bool, str]:
    if os.environ.get("FIFTHWHEEL_CACHE") == "":
        return True, "switched off by FIFTHWHEEL_CACHE; every run compiles"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        folder = cache.folder()
    if folder is None:
        reason = str(caught[-1].message) if caught else "its folder cannot be made; name one by FIFTHWHEEL_CACHE"
        return False, f"not used: {reason}"
    return True, f"{folder}: yours alone"


def _sample(k: int) -> dict[str, float]:
    """A steer angle that rises, with yaw and roll rates that follow it roughly."""
    steer = 0.02 * math.sin(2 * math.pi * 0.4 * 0.01 * k)
    rates = {"yaw_rate.tractor": 2.0 * steer, "yaw_rate.semitrailer": 1.8 * steer, "roll_rate.semitrailer": -steer}
    return {"time": 0.01 * k, "speed": 20.0, "steer.tractor.front": steer, **rates}


def _machine_code() -> tuple[bool, str]:
    truck = get("cheng_cebon_2011")
    observer = Observer(truck, _sample(0).keys() - {"time"}, ObserverSettings())
    for k in range(101):
        states = observer.push(_sample(k))
    differences = {name: abs(states[name] - stored) / abs(stored) for name, stored in STORED.items()}
    worst = max(differences, key=lambda name: differences[name])
    if not differences[worst] <= AGREES:
        return False, (
            f"{worst} is {states[worst]:.12g}, {STORED[worst]:.12g} expected; delete the cache, then install numpy, "
            "casadi and llvmlite again"
        )
    return True, f"gives the stored states within {differences[worst]:.1e}"


def _disk(folder: Path) -> tuple[bool, str]:
    content = np.random.default_rng().bytes(1_000_000)
    with atomic_write(folder / ".fifthwheel-selfcheck") as temporary:
        temporary.write_bytes(content)
        right = temporary.read_bytes() == content
    (folder / ".fifthwheel-selfcheck").unlink()
    free = shutil.disk_usage(folder).free
    if not right:
        return False, f"{folder}: 1 MB was read back otherwise than it was written; replace the disk"
    if free < LEAST_SPACE:
        return False, f"{folder}: {free / 1e6:.0f} MB free; delete files"
    return True, f"{folder}: written and read back, {free / 1e9:.1f} GB free"


def _clock() -> tuple[bool, str]:
    begin, steady = time.time(), time.monotonic()
    if begin < OLDEST:
        return False, f"shows {time.strftime('%Y-%m-%d', time.gmtime(begin))}; set it"
    time.sleep(WATCHED)
    drift = (time.time() - begin) - (time.monotonic() - steady)
    if abs(drift) > WATCHED / 10:
        return False, f"moved by {1e3 * drift:.1f} ms within {1e3 * WATCHED:.0f} ms; let it follow a server slowly"
    return True, f"{time.strftime('%Y-%m-%d %H:%M', time.gmtime(begin))} UTC, steady"
