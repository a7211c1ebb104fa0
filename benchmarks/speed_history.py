"""Processor time of the command line, commit by commit, over that of a bare import of the libraries.

    python benchmarks/speed_history.py [COMMIT ...]    # HEAD by default

It adds rows to speed_history.csv, which `python docs/_figures` draws for the documentation. Each commit runs from a
work tree of its own with the libraries that are installed. A ratio changes little from machine to machine; rows of one
run of this program are best comparable.
"""

import csv
import subprocess
import sys
import tempfile
from pathlib import Path

from speed import bare_import, everyday_log, log_costs

TABLE = Path(__file__).with_suffix(".csv")
COLUMNS = ("commit", "date", "what", "bare_imports", "memory_mb")


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


def main() -> None:
    """Measure the commits and add them to the table."""
    new = not TABLE.exists()
    with tempfile.TemporaryDirectory() as folder, TABLE.open("a", newline="") as file:
        table = csv.DictWriter(file, COLUMNS)
        if new:
            table.writeheader()
        logs = [everyday_log(duration, folder)[0] for duration in (120, 600)]
        for commit in sys.argv[1:] or ["HEAD"]:
            bare_import.cache_clear()
            table.writerows(rows_of(commit, logs))
            file.flush()


if __name__ == "__main__":
    main()
