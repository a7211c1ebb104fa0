"""The observer of a truck with a raised, a command-steered and a self-steering axle."""

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.model.manoeuvres.open_loops import single_sine
from fifthwheel.model.plant import Plant, article_sensors, measure
from fifthwheel.truck import Vehicle, get
from tests.estimate.observe.test_saturating_tyres import SIDESLIP, SIGNALS
from tests.model.dynamics.test_steered_axles import COMMAND, LIFTED, SELF_STEERING


def truck() -> Vehicle:
    """A truck of the catalogue whose trailer axles are of the three kinds."""
    fields = get("cheng_cebon_2011").model_dump()
    for axle, keys in zip(
        fields["units"][-1]["axle_groups"][0]["axles"], (LIFTED, COMMAND, SELF_STEERING), strict=True
    ):
        axle |= {"steerable": False, **keys}
    return Vehicle(**fields)


TRUCK = truck()


@pytest.mark.slow
def test_sideslip_of_the_nonlinear_truck() -> None:
    """As good as with fixed axles."""
    pytest.importorskip("mujoco")
    run = Plant(TRUCK).drive(single_sine(TRUCK, acceleration=1.0))
    sensors = article_sensors(TRUCK)
    signals = measure(
        run.time, {n: run.truth[n] for n in SIGNALS}, {n: sensors[n] for n in SIGNALS if n in sensors}, seed=1
    )
    settings = ObserverSettings(bank=0.0, steer_offset=0.0, friction=0.75)
    states = Observer(TRUCK, SIGNALS, settings).batch(Record(time=run.time, signals=signals, name="sine"))
    for name in SIDESLIP:
        error = np.degrees(np.sqrt(np.mean((states.values[name] - run.truth[name]) ** 2)))
        assert error < 0.1, name
