"""Helpers: an exported learner as a program, and the same by `Learner.push`."""

import copy
import csv
import shutil
import subprocess
from pathlib import Path

import numpy as np

from fifthwheel.data.record import Record
from fifthwheel.estimate.online import Learner
from fifthwheel.results.export import LEARNER_FILES, export_c, learner_model
from fifthwheel.results.export.project import LEARNER_SOURCES

COMPILER = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")

Estimates = dict[str, tuple[float, float, str]]
"""Value, sigma and verdict by name."""


def compiled(learner: Learner, folder: Path, *flags: str, compiler: str | None = COMPILER) -> Path:
    """The replay program of an exported learner, which has all files; the folder keeps its object files."""
    assert [path.name for path in export_c(learner, folder)] == [*LEARNER_FILES]
    run(folder, *STRICT, *flags, "-c", *LEARNER_SOURCES, compiler=compiler)
    return linked(folder, "replay.c", *flags, compiler=compiler)


def linked(folder: Path, main: str, *flags: str, compiler: str | None = COMPILER) -> Path:
    """A program of a main file and the object files of a folder."""
    program, objects = Path(main).stem, [name.replace(".c", ".o") for name in LEARNER_SOURCES]
    run(folder, *STRICT, *flags, main, *objects, "-lm", "-o", program, compiler=compiler)
    return folder / program


def run(folder: Path, *arguments: str, compiler: str | None) -> None:
    """The compiler, which must have nothing to say."""
    assert compiler
    done = subprocess.run([compiler, *arguments], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[:2000]
    assert not done.stderr


def columns(learner: Learner) -> tuple[str, ...]:
    """Names of the columns of a log, without the time."""
    return (*learner.live.setup.inputs, *learner.live.setup.outputs)


def csv_text(learner: Learner, record: Record) -> str:
    """The samples of a record as lines."""
    table = np.column_stack([record.time, *[record.signals[name] for name in columns(learner)]])
    return "\n".join(",".join(map(repr, row)) for row in table.tolist())


def replayed(program: Path, learner: Learner, record: Record, *saved: str) -> tuple[np.ndarray, Estimates]:
    """[time, status, learning, states, sigmas] of each sample that it accepts, and the estimates at the end."""
    command, text = [program, "estimates.csv", *saved], csv_text(learner, record)
    done = subprocess.run(command, cwd=program.parent, input=text, capture_output=True, text=True, check=True)
    names, *rows = [line.split(",") for line in done.stdout.splitlines()]
    assert names[:4] == ["time", "status", "learning", learner.live.view.names[0]]
    assert len(names) == 3 + 2 * len(learner.live.view.names)
    with (program.parent / "estimates.csv").open() as file:
        found = {r["name"]: (float(r["value"]), float(r["sigma"]), r["verdict"]) for r in csv.DictReader(file)}
    return np.array(rows, dtype=float), found


def pushed(learner: Learner, record: Record) -> tuple[np.ndarray, Estimates]:
    """The same by `push`, with a copy of the learner; samples that it refuses are left out."""
    learner = copy.copy(learner)
    states = learner.live.view.names
    names = ("learning", *states, *[f"{name}.sigma" for name in states])
    rows = []
    for k, time in enumerate(record.time.tolist()):
        answer = learner.push({"time": time} | {name: values[k] for name, values in record.signals.items()})
        rows.append([answer["time"], answer["status"], *[answer[name] for name in names]])
    reported = [u.name for u in learner_model.reported(learner)]
    estimates = {name: learner[name] for name in reported}
    return np.array(rows), {n: (e.value, e.sigma, e.verdict.value) for n, e in estimates.items()}


def largest_difference(actual: np.ndarray, expected: np.ndarray) -> float:
    """Of the states and sigmas, relative to the range of their column; times, statuses and learning are equal."""
    assert actual.shape == expected.shape
    assert (actual[:, :3] == expected[:, :3]).all()
    assert (np.isnan(actual) == np.isnan(expected)).all()
    span = np.nanmax(np.abs(expected[:, 3:]), axis=0)
    return float((np.nanmax(np.abs(actual - expected)[:, 3:], axis=0) / span).max())


def largest_deviation(actual: Estimates, expected: Estimates) -> float:
    """Of values and sigmas, in sigmas; names and verdicts are equal."""
    assert {n: e[2] for n, e in actual.items()} == {n: e[2] for n, e in expected.items()}
    return max(abs(actual[n][i] - value[i]) / value[1] for n, value in expected.items() for i in (0, 1))
