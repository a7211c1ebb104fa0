"""The linear equations of motion of a chain of units: symbolic models for filters, and numerical analysis."""

from fifthwheel.dynamics.analysis import (
    Matrices,
    Mode,
    critical_speed,
    is_stable,
    matrices,
    matrices_of_variants,
    modes,
    steady_state,
)
from fifthwheel.dynamics.chain import state_names
from fifthwheel.dynamics.model import (
    CONTACT,
    SPEED_RATE,
    STEER_RATE,
    TIME_SCALE,
    ChainModel,
    all_parameters,
    contact_input,
    model,
    rate_input,
    steer_parameters,
)
from fifthwheel.dynamics.state_space import (
    LinearSystem,
    frequency_response,
    linear_system,
    rearward_amplification,
    steady_steer,
    understeer_gradient,
)

__all__ = [
    "CONTACT",
    "SPEED_RATE",
    "STEER_RATE",
    "TIME_SCALE",
    "ChainModel",
    "LinearSystem",
    "Matrices",
    "Mode",
    "all_parameters",
    "contact_input",
    "critical_speed",
    "frequency_response",
    "is_stable",
    "linear_system",
    "matrices",
    "matrices_of_variants",
    "model",
    "modes",
    "rate_input",
    "rearward_amplification",
    "state_names",
    "steady_state",
    "steady_steer",
    "steer_parameters",
    "understeer_gradient",
]
