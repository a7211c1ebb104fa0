"""A reader that does what its file says: for tests of the isolation."""

import os
import re
import signal
import time
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs.source import Chunk, Column, LogSource


def act(command: str) -> None:
    if command == "crash":
        os.kill(os.getpid(), signal.SIGSEGV)
    elif command == "exit":
        os._exit(3)
    elif command == "hang":
        while True:
            pass
    elif command == "block":  # within C, without releasing the interpreter lock
        re.match(r"(a+)+$", "a" * 60 + "b")
    elif command == "memory":
        np.ones(1 << 31)
    elif command == "refuse":
        raise SignalError("refused")
    elif command == "foreign":
        raise KeyError("some key")
    elif command == "import":
        import no_such_library  # noqa: F401
    elif command == "print":
        print("not a message" * 1000, flush=True)
        os.write(1, b"nor this")


def open_log(path: Path, databases=(), progress=lambda done: None) -> LogSource:
    """The first line acts on opening, the second in the third chunk; both processes' numbers go to a file."""
    opening, reading = path.read_text().split("\n")[:2]
    path.with_suffix(".pid").write_text(f"{os.getpid()} {os.getppid()}")
    progress(0.5)
    while opening == "crawl":  # progress without end
        progress(0.5)
        time.sleep(0.01)
    act(opening)
    progress(1.0)
    return FaultyLog(path.name, reading, unit="m" * 2000 if opening == "names" else "m")


class FaultyLog(LogSource):
    """Ten chunks of a thousand rows of x = 2 t, and a table y without time."""

    def __init__(self, name: str, reading: str, unit: str) -> None:
        columns = {"x": Column(name="x", unit=unit, clock="c"), "y": Column(name="y")}
        super().__init__(name, columns)
        self.reading = reading
        self.notes.append("opened")

    def chunks(self, columns: Collection[str]) -> Iterator[Chunk]:
        for k in range(10):
            time = np.arange(1000.0 * k, 1000.0 * (k + 1))
            if k == 3:
                act(self.reading)
            if "x" in columns:
                yield Chunk(values={"x": 2 * time}, time=time, clock="c", done=(k + 1) / 10)
            if "y" in columns:
                yield Chunk(values={"y": np.full(3, np.nan)}, done=(k + 1) / 10)
        self.notes.append("read")
        self.unusable["y"] = "no numbers"
