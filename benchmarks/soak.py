"""Long operation of the recursive estimators, with faults of the signals.

    python benchmarks/soak.py                     # 10 million samples for the observer, 1 million for the learner
    python benchmarks/soak.py --observer 100000 --learner 10000  # 0 for none
    python benchmarks/soak.py --hours 24          # a live node that learns instead, at 50 times real time

The samples are lane changes of the linear truck, one after the other. Every 1000 samples one fault lasts for up to 200
samples: missing, not a number, frozen, a spike; or there is a gap in time. Printed are the memory in use after each
tenth, the time of a push, how often a result with states was not finite, or had a sigma that is not positive, and how
often a state with status OK was more than 5 sigma from the truth, or more than 8.

The node replays the frames of a bus, with a record and the file of what it learned. Its memory is printed after each
twelfth, at the end how many rows the record has, and what the journal has counted. Needs the live extra.
"""

import argparse
import json
import math
import random
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pyarrow.parquet as pq

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.apps.live.truck_bus import driven, frames, write_candump, write_files

from fifthwheel import truck as vehicle
from fifthwheel.estimate.observe import Observer, Status
from fifthwheel.estimate.online import Learner
from fifthwheel.estimate.stream import VALID
from fifthwheel.model.simulate import simulate

TRUCK = vehicle.get("cheng_cebon_2011")
RECORD = simulate(TRUCK, count=2, seed=1)
STATES = ("sideslip.tractor", "sideslip.semitrailer", "articulation.semitrailer", "roll.semitrailer")
FAULTS = ("none", "missing", "not a number", "frozen", "spike", "gap")


def samples(count: int, rng: random.Random) -> Iterator[dict[str, float | None]]:
    """Consecutive samples, some with a fault."""
    names = list(RECORD.signals)
    rows = list(zip(*(values.tolist() for values in RECORD.signals.values()), strict=True))
    clock, fault, until, faulty, last = 0.0, "none", 0, names[0], rows[0]
    skipped = 0  # samples within gaps
    for k in range(count):
        clock += 0.01
        if k % 1000 == 0:
            fault, until, faulty = rng.choice(FAULTS), k + rng.randrange(1, 200), rng.choice(names)
            gap = rng.choice((0.5, 5.0, 100.0)) if fault == "gap" else 0.0
            clock, skipped = clock + gap, skipped + round(gap / 0.01)
        place_in_record = (k + skipped) % len(rows)
        row = rows[place_in_record]
        sample: dict[str, float | None] = dict(zip(names, row, strict=True))
        if k < until:
            place = names.index(faulty)
            match fault:
                case "missing":
                    sample[faulty] = None
                case "not a number":
                    sample[faulty] = math.nan
                case "frozen":
                    sample[faulty] = last[place]
                case "spike" if rng.random() < 0.05:
                    sample[faulty] = rng.choice((10.0, -1e3, 1e155, -1e300))
        else:
            last = row
        yield sample | {"time": clock, "row": place_in_record}


def soak(name: str, estimator: Observer | Learner, count: int) -> None:
    """Push the samples and print what the docstring of this file says."""
    statuses, wrong, start = Counter[str](), 0, time.process_time()
    truth = {state: values.tolist() for state, values in RECORD.reference.items() if state in STATES}
    far, further = 0, 0
    print(f"{name}: {count} samples; memory, MB:", end=" ", flush=True)
    for k, sample in enumerate(samples(count, random.Random(1))):
        row = int(sample.pop("row") or 0)
        result = estimator.push(sample)
        status = Status(result["status"])
        statuses[status.name] += 1
        if status in VALID:
            wrong += not all(map(math.isfinite, result.values()))
            wrong += min(value for key, value in result.items() if key.endswith(".sigma")) <= 0
        if status == Status.OK:
            error = max(abs(result[state] - values[row]) / result[f"{state}.sigma"] for state, values in truth.items())
            far, further = far + (error > 5.0), further + (error > 8.0)
        if (k + 1) % (count // 10) == 0:
            print(f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1000:.0f}", end=" ", flush=True)
    used = (time.process_time() - start) / count * 1e6
    print(
        f"\n  {used:.0f} us a sample with this script; wrong results: {wrong}; OK and more than 5 sigma off: {far}, "
        f"8 sigma: {further}; statuses: {dict(statuses)}",
        flush=True,
    )


def node(hours: float, factor: float) -> None:
    """Run `fifthwheel live --learn` on a trace of so many hours, and print its memory."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_files(folder)
        with (folder / "run.log").open("w") as trace:
            for k in range(round(hours * 9)):
                drive = frames(driven(400.0, seed=k))  # a noise that repeats would contradict the sigma of the learner
                write_candump(folder / "part.log", (f._replace(time=f.time + 400.0 * k) for f in drive))
                trace.write((folder / "part.log").read_text())
        command = [sys.executable, "-m", "fifthwheel", "live", "--signals", "signals.toml", "--vehicle", TRUCK.name]
        command += ["--replay", "run.log", "--rate", f"{factor:g}", "--learn", "--state", "learned.json"]
        process = subprocess.Popen([*command, "--record", "run.parquet"], cwd=folder, stdout=subprocess.DEVNULL)
        memory = Path(f"/proc/{process.pid}/status")
        print(f"Node: {hours:g} h of bus time; memory, MB:", end=" ", flush=True)
        while True:
            try:
                process.wait(hours * 300 / factor)
                break
            except subprocess.TimeoutExpired:
                size = next(line for line in memory.read_text().splitlines() if line.startswith("VmRSS"))
                print(f"{int(size.split()[1]) / 1000:.0f}", end=" ", flush=True)
        print(f"\n  exit {process.returncode}; {pq.read_metadata(folder / 'run.parquet').num_rows} rows recorded")
        events = [json.loads(line) for line in (folder / "run.parquet.events.jsonl").read_text().splitlines()]
        counts, refused = Counter[str](), Counter[str]()
        for event in events:
            counts.update(event.get("outputs", {}))
            refused.update(event.get("refused", {}))
        print(f"  {len(events)} events; outputs: {dict(counts)}; refused: {dict(refused)}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--observer", type=int, default=10_000_000, help="samples")
    parser.add_argument("--learner", type=int, default=1_000_000, help="samples")
    parser.add_argument("--hours", type=float, default=0.0, help="bus time of a live node, in place of the samples")
    parser.add_argument("--rate", type=float, default=50.0, help="of the node, times real time")
    given = parser.parse_args()
    if given.hours:
        node(given.hours, given.rate)
        return
    if given.observer:
        soak("Observer", Observer(TRUCK, RECORD.signals), given.observer)
    if not given.learner:
        return
    learner = Learner(TRUCK, RECORD.signals)
    soak("Learner", learner, given.learner)
    for estimate in learner.parameters:
        z = (estimate.value - TRUCK.parameters()[estimate.name]) / estimate.sigma
        print(f"  {estimate.name}: {estimate.verdict}, {z:+.2f} sigma from the true value")


if __name__ == "__main__":
    main()
