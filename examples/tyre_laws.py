"""An own tyre law: a Magic Formula in place of the law of fifthwheel.

    python examples/tyre_laws.py

A truck with this law is simulated in a single sine of 3 m/s^2 on a wet road, and identified with both laws. A law is a
function of CasADi expressions at the top level of a module; `fifthwheel.model.dynamics.tyres` says what it must
satisfy.
"""

import casadi as ca
import numpy as np

import fifthwheel as fw
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.manoeuvres.open_loops import single_sine

SHAPE = 1.6
FRICTION = 0.4
GYROS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.tractor", "roll_rate.semitrailer")


def magic_formula(slip: ca.SX, load: ca.SX, stiffness: ca.SX, friction: ca.SX) -> ca.SX:
    """D sin(c atan(B a)): D = mu N, the slope B c D is the stiffness (Pacejka 2006, without curvature)."""
    peak = friction * load
    return peak * ca.sin(SHAPE * ca.atan(stiffness / (SHAPE * peak) * slip))


def simulated(truck: fw.Vehicle, friction: float, acceleration: float = 3.0, seed: int = 0) -> fw.Record:
    """A single sine at 24 m/s, with the noise of good gyros."""
    course, (steer, *_) = single_sine(truck, acceleration=acceleration), truck.steer_signals()
    truck = truck.with_logged_steering([steer], "sine")
    model = dynamics.model(truck, GYROS, roll=True, tyres=magic_formula)
    values = dynamics.all_parameters(truck, GYROS, tyres=magic_formula) | {"road.friction": friction}
    inputs = {"speed": np.full_like(course.time, 24.0), steer: course.steer}
    _, rates = free_response(model, values, course.time, inputs)
    rates += np.random.default_rng(seed).normal(0, 1e-3, rates.shape)
    return fw.Record(time=course.time, signals=inputs | dict(zip(GYROS, rates.T, strict=True)), name="sine")


def main() -> None:
    """Identify with the law of the truck and with the built-in one."""
    truck = fw.vehicle("cheng_cebon_2011")
    record = simulated(truck, FRICTION)
    stiffnesses = [name for name in truck.parameters() if name.endswith("cornering_stiffness")]
    guess = truck.replace({name: 0.85 * truck.parameters()[name] for name in stiffnesses})
    known = {"road.friction": "0.5 +- 40 %", "others": "exact", "sensors": "exact"}
    for law in (magic_formula, "saturating"):
        result = fw.identify([record], guess, fw.OneStage(given=known, tyres=law, check=False))
        print(f"{getattr(law, '__name__', law)}: log likelihood {result.log_likelihood:.0f}")
        for name, true in (*[(n, truck.parameters()[n]) for n in stiffnesses], ("road.friction", FRICTION)):
            estimate = result[name]
            print(f"  {name}: {estimate.value / true:.3f} +- {estimate.sigma / true:.3f} of the true value")


if __name__ == "__main__":
    main()
