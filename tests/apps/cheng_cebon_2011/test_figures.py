"""Figures 4 to 9: what they show."""

import numpy as np
import pytest

from fifthwheel.apps.cheng_cebon_2011 import figures
from fifthwheel.apps.cheng_cebon_2011.experiments import LANDING_LEG
from fifthwheel.base.plots import Guide, Line, Points
from tests.apps.cheng_cebon_2011.conftest import TIME, synthetic_experiment, synthetic_outcome

ARMS = ("article", "default", "default, front fixed")


@pytest.fixture(scope="module")
def drawn(simulation):
    experiments, outcomes = simulation
    others = {name: synthetic_experiment(name, ARMS) for name in ("point payload", "test vehicle")}
    more = [synthetic_outcome(e, arm, seed, passes=2) for e in others.values() for arm in ARMS for seed in (0, 1)]
    return figures.captioned(experiments | others, [*outcomes, *more])


def test_figures_4_to_9(drawn, simulation):
    assert [figure.path[-1] for figure in drawn] == [f"figure {n}" for n in range(4, 10)]
    assert [len(figure.plot.panels) for figure in drawn] == [8, 4, 8, 8, 2, 8]
    assert len(figures.captioned(*simulation)) == 3


def test_levels_and_arms_are_named(drawn):
    first = drawn[0].plot.panels[0].items
    assert [item.text for item in first if isinstance(item, Guide) and item.text] == [
        "effective stiffness",
        "published",
    ]
    assert [item.name for item in first if isinstance(item, Line)] == list(figures.NAMES.values())[:2]


def test_points_show_the_end_of_each_pass(simulation):
    experiments, outcomes = simulation
    kept = [o for o in outcomes if o.histories and o.arm == "default"]
    (plot, *_) = figures.captioned(experiments, kept)
    (points,) = [item for item in plot.plot.panels[1].items if isinstance(item, Points)]
    assert list(points.x) == [1, 2, 3, 4]
    assert points.y[-1] == kept[0].values["semitrailer.cornering_stiffness"] / 1e3


def test_the_middle_manoeuvre():
    wave = synthetic_experiment("simulation").run.truth[LANDING_LEG]
    start, end = figures.middle_manoeuvre(TIME, wave)
    assert start == pytest.approx(9, abs=0.2)
    assert end == pytest.approx(15, abs=0.2)
    assert figures.middle_manoeuvre(TIME, np.zeros_like(TIME)) == (TIME[0], TIME[-1])


def test_outcomes_without_histories_are_not_drawn():
    made = synthetic_experiment("simulation")
    assert figures.captioned({made.name: made}, [synthetic_outcome(made, "article", 1)]) == []
