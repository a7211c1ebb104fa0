"""The sentence of a caution where a log contradicts a fixed axle."""

from fifthwheel.estimate.identify.doubts import Cause
from fifthwheel.results.diagnose.doubt_cautions import describe_cause
from tests.model.dynamics.test_steered_axles import with_axle

TRUCK, PATH = with_axle({}), "semitrailer.rear.self_steering"


def cause(change: float) -> Cause:
    return Cause(name=PATH, changes={PATH: change}, prior_sigmas=change / 0.015)


def test_an_axle_that_is_not_stated_to_steer_itself():
    text = describe_cause(cause(0.78), TRUCK)
    assert text.startswith("semitrailer.rear steers itself, as a castor axle does: give it self_steering = 0.8 in the")
    assert "self_steering = 1.0 " in describe_cause(cause(1.3), TRUCK)


def test_a_stated_self_steering_that_is_wrong():
    assert describe_cause(cause(-0.2), TRUCK.replace({PATH: 0.8})).startswith(f"{PATH} is 25 % smaller")
