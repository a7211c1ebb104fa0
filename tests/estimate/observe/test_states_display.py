"""States in a notebook: pandas and plots."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.base.plots import Band, Line, Span
from fifthwheel.estimate.observe import Observer, Status
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get


@pytest.fixture(scope="module")
def record():
    made = simulate(get("cheng_cebon_2011"), count=1, seed=1)
    slow = np.where((made.time > 2) & (made.time < 3), 1.0, made.signals["speed"])
    return made.with_signals({"speed": slow})


@pytest.fixture(scope="module")
def states(record):
    return Observer(get("cheng_cebon_2011"), record.signals).batch(record)


def test_pandas(states):
    frame = states.to_pandas()
    assert frame.index.name == "time"
    np.testing.assert_array_equal(frame["sideslip.tractor"], states.values["sideslip.tractor"])
    np.testing.assert_array_equal(frame["sideslip.tractor.sigma"], states.sigma["sideslip.tractor"])
    assert set(frame["status"]) == set(states.status)


def test_a_plot_with_the_reference(states, record):
    plot = states.plot("sideslip.semitrailer", "yaw_rate.tractor", record=record)
    sideslip, yaw_rate = plot.panels
    kinds = [type(item) for item in sideslip.items]
    assert kinds[-3:] == [Band, Line, Line]
    assert [item.name for item in yaw_rate.items if isinstance(item, Line)] == ["measured", "estimate"]
    band, line, reference = sideslip.items[-3:]
    np.testing.assert_allclose(line.y, np.degrees(states.values["sideslip.semitrailer"]))
    np.testing.assert_allclose(band.upper - band.lower, 4 * np.degrees(states.sigma["sideslip.semitrailer"]))
    np.testing.assert_allclose(reference.y, np.degrees(record.reference["sideslip.semitrailer"]))
    spans = [item for item in sideslip.items if isinstance(item, Span)]
    slow = states.time[states.status == Status.TOO_SLOW]
    assert any(span.start == slow[0] for span in spans)
    plot.to_plotly()
    plot.to_matplotlib()


def test_all_states_or_an_error(states):
    assert [panel.title for panel in states.plot().panels] == list(states.values)
    with pytest.raises(SignalError, match=r"sideslip\.trailer: not among the states; did you mean"):
        states.plot("sideslip.trailer")
