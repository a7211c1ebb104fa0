"""An own state: the lag of the actuator that steers an axle of a trailer, whose command is logged, not the wheel angle.

    python examples/actuator_lag.py

A truck with the lag is simulated in a lane change of 24 m/s, and identified with and without it. The equations are a
function of CasADi expressions at the top level of a module; `fifthwheel.truck.steering` says what it must satisfy.
"""

from collections.abc import Mapping

import casadi as ca
import numpy as np

import fifthwheel as fw
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.manoeuvres.open_loops import single_sine

LAG = 0.15
FRONT, REAR = "steer.tractor.front", "steer.semitrailer.rear"
GYROS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.tractor", "roll_rate.semitrailer")
STATES = {"actuator.semitrailer": "0.01 rad"}
Expressions = Mapping[str, ca.SX]


def actuator(
    steer: Expressions, states: Expressions, motion: Expressions, p: Expressions
) -> tuple[Expressions, Expressions]:
    """The wheels have the angle z of the actuator, with z' = (command - z) / T."""
    angle = states["actuator.semitrailer"]
    return {REAR: angle}, {"actuator.semitrailer": (steer[REAR] - angle) / p["lag"]}


def with_lag(truck: fw.Vehicle, lag: str) -> fw.Vehicle:
    """The truck with the actuator, and what is known of its lag."""
    return truck.with_steering(actuator, states=STATES, parameters={"lag": lag})


def steered(truck: fw.Vehicle) -> fw.Vehicle:
    """The truck with a steered front axle and a steered last axle."""
    return truck.with_logged_steering([FRONT, REAR], "the lane change")


def simulated(truck: fw.Vehicle, seed: int = 0) -> fw.Record:
    """A single sine at 24 m/s, in which the trailer steers with 40 % of the front angle; noise of good gyros."""
    course = single_sine(truck, acceleration=1.5)
    inputs = {"speed": np.full_like(course.time, 24.0), FRONT: course.steer, REAR: 0.4 * course.steer}
    model, values = dynamics.model(truck, GYROS, roll=True), dynamics.all_parameters(truck, GYROS)
    _, rates = free_response(model, values, course.time, inputs)
    rates += np.random.default_rng(seed).normal(0, 1e-3, rates.shape)
    return fw.Record(time=course.time, signals=inputs | dict(zip(GYROS, rates.T, strict=True)), name="sine")


def main() -> None:
    """Identify with and without the lag."""
    truck = steered(fw.vehicle("cheng_cebon_2011"))
    record = simulated(with_lag(truck, f"{LAG} s"))
    stiffnesses = [name for name in truck.parameters() if name.endswith("cornering_stiffness")]
    guess = truck.replace({name: 0.85 * truck.parameters()[name] for name in stiffnesses})
    known = {"others": "exact", "sensors": "exact"}  # all but the parameters of the result
    settings = fw.OneStage(given=known, tyres="linear", check=False)
    for label, start in (("with lag", with_lag(guess, "0.1 s +- 0.05 s")), ("without lag", guess)):
        result = fw.identify([record], start, settings)
        print(f"{label}: log likelihood {result.log_likelihood:.0f}")
        truth = truck.parameters() | {"steering.lag": LAG}
        for estimate in result.parameters:
            true = truth[estimate.name]
            print(f"  {estimate.name}: {estimate.value / true:.3f} +- {estimate.sigma / true:.3f} of the true value")


if __name__ == "__main__":
    main()
