"""Paths of the scalars of a vehicle, such as 'tractor.front.cornering_stiffness', and their units."""

from fifthwheel.errors import VehicleError, suggestion
from fifthwheel.names import ParameterPath

SI_UNITS = {
    "mass": "kg",
    "cog": "m",
    "yaw_inertia": "kg m^2",
    "roll_axis_height": "m",
    "cog_height": "m",
    "roll_inertia": "kg m^2",
    "roll_yaw_product": "kg m^2",
    "height": "m",
    "width": "m",
    "floor_height": "m",
    "cornering_stiffness": "N/rad",
    "roll_stiffness": "N m/rad",
    "tyre_roll_stiffness": "N m/rad",
    "roll_damping": "N m s/rad",
    "relaxation_length": "m",
    "position": "m",
    "leading_position": "m",
    "trailing_position": "m",
}
"""SI unit of each quantity of a vehicle, the last word of a path."""

TYRE_UNITS = {
    "friction": "1",
    "relative_friction": "1",
    "shape": "1",
    "stiffness_load_sensitivity": "1",
    "friction_load_sensitivity": "1",
    "combined_slip": "1",
    "half_track": "m",
    "static_load": "N",
    "tyres": "1",
    "braking_load": "N/(m/s^2)",
    "braked_mass": "kg",
}
"""The same for tyres that saturate, see `dynamics.saturation`."""


def unit_of(path: str) -> str:
    """SI unit of a parameter: 'N/rad', 'kg m^2', 'm'.

    Raises:
        VehicleError: the path does not end with the name of a quantity.
    """
    quantity = ParameterPath.of(path).quantity
    units = SI_UNITS | TYRE_UNITS
    if quantity not in units:
        raise VehicleError(f"{path}: expected the path of a parameter; {suggestion(quantity, SI_UNITS)}")
    return units[quantity]
