"""Kill every command that writes files at random times, and check what is left.

    python benchmarks/interrupts.py              # 200 kills, about 20 minutes of CPU; Linux only
    python benchmarks/interrupts.py --kills 5    # of each command
    python benchmarks/interrupts.py states       # of one command

A quarter of the kills (SIGKILL) is at a random time of the whole command. A quarter is within 60 ms after its first
temporary file appears, 300 ms for a folder of results. A quarter is within 5 ms after the journal of a folder appears,
and a quarter within 0.3 ms after its run.json disappears; for a single file, both are after the file has changed. Each
run replaces the results of the one before. After each kill, inputs and files of the user must be as before, the results
must be the old or the new ones as a whole, and no process may be left. After the last kill, a run that is not killed
must succeed and leave no hidden file.
"""

import argparse
import hashlib
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from fifthwheel.base.atomic import MANIFEST, recover
from fifthwheel.data.logs import read_log, write_record
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

MAIN = [sys.executable, "-c", "from fifthwheel.apps.cli import main; main()"]
SMALL_REPRODUCTION = """
import importlib, sys
from fifthwheel.apps.cli import main
if __name__ == "__main__":
    study = importlib.import_module("fifthwheel.apps.cheng_cebon_2011.reproduce")
    study.QUICK = study.Extent(seeds=1, repetitions=int(sys.argv.pop(1)), variant_seeds={})
    main()
"""
FOREIGN = ("signals.toml", "figures/mine.svg")


@dataclass(frozen=True)
class Case:
    """A command in two variants with different results for one output."""

    name: str
    variants: tuple[list[str], list[str]]
    output: str
    program: tuple[str, ...] = tuple(MAIN)

    @property
    def is_folder(self) -> bool:
        return not Path(self.output).suffix


TRUCK = ["-v", "in/truck.toml"]
CASES = (
    Case("simulate", tuple(["simulate", "sim.csv", "--count", "1", "--seed", k, "--force"] for k in "12"), "sim.csv"),
    Case("signals", tuple(["signals", f"in/lane{k}.csv", "-o", "map.toml", "--force"] for k in "12"), "map.toml"),
    Case(
        "signals --save",
        tuple(["signals", f"in/lane{k}.csv", "-s", "in/map.toml", "--save", "s.parquet", "--force"] for k in "12"),
        "s.parquet",
    ),
    Case("check", tuple(["check", f"in/lane{k}.csv", *TRUCK, "--plot", "p.html", "--force"] for k in "12"), "p.html"),
    Case("weigh", tuple(["weigh", f"in/parked{k}.csv", *TRUCK, "-o", "w.toml", "--force"] for k in "12"), "w.toml"),
    Case(
        "design",
        tuple(["design", *TRUCK, "--speed", k, "-o", "d.csv", "--force", "--target", "semitrailer.yaw_inertia=30%"]
              for k in ("80", "88")),
        "d.csv",
    ),
    Case("identify", tuple(["identify", f"in/lane{k}.csv", *TRUCK, "-o", "identified"] for k in "12"), "identified"),
    Case("states", tuple(["states", f"in/lane{k}.csv", *TRUCK, "-o", "states"] for k in "12"), "states"),
    Case(
        "reproduce",
        tuple([lane_changes, "reproduce", "--quick", "-o", "reproduced"] for lane_changes in "23"),
        "reproduced",
        (sys.executable, "study.py"),
    ),
)  # fmt: skip


def make_inputs(place: Path) -> None:
    """Logs of one lane change, of a truck at rest with axle loads, a vehicle file and a signal map."""
    (place / "in").mkdir()
    truck = get("cheng_cebon_2011")
    truck.save(place / "in/truck.toml")
    for k in (1, 2):
        record = simulate(truck, count=1, seed=k)
        write_record(record, place / f"in/lane{k}.csv")
        loads = [f"axle_load.{path} [kN]" for path in truck.axle_loads()]
        row = ",".join(f"{load * (1 + k / 100) / 1e3:.3f}" for load in truck.axle_loads().values())
        rows = [",".join(["t", *loads]), *(f"{time},{row}" for time in range(100))]
        (place / f"in/parked{k}.csv").write_text("\n".join(rows) + "\n")
    names = [f'"{name}" = "{name}"' for name in read_log(place / "in/lane1.csv").signals]
    (place / "in/map.toml").write_text("[signals]\n" + "\n".join(names) + "\n")
    (place / "study.py").write_text(SMALL_REPRODUCTION)


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 of every file that is not hidden, by its path."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    named = {path.relative_to(folder): path for path in paths}
    return {
        str(name): hashlib.sha256(path.read_bytes()).hexdigest()
        for name, path in named.items()
        if not any(part.startswith(".") for part in name.parts)
    }


def hidden(folder: Path) -> set[Path]:
    return {path for path in folder.rglob(".*") if path.exists()}


def is_complete(folder: Path) -> bool:
    """Whether the results are those of the manifest."""
    found = digests(folder)
    if MANIFEST not in found:
        return False
    files = json.loads((folder / MANIFEST).read_text())["files"]
    return found.keys() - {MANIFEST, *FOREIGN} == files.keys() and files.items() <= found.items()


def left_processes(session: int) -> list[int]:
    """Processes of a session, without those that have ended."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, own = path.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(own) == session and state != "Z":
            found.append(int(path.parent.name))
    return found


def killed_run(case: Case, variant: int, place: Path, duration: float, phase: int, rng: random.Random) -> int:
    """Start a variant and kill it; the number of processes that it leaves for more than 5 s.

    Args:
        phase: 0: at any time; 1: after the first temporary file; 2: after the journal; 3: while results are renamed.
    """
    output = place / case.output
    before = output.stat() if output.is_file() else None
    process = subprocess.Popen(
        [*case.program, *case.variants[variant]],
        cwd=place,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )

    def reached() -> bool:
        if phase == 1:
            with suppress(FileNotFoundError):  # a folder that was removed meanwhile
                return any(output.rglob(".*.part") if case.is_folder else place.glob(".*.part"))
            return False
        if not case.is_folder:
            return output.stat() != before
        return (output / ".fifthwheel/commit.json").exists() if phase == 2 else not (output / MANIFEST).exists()

    while phase and process.poll() is None and not reached():
        time.sleep(0 if phase == 3 else 0.0005)
    time.sleep(rng.uniform(0, (duration, 0.3 if case.is_folder else 0.06, 0.005, 0.0003)[phase]))
    process.kill()
    process.wait()
    deadline = time.monotonic() + 5
    while (left := left_processes(process.pid)) and time.monotonic() < deadline:
        time.sleep(0.05)
    for number in left:
        os.kill(number, 9)
    return len(left)


def complete_run(case: Case, variant: int, place: Path) -> float:
    """Run a variant to its end; its duration, s."""
    start = time.monotonic()
    subprocess.run([*case.program, *case.variants[variant]], cwd=place, check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - start


def examine(case: Case, place: Path, kills: int, rng: random.Random) -> Counter[str]:
    """Kill a command many times; how often what was left."""
    output, known, count = place / case.output, set(), Counter[str]()
    if case.is_folder:
        for name in FOREIGN:
            (output / name).parent.mkdir(parents=True, exist_ok=True)
            (output / name).write_text("mine")
    found = []
    for variant in (0, 1):
        duration = complete_run(case, variant, place)
        found.append({name: digest for name, digest in digests(place).items() if name.startswith(case.output)})
        known |= set() if case.is_folder else {digests(place)[case.output]}
    assert found[0] != found[1], f"{case.name}: old and new results cannot be distinguished"
    for k in range(kills):
        before = digests(place)
        count["processes left"] += killed_run(case, (k + k // 4) % 2, place, duration, k % 4, rng)
        count["kills"] += 1
        count["hidden files left"] += bool(hidden(place))
        if case.is_folder:
            count["finished by the next"] += (output / ".fifthwheel/commit.json").exists()
            count["damaged"] += (output / MANIFEST).exists() and not is_complete(output)
            recover(output)
            count["damaged"] += not is_complete(output)
        after = digests(place)
        if not case.is_folder:
            count["damaged"] += after.get(case.output) not in known
        changed = {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}
        own = {name for name in changed if name == case.output or name.startswith(f"{case.output}/")}
        count["damaged"] += bool(changed - own) or any(f"{case.output}/{name}" in own for name in FOREIGN)
        count["new" if own else "old"] += 1
    try:
        complete_run(case, 0, place)
    except subprocess.CalledProcessError:
        count["damaged"] += 1  # refused, because the results are not those of a run
    count["hidden after the next run"] += len(hidden(place))
    return count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("commands", nargs="*", help="all by default")
    parser.add_argument("--kills", type=int, default=24, help="of each command; a third of it of reproduce")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng, columns = random.Random(options.seed), ("kills", "old", "new", "finished by the next", "hidden files left")
    columns += ("damaged", "processes left", "hidden after the next run")
    print("| command |", " | ".join(columns), "|")
    for case in CASES:
        if options.commands and case.name not in options.commands:
            continue
        with tempfile.TemporaryDirectory() as folder:
            make_inputs(Path(folder))
            kills = max(options.kills // (3 if case.name == "reproduce" else 1), 1)
            count = examine(case, Path(folder), kills, rng)
        print(f"| `{case.name}` |", " | ".join(str(count[column]) for column in columns), "|", flush=True)
    used = [sum(os.times()[:2]), sum(os.times()[2:4])]
    print(f"CPU: {sum(used) / 60:.1f} min")


if __name__ == "__main__":
    main()
