"""The reproduction without simulation: what it refuses, which arms it selects, and its raw results."""

import importlib
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from fifthwheel.apps.cheng_cebon_2011.comparison import compare
from fifthwheel.apps.cheng_cebon_2011.experiments import FRONT, YAW_INERTIA
from fifthwheel.apps.cheng_cebon_2011.outcomes import parameter_table
from fifthwheel.apps.cheng_cebon_2011.reproduce import reproduce
from fifthwheel.base.errors import FifthwheelError, VehicleError
from fifthwheel.truck import get

program = importlib.import_module("fifthwheel.apps.cheng_cebon_2011.reproduce")


@pytest.mark.parametrize("module", ["mujoco", "matplotlib"])
def test_missing_packages_are_named(module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(FifthwheelError, match=rf"{module} is needed .*pip install 'fifthwheel\[studies\]'"):
        reproduce(tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"arms": ["defaults"]}, FifthwheelError, "no arm 'defaults'; choose from 'article'"),
        ({"seeds": 0}, FifthwheelError, "1 or more"),
        ({"vehicle": get("auburn_6x4_unladen")}, VehicleError, "needs a tractor and a laden semitrailer"),
    ],
)
def test_what_it_refuses(options, error, message, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(program, "simulate", lambda *_: pytest.fail("simulated"))
    with pytest.raises(error, match=message):
        reproduce(tmp_path, **options)


def test_another_truck_is_not_compared_with_published_numbers(simulation):
    experiments, outcomes = simulation
    own = {name: replace(e, published=False) for name, e in experiments.items()}
    rows, published = compare(own, outcomes), compare(experiments, outcomes)
    assert [row.quantity for row in rows] == [row.quantity for row in published]
    assert not any(row.published for row in rows)
    assert all(result.factor is None for row in rows for result in row.arms)


def test_parameters_of_every_seed(simulation):
    experiments, outcomes = simulation
    rows = parameter_table(experiments, outcomes).to_pylist()
    assert len(rows) == sum(len(outcome.values) for outcome in outcomes)
    inertia = [r for r in rows if (r["parameter"], r["estimator"]) == (YAW_INERTIA, "article")]
    assert [r["seed"] for r in inertia] == [0, 1, 2]
    assert [r["estimate"] / r["truth"] for r in inertia] == pytest.approx([1.05, 1.06, 1.01])
    assert [r["sigma"] / r["estimate"] for r in inertia] == pytest.approx([0.01] * 3)
    assert inertia[2]["verdict"] == "not_converged"
    assert inertia[1]["rms.sideslip.semitrailer"] == pytest.approx(0.002)
    front = next(r for r in rows if r["parameter"] == FRONT)
    assert (front["truth_low"], front["truth_high"], front["unit"]) == (440e3, 460e3, "N/rad")
