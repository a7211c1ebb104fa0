"""Kill the programs that write for a long time, at random times, and check what is left.

    python benchmarks/kills.py                 # 50 kills of each, about 10 minutes; Linux only
    python benchmarks/kills.py live --kills 5

* live: a replay at 20 times real time with a record, a journal and the estimates of a learner. Every piece of the
  record must be readable and whole, every line of the journal but the last one valid, and the estimates must load.
  Printed is the largest time of the bus that passed from the last piece to the kill; 10 s are documented.
* fleet: a run over six trips. After each kill a run that is not killed must give the trips of a run that was never
  killed.
* workbench: changes of two documents, one after the other. The next start must find both old or both new.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pyarrow.parquet as pq

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.apps.live.truck_bus import driven, frames, write_candump, write_files

from fifthwheel.apps.app.workspace import SIGNALS, VEHICLE, Workspace
from fifthwheel.estimate.online import Learner
from fleet import make

MAIN = [sys.executable, "-m", "fifthwheel"]
RATE = 20
"""Seconds of the bus in one second."""
CHANGES = """
import sys
from pathlib import Path
from fifthwheel.apps.app.workspace import Workspace
workspace = Workspace(Path(sys.argv[1]))
print("ready", flush=True)
for k in range(10**6):
    workspace.write({"signals.toml": f"# {k}", "vehicle.toml": f"# {k}"}, str(k))
"""


def killed(command: list[str], folder: Path, seconds: float) -> str:
    """Kill a process and its children after a time; what it has printed."""
    log = folder / "printed.txt"
    with log.open("w") as file:
        process = subprocess.Popen(command, cwd=folder, stdout=file, stderr=file, start_new_session=True)
        with suppress(subprocess.TimeoutExpired):
            process.wait(seconds)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    return log.read_text()


def live(folder: Path, rng: random.Random, kills: int) -> str:
    """The row of a node."""
    write_files(folder)
    write_candump(folder / "run.log", frames(driven(200.0)))
    options = ["--signals", "signals.toml", "--vehicle", "cheng_cebon_2011", "--replay", "run.log", "--rate", str(RATE)]
    command = [*MAIN, "live", *options, "--learn", "--state", "learned.json", "--record", "run.parquet", "--force"]
    damaged, largest, pieces = 0, 0.0, 0
    for _ in range(kills):
        for old in folder.glob("run.parquet*"):
            for part in old.iterdir() if old.is_dir() else ():
                part.unlink()
            old.rmdir() if old.is_dir() else old.unlink()
        killed(command, folder, rng.uniform(2.0, 9.0))
        journal, now = folder / "run.parquet.events.jsonl", time.time()
        last = journal.stat().st_ctime if journal.exists() else now
        for piece in sorted((folder / "run.parquet.parts").glob("0*.parquet")):
            rows = pq.read_table(piece)
            damaged += rows.num_rows != 1000
            last, pieces = piece.stat().st_mtime, pieces + 1
        for line in journal.read_text().splitlines()[:-1] if journal.exists() else []:
            json.loads(line)
        largest = max(largest, RATE * (now - last)) if pieces else largest
        if (folder / "learned.json").exists():
            Learner.load(folder / "learned.json")
    return f"{kills} | {damaged} | {pieces} pieces; at most {largest:.1f} s of the bus after the last piece"


def fleet(folder: Path, rng: random.Random, kills: int) -> str:
    """The row of a fleet."""
    manifest = make(folder, 6, trucks=2)
    command = [*MAIN, "fleet", "run", manifest, "--out", "fleet", "--jobs", "2"]

    def tables() -> list[dict[str, object]]:
        rows = pq.read_table(folder / "fleet" / "trips.parquet").to_pylist()
        return sorted(
            ({k: v for k, v in row.items() if k in ("log", "status", "truck", "error")} for row in rows), key=str
        )

    start = time.monotonic()
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    duration, expected, damaged = time.monotonic() - start, tables(), 0
    for _ in range(kills):
        subprocess.run(["rm", "-r", "fleet"], cwd=folder, check=True)
        killed(command, folder, rng.uniform(0.5, duration))
        done = subprocess.run(command, cwd=folder, check=False, capture_output=True)
        damaged += done.returncode != 0 or tables() != expected
    return f"{kills} | {damaged} | a run that is not killed lasts {duration:.0f} s"


def workbench(folder: Path, rng: random.Random, kills: int) -> str:
    """The row of a workbench."""
    damaged, last = 0, 0
    for _ in range(kills):
        killed([sys.executable, "-c", CHANGES, str(folder / "space")], folder, rng.uniform(1.0, 2.5))
        workspace = Workspace(folder / "space")
        pair = {workspace.read(name) for name in (SIGNALS, VEHICLE)}
        damaged += len(pair) != 1
        text = pair.pop()
        last = int(text[2:]) if text else 0
        damaged += text is not None and workspace.undoable()[0] != str(last)
    return f"{kills} | {damaged} | {last} changes before the last kill"


WRITERS: dict[str, Callable[[Path, random.Random, int], str]] = {"live": live, "fleet": fleet, "workbench": workbench}


def main() -> None:
    """Print a row of each writer."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("writers", nargs="*", choices=[*WRITERS, []], help="all by default")
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    print("| writer | kills | damaged | |", flush=True)
    for name in given.writers or WRITERS:
        with tempfile.TemporaryDirectory() as folder:
            row = WRITERS[name](Path(folder), random.Random(given.seed), given.kills)
            print(f"| {name} | {row} |", flush=True)


if __name__ == "__main__":
    main()
