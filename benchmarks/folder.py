"""Identify on every log in a folder: one table of verdicts, parameters and prediction errors, for data of others.

    python benchmarks/folder.py logs --vehicle truck.toml
    python benchmarks/folder.py logs --vehicle cheng_cebon_2011 --out results --jobs 4 --limit 600
    python benchmarks/folder.py logs -v truck.toml --tyres linear    # other options are those of `fifthwheel identify`

All formats of logs, in the folder and below. Of a log run.mf4, the signal map is run.signals.toml beside it, else the
signals.toml in its folder or the next one above; the vehicle is run.vehicle.toml or vehicle.toml in the same places,
else that of --vehicle. Each log is identified by a process of its own, `fifthwheel identify`, so that an error, a crash
or the end of its time is a row of the table and not the end of the others. OUT has a result folder for each log, and
table.md and table.csv, which are complete after every log. The prediction error is that of the free-running model of
the identified truck. To combine the logs of one truck, and to find changes, use `fifthwheel fleet run`.
"""

import argparse
import csv
import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.formatting import approximate, percent, with_sigma
from fifthwheel.data.channels import si_unit

ENDINGS = (".csv", ".tsv", ".txt", ".dat", ".parquet", ".mf4", ".mdf", ".mat", ".mcap", ".blf", ".asc", ".trc", ".log")
"""Of logs; their content then decides on the format."""
SHOWN = 200
"""Characters of an error that table.md shows; table.csv has all."""
Row = dict[str, str]


def logs_in(folder: Path, out: Path) -> tuple[list[Path], list[Path]]:
    """The logs in a folder and below, and the other files; without the results."""
    results = out.resolve()
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and results not in path.resolve().parents]
    logs = [path for path in files if path.suffix.lower() in ENDINGS]
    return logs, [path for path in files if path not in logs and path.suffix != ".toml"]


def beside(log: Path, kind: str, folder: Path) -> Path | None:
    """The map or the vehicle file of a log: of its name, of its folder, or of a folder above within the given one."""
    places = [log.parent, *(p for p in log.parent.parents if p == folder or folder in p.parents)]
    candidates = [log.with_name(f"{log.stem}.{kind}.toml"), *(place / f"{kind}.toml" for place in places)]
    return next((path for path in candidates if path.is_file()), None)


def identified(log: Path, folder: Path, out: Path, vehicle: str, limit: float, options: list[str]) -> tuple[Row, Row]:
    """The rows of a log: as people read it, and in SI."""
    place = log.relative_to(folder)
    row = {"log": str(place)}
    signals, truck = beside(log, "signals", folder), beside(log, "vehicle", folder) or vehicle
    if not truck:
        return failed(row, "no vehicle.toml beside the log; give --vehicle")
    mapped = ["-s", signals] if signals else []
    command = ["identify", log, "-v", truck, *mapped, "-o", out / place, "--json", *options]
    program = [sys.executable, "-m", "fifthwheel", *map(str, command)]
    try:
        done = subprocess.run(program, capture_output=True, text=True, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        return failed(row, f"not done within {limit:g} s")
    if done.returncode:
        lines = done.stderr.strip().splitlines() or [f"ended with code {done.returncode}"]
        first = next((k for k, line in enumerate(lines) if line.startswith("error: ")), -1)
        return failed(row, " ".join(lines[first:]).removeprefix("error: "))
    return rows_of(row, json.loads(done.stdout))


def failed(row: Row, error: str) -> tuple[Row, Row]:
    """The rows of a log without a result."""
    error = error.removeprefix(f"{Path(row['log']).name}: ")
    cut = error if len(error) <= SHOWN else f"{error[:SHOWN]}..."
    return row | {"verdict": f"error: {cut}"}, row | {"verdict": "error", "error": error}


def rows_of(row: Row, found: dict[str, Any]) -> tuple[Row, Row]:
    """The rows of an identification."""
    shown = row | {"verdict": found["conclusion"]["headline"]}
    numbers = row | {"verdict": "good" if found["conclusion"]["good"] else "doubtful"}
    for e in (*found["parameters"], *found["derived"]):
        shown[e["name"]] = f"{with_sigma(e['value'], e['sigma'], e['unit'])}, {e['verdict'].replace('_', ' ')}"
        parts = {"": e["value"], ".sigma": e["sigma"], ".verdict": e["verdict"]}
        numbers |= {f"{e['name']}{part}": "" if value is None else str(value) for part, value in parts.items()}
    errors = []
    for fit in found["fit"]:
        name, rms, explained = fit["signal"], fit["rms"], fit["explained"]
        errors.append(f"{name} {approximate(rms, si_unit(name))} ({percent(explained)} explained)")
        numbers |= {f"{name}.rms": str(rms), f"{name}.explained": str(explained)}
    return shown | {"prediction error, rms": "; ".join(errors)}, numbers


def write(out: Path, done: dict[Path, tuple[Row, Row]], others: list[Path]) -> None:
    """Write both tables."""
    shown, numbers = ([done[log][k] for log in sorted(done)] for k in (0, 1))
    with atomic_write(out / "table.csv") as path, path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, heads(numbers))
        writer.writeheader()
        writer.writerows(numbers)
    names = heads(shown)
    lines = [names, ["---"] * len(names), *([row.get(n, "").replace("|", "\\|") for n in names] for row in shown)]
    text = "".join(f"| {' | '.join(line)} |\n" for line in lines)
    if others:
        text += f"\nNot read, by their endings: {', '.join(path.name for path in others)}.\n"
    with atomic_write(out / "table.md") as path:
        path.write_text(text, encoding="utf-8")


def heads(rows: list[Row]) -> list[str]:
    """The columns of rows."""
    return list(dict.fromkeys(name for row in rows for name in row))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--vehicle", "-v", default="", help="of logs without a vehicle.toml: a file or a name")
    parser.add_argument("--out", "-o", type=Path, default=Path("folder-results"))
    parser.add_argument("--jobs", type=int, default=1, help="logs at a time")
    parser.add_argument("--limit", type=float, default=1800.0, help="seconds for each log")
    given, options = parser.parse_known_args()
    if not given.folder.is_dir():
        parser.error(f"{given.folder}: not a folder")
    logs, others = logs_in(given.folder, given.out)
    if not logs:
        parser.error(f"{given.folder}: no file ends with {', '.join(ENDINGS)}")
    given.out.mkdir(parents=True, exist_ok=True)
    done = dict[Path, tuple[Row, Row]]()
    common = (given.folder, given.out, given.vehicle, given.limit, options)
    with ThreadPoolExecutor(given.jobs) as pool:
        jobs = {pool.submit(identified, log, *common): log for log in logs}
        for job in as_completed(jobs):
            done[jobs[job]] = job.result()
            write(given.out, done, others)
            shown = job.result()[0]
            print(f"[{len(done)}/{len(logs)}] {shown['log']}: {shown['verdict']}", flush=True)
    failures = sum(numbers["verdict"] == "error" for _, numbers in done.values())
    print(f"{len(logs)} logs, {failures} with an error: {given.out / 'table.md'}, {given.out / 'table.csv'}")


if __name__ == "__main__":
    main()
