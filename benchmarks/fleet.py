"""Throughput, memory and statistics of `fifthwheel fleet run` on simulated fleets.

    python benchmarks/fleet.py overhead --trips 40        CPU time per trip: identification alone, and in a run
    python benchmarks/fleet.py scale --trips 2000         memory and throughput
    python benchmarks/fleet.py queue --trips 10000        the same without identification: the logs are missing
    python benchmarks/fleet.py coverage --trucks 30       coverage and changes on logs of the linear model

CPU times count, because other processes may use the machine.
"""

import argparse
import csv
import datetime
import resource
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import psutil
import pyarrow.parquet as pq

import fifthwheel as fw
from fifthwheel.apps.fleet import FleetSettings, run

TRUCK = fw.vehicle("cheng_cebon_2011")
GUESS = {"tractor.front.cornering_stiffness": 4.2e5, "semitrailer.cornering_stiffness": 1.1e6}
LIGHT = fw.OneStage(
    given={
        "others": "exact",
        "tractor.front.cornering_stiffness": "exact",
        "semitrailer.yaw_inertia": "exact",
        "semitrailer.payload.height": "exact",
    },
    tyres="linear",
    adapt_noise=False,
    check=False,
)
"""Few unknowns and one fit, so that a run of thousands of trips takes minutes."""


def make(folder, trips, *, trucks, count=1, rate=100.0, change=None):
    """Logs of lane changes and a manifest; `change` gives the true vehicle of a trip."""
    (folder / "logs").mkdir(parents=True)
    TRUCK.replace(GUESS).save(folder / "truck.toml")
    with (folder / "manifest.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["log", "truck", "trailer", "vehicle", "load", "date"])
        for k in range(trips):
            truck, number = k % trucks, k // trucks
            real = change(truck, number) if change else TRUCK
            made = fw.simulate(real, count=count, rate=rate, seed=k, speed=18.0 + 0.5 * (number % 8))
            fw.write_record(fw.Record(time=made.time, signals=made.signals, name="log"), folder / f"logs/{k}.parquet")
            day = datetime.date(2026, 1, 1) + datetime.timedelta(days=number)
            writer.writerow([f"logs/{k}.parquet", f"truck {truck}", "A", "truck.toml", "steel", day.isoformat()])
    return str(folder / "manifest.csv")


class Peaks(threading.Thread):
    """Largest resident memory of this process and of each child, MB."""

    def __init__(self):
        super().__init__(daemon=True)
        self.own, self.child, self.running = 0.0, 0.0, True

    def run(self):
        me = psutil.Process()
        while self.running:
            self.own = max(self.own, me.memory_info().rss / 1e6)
            for child in me.children(recursive=True):
                try:
                    if "spawn_main" in " ".join(child.cmdline()):
                        self.child = max(self.child, child.memory_info().rss / 1e6)
                except psutil.Error:
                    continue
            time.sleep(0.5)


def cpu():
    """CPU time of this process and of its ended children, s."""
    own, children = resource.getrusage(resource.RUSAGE_SELF), resource.getrusage(resource.RUSAGE_CHILDREN)
    return own.ru_utime + own.ru_stime + children.ru_utime + children.ru_stime


def scale(folder, trips, jobs, settings):
    """A run in processes of this computer."""
    measure(folder, make(folder, trips, trucks=max(trips // 20, 1), rate=25.0), jobs, settings)


def measure(folder, manifest, jobs, settings):
    """Memory and time of a run."""
    peaks = Peaks()
    peaks.start()
    start, used = time.monotonic(), cpu()

    def progress(title, done, total):
        if done % 250 == 0 or done == total:
            print(f"{title} {done} of {total}: {peaks.own:.0f} MB here, {peaks.child:.0f} MB in a worker", flush=True)

    result = run(manifest, str(folder / "out"), settings=settings, jobs=jobs, progress=progress)
    wall = time.monotonic() - start
    peaks.running = False
    print(
        f"{result.trips} trips: {result.new} new, {result.failed} failed, {result.lost} lost, {result.changes} changes"
    )
    print(f"wall {wall:.1f} s, CPU of all processes {cpu() - used:.1f} s, of trips {result.seconds:.1f} s")
    if result.seconds:
        print(f"logs {result.hours:.2f} h: {result.hours / result.seconds:.4f} trip-hours per s of CPU of a worker")
    print(f"largest memory: this process {peaks.own:.0f} MB, a worker {peaks.child:.0f} MB")


def queue(folder, trips, jobs):
    """Trips whose logs are missing: the work of rows and tables without identification."""
    folder.mkdir(parents=True)
    lines = [f"logs/{k}.parquet,truck {k % 500},cheng_cebon_2011" for k in range(trips)]
    (folder / "manifest.csv").write_text("\n".join(["log,truck,vehicle", *lines]) + "\n")
    measure(folder, str(folder / "manifest.csv"), jobs, fw.OneStage())


def overhead(folder, trips, count):
    """Identification of the same logs in one process, alone and as a run."""
    manifest = make(folder, trips, trucks=2, count=count)
    vehicle, settings = TRUCK.replace(GUESS), fw.OneStage()
    paths = [folder / f"logs/{k}.parquet" for k in range(trips)]
    fw.identify([fw.read_log(paths[0])], vehicle, settings)  # compiles
    used = time.process_time()
    for path in paths:
        fw.identify([fw.read_log(path)], vehicle, settings)
    alone = time.process_time() - used
    used = time.process_time()
    result = run(manifest, str(folder / "out"), settings=settings, jobs=1)
    whole = time.process_time() - used
    print(f"{trips} trips of {3600 * result.hours / trips:.0f} s; CPU time per trip:")
    print(f"  identification and reading alone {1e3 * alone / trips:.1f} ms")
    print(
        f"  process_trip                     {1e3 * result.seconds / trips:.1f} ms ({result.seconds / alone - 1:+.1%})"
    )
    print(f"  run with combination and tables {1e3 * whole / trips:.1f} ms ({whole / alone - 1:+.1%})")
    print(f"  {result.hours / alone:.4f} trip-hours per s alone, {result.hours / whole:.4f} in the run")


def coverage(folder, trucks, trips, jobs):
    """Coverage of 90 % intervals; changes in the middle: of tyres by 15 %, of the load, or none, in turn."""
    drive = "tractor.drive.cornering_stiffness"
    # as the logs; the vehicle file is exact but for the estimates
    settings = fw.OneStage(given={"others": "exact", "road.bank": "+- 0.03 rad"}, tyres="linear")
    values = TRUCK.parameters()
    load = {"semitrailer.payload.height": 0.4 + values["semitrailer.payload.height"]}
    load |= {"semitrailer.yaw_inertia": 1.15 * values["semitrailer.yaw_inertia"]}
    altered = [TRUCK.replace({drive: 0.85 * values[drive]}), TRUCK.replace(load), TRUCK]

    def true(truck, number):
        return altered[truck % 3] if number >= trips // 2 else TRUCK

    manifest = make(folder, trucks * trips, trucks=trucks, change=true)
    run(manifest, str(folder / "out"), settings=settings, fleet=FleetSettings(tyre_walk=0.0), jobs=jobs)
    inside: dict[str, list[bool]] = {}
    for name in ("trucks", "trailers"):
        for row in pq.read_table(folder / "out" / f"{name}.parquet").to_pylist():
            value = true(int(row["truck"].split()[1]), trips - 1).parameters()[row["parameter"]]
            inside.setdefault(row["parameter"], []).append(abs(row["value"] - value) < 1.645 * row["sigma"])
    print(f"{trucks} trucks with {trips} trips each; 90 % intervals of the combination contain the true value:")
    for name, hits in inside.items():
        print(f"  {name:40s} {np.mean(hits):.0%}")
    print(f"  {'all':40s} {np.mean([hit for hits in inside.values() for hit in hits]):.1%}")
    changes = pq.read_table(folder / "out" / "changes.parquet").to_pylist()
    first = datetime.date(2026, 1, 1) + datetime.timedelta(days=trips // 2)
    for k, (kind, subject) in enumerate((("tyres", "tractor.drive"), ("load", "A"))):
        own = [f"truck {i}" for i in range(k, trucks, 3)]
        found = [c for c in changes if (c["kind"], c["subject"]) == (kind, subject) and c["truck"] in own]
        dated = sum(c["date"].date() == first for c in found)
        print(f"change of {kind}: {len(found)} of {len(own)} found, {dated} dated to the trip")
        changes = [c for c in changes if c not in found]
    print(f"other changes: {[(c['truck'], c['kind'], c['subject'], c['date'].isoformat()) for c in changes]}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["overhead", "scale", "queue", "coverage"])
    parser.add_argument("--trips", type=int, default=20)
    parser.add_argument("--trucks", type=int, default=30)
    parser.add_argument("--count", type=int, default=1, help="lane changes in a log")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "fleet"
        if given.what == "overhead":
            overhead(folder, given.trips, given.count)
        elif given.what == "queue":
            queue(folder, given.trips, given.jobs)
        elif given.what == "scale":
            scale(folder, given.trips, given.jobs, LIGHT)
        else:
            coverage(folder, given.trucks, given.trips, given.jobs)


if __name__ == "__main__":
    main()
