"""Small fleets on disk: logs of the linear model, a vehicle file and a manifest."""

import csv
import datetime
from dataclasses import replace

import fifthwheel as fw

TRUCK = fw.vehicle("cheng_cebon_2011")
DRIVE = "tractor.drive.cornering_stiffness"
FIXED = ("tractor.front.cornering_stiffness", "semitrailer.yaw_inertia", "semitrailer.payload.height")
FAST = fw.OneStage(given=dict.fromkeys(("others", *FIXED), "exact"), tyres="linear")
"""Settings with few unknowns, for tests of the machinery; the logs are of the linear model too."""
OTHER = replace(FAST, given={**FAST.given, DRIVE: "+- 31 %"})
"""Settings that give about the same result."""


def make_fleet(folder, *, trucks=2, trips=3, changed_from=None):
    """A fleet whose drive axles lose 15 % of their stiffness; returns the path of the manifest."""
    (folder / "logs").mkdir(parents=True)
    TRUCK.replace({"tractor.drive.cornering_stiffness": 7.0e5}).save(folder / "truck.toml")
    rows = []
    for i in range(trucks):
        for k in range(trips):
            worn = changed_from is not None and k >= changed_from
            real = TRUCK.replace({DRIVE: 0.85 * TRUCK.parameters()[DRIVE]}) if worn else TRUCK
            made = fw.simulate(real, count=1, seed=100 * i + k, speed=20.0 + k % 4)
            name = f"logs/truck{i}_{k}.parquet"
            fw.write_record(fw.Record(time=made.time, signals=made.signals, name="log"), folder / name)
            day = datetime.date(2026, 1, 1) + datetime.timedelta(days=2 * k)
            labels = {"truck": f"truck {i}", "trailer": "A", "vehicle": "truck.toml", "load": "steel"}
            rows.append({"log": name, **labels, "date": day.isoformat()})
    return write_manifest(folder / "manifest.csv", rows)


def write_manifest(path, rows):
    """Write rows as CSV; returns the path."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return path
