"""A static roll test, with the uncertainty that identifications assume for all other numbers."""

from fifthwheel.identify.settings import DEFAULT_CONSIDERED, MODEL_ERRORS
from fifthwheel.identify.unknowns.parameters import longest_matching_key
from fifthwheel.vehicle import RollTest, Vehicle, changes, with_roll_test


def roll_tested_vehicle(vehicle: Vehicle, test: RollTest) -> Vehicle:
    """The vehicle with the result of a roll test; see `vehicle.with_roll_test`.

    Other numbers have the standard deviations that the vehicle file states, or else the default ones.

    Raises:
        VehicleError: the test is not plausible, or does not suit the vehicle.
    """
    relative = {key: sigma for key, sigma in DEFAULT_CONSIDERED.items() if key not in MODEL_ERRORS}
    sigmas = {}
    for path, value in vehicle.parameters().items():
        if (key := longest_matching_key(path, relative)) and value > 0:
            sigmas[path] = relative[key] * value
    masses = {path: abs(s) for change in changes(vehicle) for path, s in change.slopes.items() if path.endswith("mass")}
    tested = with_roll_test(vehicle, test, {**sigmas, **masses, **vehicle.stated})
    return tested.model_copy(update={"source": f"{vehicle.source}; roll test of the {test.unit}".removeprefix("; ")})


def tested_numbers(before: Vehicle, after: Vehicle) -> dict[str, dict[str, float]]:
    """Value and sigma, SI, of every number by its path that a roll test has set."""
    old, new = before.parameters(), after.parameters()
    changed = [path for path in new if (new[path], after.stated.get(path)) != (old[path], before.stated.get(path))]
    return {path: {"value": new[path], "sigma": after.stated[path]} for path in changed}
