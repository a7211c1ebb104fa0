"""The observer of trucks with self-steering, command-steered and raised axles, in Python and in C."""

from pathlib import Path

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.model.manoeuvres.open_loops import single_sine
from fifthwheel.model.plant import Plant, article_sensors, measure
from fifthwheel.model.simulate import simulate
from tests.estimate.observe.test_saturating_tyres import SIDESLIP, SIGNALS
from tests.model.dynamics.test_steered_axles import COMMAND, LIFTED, SELF_STEERING, with_axle
from tests.results.export.test_c_observer import COMPILER, assert_equal, compiled, pushed, replayed


@pytest.mark.parametrize(
    ("keys", "friction", "largest"), [(SELF_STEERING, 0.75, 0.1), (COMMAND, None, 0.2), (LIFTED, 0.75, 0.1)]
)
def test_sideslip_of_the_nonlinear_truck(keys: dict[str, object], friction: float | None, largest: float) -> None:
    """As good as with fixed axles, rms in degrees, with linear tyres and with tyres that saturate."""
    pytest.importorskip("mujoco")
    truck = with_axle(keys)
    truth = Plant(truck).drive(single_sine(truck, acceleration=1.0))
    sensors = article_sensors(truck)
    signals = measure(
        truth.time, {n: truth.truth[n] for n in SIGNALS}, {n: sensors[n] for n in SIGNALS if n in sensors}, seed=1
    )
    settings = ObserverSettings(bank=0.0, steer_offset=0.0, friction=friction)
    states = Observer(truck, SIGNALS, settings).batch(Record(time=truth.time, signals=signals, name="sine"))
    for name in SIDESLIP:
        error = np.degrees(np.sqrt(np.mean((states.values[name] - truth.truth[name]) ** 2)))
        assert error < largest, name


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize(("keys", "friction"), [(SELF_STEERING, 0.75), (COMMAND, None)])
def test_export_to_c(keys: dict[str, object], friction: float | None, tmp_path: Path) -> None:
    truck = with_axle(keys)
    record = simulate(truck, count=1, seed=3)
    observer = Observer(truck, SIGNALS, ObserverSettings(bank=0.0, steer_offset=0.0, friction=friction))
    program = compiled(observer, tmp_path)
    assert_equal(replayed(program, observer, record), pushed(observer, record), 1e-12)
