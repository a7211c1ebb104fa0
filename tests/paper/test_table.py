"""The table's numbers, by hand, and what it says where we are worse."""

import csv
import io
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from fifthwheel.paper import table
from fifthwheel.paper.published import DRIVE, FRONT, RESULTS, ROLL_INERTIA, TRAILER, YAW_INERTIA
from fifthwheel.paper.rows import QUANTITIES, off

from .conftest import experiment, outcome


@pytest.fixture(scope="module")
def rows(simulated):
    return table.rows(*simulated)


def one(rows, quantity, arm):
    row = next(row for row in rows if row.quantity == quantity)
    return row, next(found for found in row.arms if found.arm == arm)


def test_mean_spread_worst_and_verdicts(rows):
    row, found = one(rows, YAW_INERTIA, "article")
    assert row.published.value == 4.24e5
    assert row.reference == (413700, 413700)
    assert found.mean == pytest.approx(1.04 * 413700)
    assert found.deviation == pytest.approx(np.std([1.05, 1.06, 1.01], ddof=1) * 413700)
    assert found.error == pytest.approx(4)
    assert (found.worst, found.worst_error) == (pytest.approx(1.06 * 413700), pytest.approx(6))
    assert (found.converged, found.seeds) == (2, 3)


def test_worse_than_published(rows):
    _, article = one(rows, YAW_INERTIA, "article")
    assert article.factor == pytest.approx(4 / 2.5)
    assert article.worse_seeds == 2
    _, default = one(rows, YAW_INERTIA, "default")
    assert default.factor == pytest.approx(1 / 2.5)
    assert default.worse_seeds == 0


def test_stiffness_counts_what_is_outside_the_range(rows):
    _, inside = one(rows, TRAILER, "article")
    assert inside.error == 0
    row, outside = one(rows, FRONT, "article")
    assert row.reference == (440e3, 460e3)
    assert outside.error == pytest.approx(100 * 15 / 460)
    assert outside.factor is None
    assert off(430e3, (440e3, 460e3)) == pytest.approx(-100 * 10 / 440)


def test_worst_seed_of_a_range_is_the_one_outside():
    made = experiment("simulation")
    runs = [outcome(made, "article", seed) for seed in range(2)]
    lopsided = [
        replace(run, values={**run.values, DRIVE: value}) for run, value in zip(runs, (741e3, 781e3), strict=True)
    ]
    _, found = one(table.rows({made.name: made}, lopsided), DRIVE, "article")
    assert found.worst == 781e3


def test_states_have_their_rms(rows):
    row, found = one(rows, "sideslip.semitrailer", "default")
    assert row.reference is None
    assert (found.mean, found.worst) == (pytest.approx(0.002), 0.003)
    assert found.error is None


def test_every_published_number_has_its_row_and_its_words():
    made = {name: experiment(name) for name in ("test vehicle, flawed", "test vehicle", "point payload", "simulation")}
    runs = [outcome(e, arm.name, 0) for e in made.values() for arm in e.arms]
    rows = table.rows(made, runs)
    assert {(p.case, p.quantity) for p in RESULTS} == {
        (row.experiment, row.quantity) for row in rows if row.published and "flawed" not in row.experiment
    }
    flawed = {row.quantity for row in rows if row.experiment == "test vehicle, flawed" and row.published}
    assert flawed == {p.quantity for p in RESULTS if p.case == "test vehicle"}
    assert {row.quantity for row in rows} == set(QUANTITIES)
    assert list(dict.fromkeys(row.experiment for row in rows)) == list(reversed(made))
    point = next(row for row in rows if row.experiment == "point payload" and row.quantity == ROLL_INERTIA)
    assert point.reference[0] == pytest.approx(33308, abs=1)


def test_held_front_stiffness_of_the_test_vehicle():
    made = experiment("test vehicle", ("default", "default, front held"))
    runs = [outcome(made, arm.name, 0) for arm in made.arms]
    rows = table.rows({made.name: made}, runs)
    row, held = one(rows, FRONT, "default, front held")
    assert row.published is None
    assert (held.held, held.converged, held.deviation) == (True, None, None)
    assert "| default, front held | 440.0 kN/rad |  | within | held | held | – |" in table.markdown(rows)


def test_markdown(rows):
    varied = table.Variant(name="twice the repetitions", values={YAW_INERTIA: 1.25, FRONT: -3.0}, seeds=4)
    text = table.markdown(rows, [varied], ["Six repetitions only."])
    assert "- Six repetitions only." in text
    assert "article: **1 of 4**: I_2zz (1.6 times)" in text
    assert "default: none of 4" in text
    line = next(line for line in text.splitlines() if line.startswith("| trailer yaw inertia"))
    assert "424\u202f000 kg m² (+2.5 %) | article |" in line
    assert line.endswith("| +4.0 % | 438\u202f500 kg m² (+6.0 %) | 2 of 3 | **1.6 times**, 2 of 3 seeds |")
    assert "| What is changed | Seeds | `C_α1f` | `I_2zz` |" in text
    assert "| twice the repetitions | 4 | −3.0 % | +1.2 % |" in text
    widths = {line.count("|") for line in text.split("## What moves")[0].splitlines() if line.startswith("|")}
    assert widths == {len(table.HEAD) + 1}


def test_markdown_without_variants(rows):
    assert "What moves" not in table.markdown(rows)


def test_csv_has_a_line_for_each_quantity_and_arm(rows):
    lines = list(csv.DictReader(io.StringIO(table.as_csv(rows))))
    assert len(lines) == sum(len(row.arms) for row in rows) == 2 * 10
    line = next(line for line in lines if (line["quantity"], line["arm"]) == (YAW_INERTIA, "article"))
    assert float(line["error_percent"]) == pytest.approx(4)
    assert float(line["error_by_published"]) == pytest.approx(1.6)
    assert (line["seeds_worse_than_published"], line["held"]) == ("2", "0")


def test_terminal(rows):
    file = io.StringIO()
    table.show(rows, Console(file=file, width=80))
    text = file.getvalue()
    assert text.isascii()
    assert max(map(len, text.splitlines())) <= 80
    assert "+4.0 %  x 1.6" in text
    assert "-1.0 %     no" in text
