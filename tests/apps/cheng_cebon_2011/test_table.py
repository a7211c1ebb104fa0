"""The comparison against numbers computed by hand, and the tables."""

import numpy as np
import pytest

from fifthwheel.apps.cheng_cebon_2011 import table
from fifthwheel.apps.cheng_cebon_2011.comparison import QUANTITIES, VariantErrors, compare, percent_error
from fifthwheel.apps.cheng_cebon_2011.experiments import FRONT, RESULTS, ROLL_INERTIA, TRAILER, YAW_INERTIA
from fifthwheel.base.pages import Table, plain
from tests.apps.cheng_cebon_2011.conftest import synthetic_experiment, synthetic_outcome


@pytest.fixture(scope="module")
def rows(simulation):
    return compare(*simulation)


def select(rows, quantity, arm):
    """The row of a quantity, and its result of an arm."""
    row = next(row for row in rows if row.quantity == quantity)
    return row, next(result for result in row.arms if result.arm == arm)


def test_mean_spread_worst_and_verdicts(rows):
    row, result = select(rows, YAW_INERTIA, "article")
    assert row.published.value == 4.24e5
    assert row.reference == (413700, 413700)
    assert result.mean == pytest.approx(1.04 * 413700)
    assert result.deviation == pytest.approx(np.std([1.05, 1.06, 1.01], ddof=1) * 413700)
    assert result.error == pytest.approx(4)
    assert (result.worst, result.worst_error) == (pytest.approx(1.06 * 413700), pytest.approx(6))
    assert (result.converged, result.seeds) == (2, 3)
    assert (result.factor, result.worse_seeds) == (pytest.approx(4 / 2.5), 2)  # worse than published
    _, default = select(rows, YAW_INERTIA, "default")
    assert (default.factor, default.worse_seeds) == (pytest.approx(1 / 2.5), 0)
    row, state = select(rows, "sideslip.semitrailer", "default")
    assert row.reference is state.error is None
    assert (state.mean, state.worst) == (pytest.approx(0.002), 0.003)


def test_error_of_stiffness_is_the_distance_from_the_range(rows):
    _, inside = select(rows, TRAILER, "article")
    assert inside.error == 0
    row, outside = select(rows, FRONT, "article")
    assert row.reference == (440e3, 460e3)
    assert outside.error == pytest.approx(100 * 15 / 460)
    assert outside.factor is None
    assert percent_error(430e3, (440e3, 460e3)) == pytest.approx(-100 * 10 / 440)


def test_every_published_number_has_a_row():
    made = {name: synthetic_experiment(name) for name in table.HEADINGS}
    rows = compare(made, [synthetic_outcome(e, arm.name, 0) for e in made.values() for arm in e.arms])
    published = {(row.experiment, row.quantity) for row in rows if row.published}
    repeated = {("test vehicle with errors", p.quantity) for p in RESULTS if p.case == "test vehicle"}
    assert published == {(p.case, p.quantity) for p in RESULTS} | repeated
    assert {row.quantity for row in rows} == set(QUANTITIES)
    assert list(dict.fromkeys(row.experiment for row in rows)) == list(made)
    point = next(row for row in rows if row.experiment == "point payload" and row.quantity == ROLL_INERTIA)
    assert point.reference[0] == pytest.approx(33308, abs=1)


def lines(rows, *more):
    """The cells of all tables as texts."""
    tables = [block for block in table.document(rows, *more).blocks if isinstance(block, Table)]
    return [[plain(cell) or str(cell) for cell in row] for each in tables for row in each.rows]


def test_the_document(rows):
    variant = VariantErrors(name="twice as many", values={YAW_INERTIA: 1.25, FRONT: -3.0}, seeds=4)
    worse, *_, variants, remarks = table.document(rows, [variant], ["Six repetitions only."]).blocks
    assert worse.lines[0].endswith("article: 1 of 4: I_2zz (1.6 times)")
    assert worse.lines[1].endswith("default: none of 4")
    cells = next(cells for cells in lines(rows) if cells[0].startswith("I_2zz"))
    assert cells[1:3] == ["424\u202f000 (+2.5 %)", "article"]
    assert cells[5:] == ["+4.0 %", "438\u202f500 (+6.0 %)", "2 of 3", "1.6 times, 2 of 3"]
    assert variants.blocks[1].rows == [("twice as many", "4", "−3.0 %", "+1.2 %")]
    assert remarks.blocks[0].lines == ["Six repetitions only."]
