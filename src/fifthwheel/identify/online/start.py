"""The steady state at which a learner starts, as a function of the unknowns.

E x' = F x + G d; in a steady state dx/dp = - F^-1 d(F x + G d)/dp.
"""

from typing import NamedTuple

import casadi as ca

from fifthwheel.dynamics.chain import equations, state_names
from fifthwheel.identify.online.online_model import OnlineModel
from fifthwheel.native import Scan, compiled


class SteadyEquations(NamedTuple):
    """At a speed and steer angles, without the bank as a state, for n states, k steered axles and n_p unknowns."""

    A: ca.SX  # (n, n) of x' = A x + B d
    B: ca.SX  # (n, k)
    F: ca.SX  # (n, n)
    steer: ca.SX  # (k,) angles of the wheels, rad
    bank: ca.SX  # (n,) effect of the bank on x'
    slopes: ca.SX  # (n, n_p) d(F x + G d)/dp


def steady_equations(model: OnlineModel, inputs: ca.SX, x: ca.SX, p: ca.SX, c: ca.SX) -> SteadyEquations:
    """The equations of a steady state.

    Args:
        model: of the learner.
        inputs: speed, m/s, and measured steer angles, rad.
        x: steady state (n,).
        p, c: of the model.
    """
    vehicle, value = model.chain.vehicle, model.values(p, c)
    n, speed = len(state_names(vehicle, roll=True)), inputs[0]
    steers = enumerate(vehicle.steer_signals(), 1)
    steer = ca.vertcat(*[value[f"{name}.gain"] * (inputs[i] - value[f"{name}.offset"]) for i, name in steers])
    terms = equations(value, vehicle, roll=True, bank=True)
    A, B = terms.state_space(speed)
    F = (terms.A0 + terms.A1 / speed + terms.A2 * speed)[:n, :n]
    slopes = ca.jacobian(F @ x + (terms.B0 + terms.B2 * speed)[:n, :] @ steer, p)
    return SteadyEquations(A[:n, :n], B[:n, :], F, steer, A[:n, n], slopes)


@compiled(Scan)
def steady_slopes(model: OnlineModel) -> ca.Function:
    """sample = [inputs, x]; constant = [p, c]; output = `slopes` of `SteadyEquations`, by columns; no carry."""
    vehicle = model.chain.vehicle
    n, k = len(state_names(vehicle, roll=True)), 1 + len(vehicle.steer_signals())
    n_p, n_c = model.observation.numel_in(2), model.observation.numel_in(3)
    nothing, sample, constant = ca.SX.sym("nothing", 0), ca.SX.sym("sample", k + n), ca.SX.sym("constant", n_p + n_c)
    steady = steady_equations(model, sample[:k], sample[k:], constant[:n_p], constant[n_p:])
    output = ca.vec(ca.densify(steady.slopes))
    return ca.Function("steady_slopes", [nothing, sample, constant], [nothing, output], {"cse": True})
