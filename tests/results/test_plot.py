"""Plots of the linear model: their data against the model's own numbers and against simulation; both renderers."""

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.errors import SignalError
from fifthwheel.base.plots import Line, Points
from fifthwheel.model import dynamics
from fifthwheel.results import plot
from tests.model.dynamics.test_state_space import WHEELBASE, truck, truck_and_trailer, understeer

ARTICLE = fw.vehicle("cheng_cebon_2011")
SYSTEM = dynamics.linear_system(ARTICLE, 20.0)


def lines(panel):
    return [item for item in panel.items if isinstance(item, Line)]


def points(panel):
    return [item for item in panel.items if isinstance(item, Points)]


def test_bode() -> None:
    made = plot.bode(SYSTEM, ["yaw_rate.tractor", "yaw_rate.semitrailer"], frequency=[0.01, 0.5])
    gains, phases = map(lines, made.panels)
    assert [line.name for line in gains] == ["yaw_rate.tractor", "yaw_rate.semitrailer"]
    assert made.panels[0].y.title == "gain, rad/s per rad"
    state = dynamics.steady_state(ARTICLE, 20.0, [1, 0, 0, 0])
    assert [line.y[0] for line in gains] == pytest.approx([state["yaw_rate.tractor"]] * 2, rel=2e-3)
    assert phases[1].y[0] > phases[1].y[1] > -180  # the trailer follows later
    assert len(plot.bode(SYSTEM).panels[0].items) == 1
    with pytest.raises(SignalError, match="one unit"):
        plot.bode(SYSTEM, ["yaw_rate.tractor", "roll.tractor"])
    with pytest.raises(SignalError, match="did you mean"):
        plot.bode(SYSTEM, "yaw_rate.tracto")


def test_eigenvalues_show_the_critical_speed() -> None:
    rig = truck_and_trailer().replace({"trailer.cog": -6.7, "trailer.yaw_inertia": 1.2e5, "trailer.mass": 16000})
    critical = dynamics.critical_speed(rig)
    assert critical is not None
    made = plot.eigenvalues(rig, [critical - 1, critical + 1])
    damping = next(item for item in points(made.panels[1]) if item.name == "oscillating")
    slow = damping.x < 3.6 * critical
    assert damping.y[slow].min() > 0 > damping.y[~slow].min()
    assert any(getattr(item, "x", None) == pytest.approx(3.6 * critical) for item in made.panels[1].items)
    assert not [item for item in plot.eigenvalues(ARTICLE, [20.0]).panels[0].items if hasattr(item, "text")]


def test_step_response_ends_in_the_steady_state() -> None:
    made = plot.step_response(SYSTEM, ["roll.tractor", "yaw_rate.tractor"], duration=30.0)
    roll, yaw_rate = made.panels
    state = dynamics.steady_state(ARTICLE, 20.0, [np.radians(1), 0, 0, 0])
    assert roll.y.unit == "deg"
    assert lines(roll)[0].y[-1] == pytest.approx(np.degrees(state["roll.tractor"]), rel=1e-4)
    assert yaw_rate.title == "yaw_rate.tractor"
    assert len(plot.step_response(SYSTEM).panels) == len(SYSTEM.outputs)


def test_handling_diagram_and_understeer_gradient_of_the_single_track_model() -> None:
    gradient = np.degrees(understeer(truck()) * 9.80665)  # deg/g
    made = plot.handling_diagram(truck(), largest=0.2)
    (line,) = lines(made.panels[0])
    assert line.y == pytest.approx([-0.2, 0.2])
    assert line.x == pytest.approx([0.2 * gradient, -0.2 * gradient])
    made = plot.understeer_gradient(truck(), radius=50.0, largest=0.2)
    (curve,) = lines(made.panels[0])
    ackermann = np.degrees(WHEELBASE / 50)
    assert curve.y == pytest.approx([ackermann, ackermann + 0.2 * gradient])
    assert f"{gradient:.2f} deg/g" in made.title


def test_both_renderers_draw_them() -> None:
    pytest.importorskip("matplotlib")
    for made in (plot.bode(SYSTEM), plot.eigenvalues(ARTICLE, [10.0, 20.0]), plot.handling_diagram(ARTICLE)):
        assert made.to_plotly().data
        assert made.to_matplotlib().axes
