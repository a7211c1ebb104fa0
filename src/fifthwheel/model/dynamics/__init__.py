"""The linear equations of motion of a chain of units: symbolic models for filters, and numerical analysis."""

from fifthwheel.model.dynamics.analysis import (
    Matrices,
    Mode,
    critical_speed,
    is_stable,
    matrices,
    matrices_of_variants,
    modes,
    steady_state,
)
from fifthwheel.model.dynamics.chain import state_names
from fifthwheel.model.dynamics.model import (
    CONTACT,
    SLOPES,
    SPEED_DELAY,
    SPEED_RATE,
    STEER_RATE,
    TIME_SCALE,
    ChainModel,
    all_parameters,
    contact_input,
    model,
    rate_input,
)
from fifthwheel.model.dynamics.state_space import (
    LinearSystem,
    frequency_response,
    linear_system,
    rearward_amplification,
    steady_steer,
    understeer_gradient,
)
from fifthwheel.model.dynamics.steering import SteerAngle, measured_angle, steer_angle, steer_parameters, true_angles

__all__ = [
    "CONTACT",
    "SLOPES",
    "SPEED_DELAY",
    "SPEED_RATE",
    "STEER_RATE",
    "TIME_SCALE",
    "ChainModel",
    "LinearSystem",
    "Matrices",
    "Mode",
    "SteerAngle",
    "all_parameters",
    "contact_input",
    "critical_speed",
    "frequency_response",
    "is_stable",
    "linear_system",
    "matrices",
    "matrices_of_variants",
    "measured_angle",
    "model",
    "modes",
    "rate_input",
    "rearward_amplification",
    "state_names",
    "steady_state",
    "steady_steer",
    "steer_angle",
    "steer_parameters",
    "true_angles",
    "understeer_gradient",
]
