"""The table of a study: a row per run and parameter, kept in a Parquet file that more runs may be added to.

A finished run is first a line of a journal beside the Parquet file, so that a killed study loses only the runs that
were in progress. The journal enters the Parquet file when the study ends, or when the next study opens the table.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
from pyarrow import parquet

from fifthwheel.apps.studies.estimators import ParameterEstimate
from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.truck import unit_of

COLUMNS = {
    "truck": pa.string(),
    "manoeuvre": pa.string(),
    "sensors": pa.string(),
    "estimator": pa.string(),
    "seed": pa.int64(),
    "parameter": pa.string(),
    "unit": pa.string(),
    "truth": pa.float64(),
    "truth_low": pa.float64(),
    "truth_high": pa.float64(),
    "estimate": pa.float64(),
    "sigma": pa.float64(),
    "verdict": pa.string(),
    "error": pa.string(),
    "seconds": pa.float64(),
    "digest": pa.string(),
}
"""Columns of every table; after them comes `rms.<state>`, the rms error of each state over the run."""

Row = Mapping[str, Any]


class RunName(NamedTuple):
    """Identifies a run."""

    truck: str
    manoeuvre: str
    sensors: str
    estimator: str
    seed: int

    @classmethod
    def of(cls, row: Row) -> "RunName":
        """The run of a row."""
        return cls(*(row[key] for key in cls._fields))


def run_rows(
    base: Mapping[str, Any],
    parameters: Iterable[ParameterEstimate],
    truth: Callable[[str], tuple[float, float, float] | None],
    states: Mapping[str, float],
) -> list[Row]:
    """A row for each parameter of a run, with what all its rows have (`base`) and the rms error of each state.

    `truth` gives the true value of a parameter, and the ends of its range; None if there is none.
    """
    rms = {f"rms.{name}": error for name, error in states.items()}
    rows: list[Row] = []
    for estimate in parameters:
        value, low, high = truth(estimate.name) or (None, None, None)
        columns: dict[str, Any] = {"truth": value, "truth_low": low, "truth_high": high, "estimate": estimate.value}
        columns |= {"sigma": estimate.sigma, "verdict": str(estimate.verdict), "unit": _unit(estimate.name)}
        rows.append({**base, "parameter": estimate.name, **columns, **rms})
    return rows or [{**base, "parameter": "", **rms}]


def _unit(name: str) -> str:
    try:
        return unit_of(name)
    except FifthwheelError:
        return ""


def as_table(rows: Iterable[Row]) -> pa.Table:
    """Rows as an Arrow table; a column that a row does not have is null there."""
    rows = list(rows)
    states = sorted({name for row in rows for name in row if name not in COLUMNS})
    return pa.Table.from_pylist(rows, schema=pa.schema(COLUMNS | dict.fromkeys(states, pa.float64())))


def write_table(table: pa.Table, path: Path) -> None:
    """Write a table to a Parquet file, which appears complete or not at all."""
    with atomic_write(path) as temporary:
        parquet.write_table(table, temporary)


class ResultTable:
    """The runs in a Parquet file, if it exists, and its journal, by name; FifthwheelError if it is another table."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.journal = path.with_name(path.name + ".journal")
        self.runs: dict[RunName, Sequence[Row]] = {}
        if path.exists():
            self._read_parquet()
        if self.journal.exists():
            self._read_journal()

    def done(self, name: RunName, digest: str) -> bool:
        """Whether a run was done with the same truck, manoeuvre, sensors and estimator, not only with their names."""
        return name in self.runs and self.runs[name][0]["digest"] == digest

    def add(self, name: RunName, rows: Sequence[Row]) -> None:
        """Keep the rows of a run in the journal, where they survive the end of the process."""
        self.runs[name] = rows
        with self.journal.open("ab", buffering=0) as file:  # one write, so that a line is never divided
            file.write((json.dumps(rows) + "\n").encode())

    def table(self) -> pa.Table:
        """All runs, ordered by name."""
        return as_table(row for name in sorted(self.runs) for row in self.runs[name])

    def save(self) -> None:
        """Write the Parquet file and remove the journal."""
        write_table(self.table(), self.path)
        self.journal.unlink(missing_ok=True)

    def _read_parquet(self) -> None:
        try:
            for row in parquet.read_table(self.path).to_pylist():
                present = {key: value for key, value in row.items() if value is not None}
                name = RunName.of(row)
                self.runs[name] = [*self.runs.get(name, []), {**present, "digest": row["digest"]}]
        except (pa.ArrowException, KeyError, OSError) as error:
            raise FifthwheelError(f"{self.path}: not the table of a study; write to another file") from error

    def _read_journal(self) -> None:
        complete = self.journal.read_bytes().rpartition(b"\n")
        for line in complete[0].splitlines():
            with suppress(json.JSONDecodeError):
                rows = json.loads(line)
                self.runs[RunName.of(rows[0])] = rows
        if complete[2]:  # the process was killed within this line
            with self.journal.open("r+b") as file:
                file.truncate(len(complete[0]) + len(complete[1]))
