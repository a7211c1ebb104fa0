"""The names of `tyres` and `vehicle.parameters` at their former place."""

from fifthwheel.dynamics.tyres import TyreLaw, braked_masses, saturation_names, saturation_parameters
from fifthwheel.vehicle.parameters import FRICTION, HALF_TRACK, TYRE_PARAMETERS

DEFAULTS = {name: parameter.default for name, parameter in TYRE_PARAMETERS.items()}
__all__ = [
    "DEFAULTS",
    "FRICTION",
    "HALF_TRACK",
    "TyreLaw",
    "braked_masses",
    "saturation_names",
    "saturation_parameters",
]
