"""Figures 4 to 9: files, content, legend and marks."""

import numpy as np
import pytest

from fifthwheel.apps.cheng_cebon_2011.experiments import LANDING_LEG
from tests.apps.cheng_cebon_2011.conftest import TIME, synthetic_experiment, synthetic_outcome

pytest.importorskip("matplotlib")
from fifthwheel.apps.cheng_cebon_2011 import figures

ARMS = ("article", "default", "default, front fixed")


@pytest.fixture(scope="module")
def drawn(tmp_path_factory, simulation):
    folder = tmp_path_factory.mktemp("figures")
    experiments, outcomes = simulation
    others = {name: synthetic_experiment(name, ARMS) for name in ("point payload", "test vehicle")}
    more = [synthetic_outcome(e, arm, seed, passes=2) for e in others.values() for arm in ARMS for seed in (0, 1)]
    return folder, figures.draw(experiments | others, [*outcomes, *more], folder)


@pytest.mark.slow
def test_files(drawn):
    folder, files = drawn
    assert [file.name for file in files] == [f"figure_{n}.{form}" for n in range(4, 10) for form in ("png", "svg")]
    assert sorted(folder.iterdir()) == sorted(files)


@pytest.mark.slow
def test_not_blank(drawn):
    from matplotlib.image import imread

    for file in drawn[1]:
        if file.suffix == ".png":
            image = imread(file)
            assert image.shape[1] == 7.2 * figures.DOTS_PER_INCH
            ink = image[..., :3].min(axis=2) < 0.9
            assert 0.01 < ink.mean() < 0.5
            for half in np.array_split(ink, 2, axis=1):
                assert half.mean() > 0.005
        else:
            assert file.read_text(encoding="utf-8").count("<path") > 50


@pytest.mark.slow
def test_files_are_reproducible(drawn, tmp_path, simulation):
    figures.draw(*simulation, tmp_path)
    second = (tmp_path / "figure_6.svg").read_bytes()
    assert second == (drawn[0] / "figure_6.svg").read_bytes()
    assert not (tmp_path / "figure_7.png").exists()


def test_legend_names_levels_and_arms(simulation):
    experiments, outcomes = simulation
    kept = [o for o in outcomes if o.histories]
    figure = figures._stage_1(experiments["simulation"], kept, "title")
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == [*figures.LEVELS, "article's preset", "two stages, default settings"]


def test_dots_show_the_end_of_each_pass(simulation):
    experiments, outcomes = simulation
    kept = [o for o in outcomes if o.histories and o.arm == "default"]
    figure = figures._stage_1(experiments["simulation"], kept, "title")
    passes = figure.axes[1]
    dots = next(line for line in passes.lines if line.get_marker() == ".")
    assert list(dots.get_xdata()) == [1, 2, 3, 4]
    assert dots.get_ydata()[-1] == kept[0].values["semitrailer.cornering_stiffness"] / 1e3


def test_the_middle_manoeuvre():
    wave = synthetic_experiment("simulation").run.truth[LANDING_LEG]
    start, end = figures.middle_manoeuvre(TIME, wave)
    assert start == pytest.approx(9, abs=0.2)
    assert end == pytest.approx(15, abs=0.2)
    assert figures.middle_manoeuvre(TIME, np.zeros_like(TIME)) == (TIME[0], TIME[-1])


def test_outcomes_without_histories_are_not_drawn(tmp_path):
    made = synthetic_experiment("simulation")
    assert figures.draw({made.name: made}, [synthetic_outcome(made, "article", 1)], tmp_path) == []
