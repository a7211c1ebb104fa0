"""Processor time of the command line, commit by commit, over that of a bare import of the libraries.

    python benchmarks/speed_history.py [COMMIT ...]        # HEAD by default
    python benchmarks/speed_history.py --durations 120     # of logs of 120 s alone

It prints rows and adds them to speed_history.csv, which the build of the site draws. Each commit
runs from a work tree of its own with the libraries that are installed. A ratio changes little from machine to machine;
rows of one run of this program are best comparable: the exit code is 1 if a ratio of the last commit is more than
`GROWTH` times that of the first.
"""

import argparse
import csv
import subprocess
import sys
import tempfile
from pathlib import Path

from speed import bare_import, everyday_log, log_costs

TABLE = Path(__file__).with_suffix(".csv")
COLUMNS = ("commit", "date", "what", "bare_imports", "memory_mb")
GROWTH = 1.25
"""Largest ratio of a commit over that of an earlier one."""


def git(*arguments: str) -> str:
    """The output of a command of Git."""
    return subprocess.run(["git", *arguments], check=True, capture_output=True, text=True).stdout.strip()


def rows_of(commit: str, logs: list[str]) -> list[dict[str, str | float]]:
    """The rows of a commit."""
    name, date = git("log", "-1", "--format=%h %cs", commit).split()
    rows: list[dict[str, str | float]] = []
    with tempfile.TemporaryDirectory() as folder:
        git("worktree", "add", "--detach", folder, commit)
        try:
            for log in logs:
                for what, cost in log_costs(log, "identify", PYTHONPATH=f"{folder}/src"):
                    ratio, memory = round(cost.cpu / bare_import().cpu, 1), round(cost.memory)
                    rows.append(dict(zip(COLUMNS, (name, date, what, ratio, memory), strict=True)))
        finally:
            git("worktree", "remove", "--force", folder)
    return rows


def main() -> int:
    """Measure the commits, print their rows and add them to the table; 1 if a ratio has grown too much."""
    parser = argparse.ArgumentParser()
    parser.add_argument("commits", nargs="*", default=["HEAD"])
    parser.add_argument("--durations", type=int, nargs="+", default=[120, 600], help="of the logs, s")
    arguments = parser.parse_args()
    new = not TABLE.exists()
    with tempfile.TemporaryDirectory() as folder, TABLE.open("a", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)
        if new:
            table.writeheader()
        logs = [everyday_log(duration, folder)[0] for duration in arguments.durations]
        ratios = dict[str, list[float]]()
        for commit in arguments.commits:
            bare_import.cache_clear()
            for row in rows_of(commit, logs):
                table.writerow(row)
                print(*row.values(), sep=",")
                ratios.setdefault(str(row["what"]), []).append(float(row["bare_imports"]))
            file.flush()
    grown = [what for what, of_commits in ratios.items() if of_commits[-1] > GROWTH * of_commits[0]]
    for what in grown:
        print(f"{what}: {ratios[what][-1]} bare imports, {ratios[what][0]} before: more than {GROWTH} times as many")
    return 1 if grown else 0


if __name__ == "__main__":
    sys.exit(main())
