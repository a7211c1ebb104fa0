"""Time and memory of reading logs, beside the library for each format alone.

    python benchmarks/reading.py                # needs the test extra and pandas
    python benchmarks/reading.py --size 2000    # MB of each file; 100 by default

The log is a run of 1 kHz with 18 channels, of which six are read. "fifthwheel" is everything from the file to a Record
of 100 Hz; "library" gives arrays of the same six channels at 1 kHz. Of BLF both give all frames; fifthwheel decodes
them by J1939 besides. Each reads in a process of its own, imports included. The memory columns are the peaks of the
process and of the child process in which fifthwheel runs the library, without pages of mapped files (Linux only).
The last line is the time to open a small MF4 file, the first and each following one.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

SIGNALS = (
    "speed",
    "steer.tractor.front",
    "yaw_rate.tractor",
    "yaw_rate.semitrailer",
    "roll_rate.tractor",
    "roll_rate.semitrailer",
)
OTHERS = tuple(f"other_{k}" for k in range(12))
NAMES = (*SIGNALS, *OTHERS)
MAT_NAMES = {name: name.replace(".", "_") for name in SIGNALS}

RECORD = "from fifthwheel.data.logs import SignalMap, read_log; read_log(path, SignalMap.parse({signal_map!r}))"
FRAMES = """
    from fifthwheel.data.logs.readers import open_log
    with open_log(path) as log:
        [0 for chunk in log.chunks(log.columns)]
"""
MAT_MAP = "[signals]\n" + "".join(f"'{name}' = '{column}'\n" for name, column in MAT_NAMES.items())
LIBRARIES = {
    "CSV": ("pandas", f"import pandas; pandas.read_csv(path, usecols=['time', *{SIGNALS}])"),
    "MF4": ("asammdf", f"import asammdf; asammdf.MDF(path).select({list(SIGNALS)})"),
    "MF4 deflate": ("asammdf", f"import asammdf; asammdf.MDF(path).select({list(SIGNALS)})"),
    "BLF": ("python-can", "import can; [0 for message in can.BLFReader(path)]"),
    "MAT 5": (
        "scipy.io",
        f"import scipy.io; scipy.io.loadmat(path, variable_names=['t', *{list(MAT_NAMES.values())}])",
    ),
    "MAT 7.3": (
        "h5py",
        f"import h5py; f = h5py.File(path); [f[name][()] for name in ['t', *{list(MAT_NAMES.values())}]]",
    ),
}
RUN = """
import os, sys, threading, time, warnings
warnings.simplefilter("ignore")
path, peaks, ended = sys.argv[1], [0.0, 0.0], threading.Event()
def look(pid, place):
    try:
        status = dict(line.split(":", 1) for line in open(f"/proc/{{pid}}/status"))
        children = open(f"/proc/{{pid}}/task/{{pid}}/children").read().split()
    except (OSError, ValueError):
        return
    peaks[place] = max(peaks[place], int(status.get("RssAnon", "0 kB").split()[0]) / 1e3)
    for child in children:
        look(child, 1)
def watch():
    while not ended.wait(0.02):
        look(os.getpid(), 0)
watcher = threading.Thread(target=watch)
watcher.start()
start = time.perf_counter()
try:
    {work}
finally:
    seconds = time.perf_counter() - start
    ended.set()
    watcher.join()
print(seconds, *peaks)
"""
LATENCY = """
import time
from fifthwheel.data.logs.readers import open_log
for _ in range(5):
    start = time.perf_counter()
    with open_log({path!r}) as log:
        [0 for chunk in log.chunks(log.columns)]
    print(time.perf_counter() - start)
"""


def measured(work: str, path: Path) -> tuple[float, float, float, float]:
    """Seconds and CPU seconds, imports included, and the peaks of memory of the process and its child, MB.

    The quicker of two runs.
    """
    command = [sys.executable, "-c", RUN.format(work=work), str(path)]
    runs = []
    for _ in range(2):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        output = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()[-3:]
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        seconds, own, child = map(float, output)
        runs.append((seconds, cpu, own, child))
    return min(runs)


def channels(size: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Time and channels that fill `size` MB."""
    count = int(size * 1e6 / 8 / (len(NAMES) + 1))
    random = np.random.default_rng(0)
    return np.arange(count) * 1e-3, {name: random.normal(size=count) for name in NAMES}


def write_csv(path: Path, size: float) -> None:
    random = np.random.default_rng(0)
    rows = [",".join(f"{x:.6f}" for x in row) for row in random.normal(size=(10_000, len(NAMES)))]
    with path.open("w") as file:
        file.write(",".join(["time", *NAMES]) + "\n")
        k = 0
        while file.tell() < size * 1e6:
            file.write("".join(f"{(k + i) * 1e-3:.3f},{row}\n" for i, row in enumerate(rows)))
            k += len(rows)


def write_mf4(path: Path, size: float, compression: int = 0) -> None:
    from asammdf import MDF, Signal

    time, values = channels(size)
    mdf = MDF(version="4.10")
    mdf.append([Signal(column, time, name=name) for name, column in values.items()])
    mdf.save(path, compression=compression)
    mdf.close()


def write_deflated(path: Path, size: float) -> None:
    write_mf4(path, size, compression=2)


def write_blf(path: Path, size: float) -> None:
    import can

    with can.BLFWriter(str(path)) as writer:
        for k in range(int(size * 1e6 / 7.4)):
            source = 0x0B if k % 2 else 0x3E
            message = can.Message(timestamp=1e9 + k * 5e-3, arbitration_id=0x18F00900 | source, data=[k & 0x7F] * 8)
            writer.on_message_received(message)


def write_mat5(path: Path, size: float) -> None:
    from scipy.io import savemat

    time, values = channels(size)
    savemat(path, {"t": time} | {MAT_NAMES.get(name, name): column for name, column in values.items()})


def write_mat73(path: Path, size: float) -> None:
    import h5py

    time, values = channels(size)
    with h5py.File(path, "w") as file:
        for name, column in {"t": time, **values}.items():
            file.create_dataset(MAT_NAMES.get(name, name), data=column[None, :], chunks=(1, 65536))


WRITERS: dict[str, Callable[[Path, float], None]] = {
    "CSV": write_csv,
    "MF4": write_mf4,
    "MF4 deflate": write_deflated,
    "BLF": write_blf,
    "MAT 5": write_mat5,
    "MAT 7.3": write_mat73,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=float, default=100.0, help="MB of each file")
    parser.add_argument("--format", choices=WRITERS, action="append", help="only this one; may be repeated")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    ours, alone = "fifthwheel s", "library s"
    print(f"{'format':12}{'MB':>6}{ours:>14}{'CPU s':>7}{'MB':>5}{'child':>6}   {alone:>18}{'CPU s':>7}{'MB':>6}")
    for name in arguments.format or WRITERS:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "log"
            path = path.with_suffix(".mf4" if "MF4" in name else ".mat" if "MAT" in name else f".{name.lower()}")
            WRITERS[name](path, arguments.size)
            library, work = LIBRARIES[name]
            whole = FRAMES if name == "BLF" else RECORD.format(signal_map=MAT_MAP if "MAT" in name else "")
            seconds, cpu, own, child = measured(whole, path)
            library_seconds, library_cpu, memory, _ = measured(work, path)
            print(
                f"{name:12}{path.stat().st_size / 1e6:6.0f}{seconds:14.1f}{cpu:7.1f}{own:5.0f}{child:6.0f}   "
                f"{library:10}{library_seconds:8.1f}{library_cpu:7.1f}{memory:6.0f}",
                flush=True,
            )
    with tempfile.TemporaryDirectory() as folder:
        write_mf4(Path(folder) / "small.mf4", 0.1)
        code = LATENCY.format(path=str(Path(folder) / "small.mf4"))
        times = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
        print(f"small MF4: {float(times[0]):.2f} s, then {min(map(float, times[1:])):.3f} s")


if __name__ == "__main__":
    main()
