"""How fast logs are read, beside the libraries that others use for the format, and in how much memory.

    python benchmarks/reading.py                # needs the test extra: asammdf, pandas, python-can
    python benchmarks/reading.py --size 2000    # MB of the CSV and MF4 files; 100 by default

One drive of 1 kHz with 18 channels; six of them are wanted, at 100 Hz. Ours is the whole way to a Record; theirs only
to arrays of the same six channels, at 1 kHz. Of BLF both give all frames, ours decoded by J1939 besides. Each reads in
a process of its own, imports included; memory is that process's peak (Linux only).
"""

import argparse
import subprocess
import sys
import tempfile
import warnings
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
FRAMES = 1_000_000

OURS = "from fifthwheel.logs import read; read(path, progress=lambda done: None)"
THEIRS = {
    "CSV": ("pandas", f"import pandas; pandas.read_csv(path, usecols=['time', *{SIGNALS}])"),
    "MF4": ("asammdf", f"import asammdf; mdf = asammdf.MDF(path); [mdf.get(name) for name in {SIGNALS}]"),
    "BLF": ("python-can", "import can; [message.data for message in can.BLFReader(path)]"),
}
OURS_OF = {"BLF": "from fifthwheel.logs.readers import open_log; log = open_log(path); list(log.pieces(log.columns))"}
RUN = """
import re, sys, time, warnings
warnings.simplefilter("ignore")
path = sys.argv[1]
start = time.perf_counter()
{work}
seconds = time.perf_counter() - start
print(seconds, int(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1]) / 1e3)
"""


def measured(work: str, path: Path) -> tuple[float, float]:
    """Seconds, imports included, and the peak of memory, MB; the quicker of two runs."""
    command = [sys.executable, "-c", RUN.format(work=work), str(path)]
    runs = [subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()[-2:] for _ in range(2)]
    seconds, memory = min((float(s), float(m)) for s, m in runs)
    return seconds, memory


def write_csv(path: Path, size: float) -> None:
    random = np.random.default_rng(0)
    names = (*SIGNALS, *OTHERS)
    rows = [",".join(f"{x:.6f}" for x in row) for row in random.normal(size=(10_000, len(names)))]
    with path.open("w") as file:
        file.write(",".join(["time", *names]) + "\n")
        k = 0
        while file.tell() < size * 1e6:
            file.write("".join(f"{(k + i) * 1e-3:.3f},{row}\n" for i, row in enumerate(rows)))
            k += len(rows)


def write_mf4(path: Path, size: float) -> None:
    from asammdf import MDF, Signal

    names = (*SIGNALS, *OTHERS)
    count = int(size * 1e6 / 8 / (len(names) + 1))
    time, random = np.arange(count) * 1e-3, np.random.default_rng(0)
    mdf = MDF(version="4.10")
    mdf.append([Signal(random.normal(size=count), time, name=name) for name in names])
    mdf.save(path, compression=0)
    mdf.close()


def write_blf(path: Path, size: float) -> None:
    import can

    with can.BLFWriter(str(path)) as writer:
        for k in range(FRAMES):
            source = 0x0B if k % 2 else 0x3E
            message = can.Message(timestamp=1e9 + k * 5e-3, arbitration_id=0x18F00900 | source, data=[k & 0x7F] * 8)
            writer.on_message_received(message)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=float, default=100.0, help="MB of the CSV and MF4 files")
    size = parser.parse_args().size
    warnings.simplefilter("ignore")
    print(f"{'format':8}{'MB':>8}{'ours, s':>10}{'MB':>8}   {'theirs':12}{'s':>8}{'MB':>8}{'ratio':>8}")
    for name, write in (("CSV", write_csv), ("MF4", write_mf4), ("BLF", write_blf)):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"drive.{name.lower()}"
            write(path, size)
            peer, work = THEIRS[name]
            (ours, memory), (theirs, their_memory) = measured(OURS_OF.get(name, OURS), path), measured(work, path)
            print(
                f"{name:8}{path.stat().st_size / 1e6:8.0f}{ours:10.2f}{memory:8.0f}   {peer:12}{theirs:8.2f}"
                f"{their_memory:8.0f}{theirs / ours:8.2f}"
            )


if __name__ == "__main__":
    main()
