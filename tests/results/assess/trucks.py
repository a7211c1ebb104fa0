"""Trucks with simple closed forms: single axles, no relaxation lengths."""

from copy import deepcopy

from fifthwheel.truck import Vehicle, get

ENGINE = {
    "driveline.engine_torque": 2600.0,
    "driveline.engine_power": 397e3,
    "driveline.governed_speed": 199.0,
    "driveline.launch_torque": 1800.0,
    "driveline.launch_speed": 94.0,
    "driveline.lowest_gear": 11.73,
    "driveline.highest_gear": 0.78,
    "driveline.gear_step": 1.28,
    "driveline.shift_time": 0.8,
    "driveline.final_drive": 3.08,
    "driveline.tyre_radius": 0.5,
}
"""Engine and gears of a heavy truck, SI."""
CATALOGUE = ("cheng_cebon_2011", "b_double", "truck_dolly_semitrailer", "a_double", "truck_full_trailer")


def with_engine(vehicle: Vehicle, **changes: float) -> Vehicle:
    """A vehicle with `ENGINE`, in which some numbers are others."""
    numbers = {path.partition(".")[2]: value for path, value in ENGINE.items()}
    return Vehicle(**vehicle.model_dump() | {"driveline": numbers | changes})


def single_axles() -> Vehicle:
    """The tractor-semitrailer of the article with one axle in each group, without relaxation lengths."""
    fields = get("cheng_cebon_2011").model_dump()
    for unit in fields["units"]:
        for group in unit["axle_groups"]:
            group["axles"] = [group["axles"][len(group["axles"]) // 2]]
            group["relaxation_length"] = 0.0
            group["axles"][0]["steerable"] = group["name"] == "front"
    return Vehicle(**fields)


def rigid() -> Vehicle:
    """The tractor of that truck alone, almost without suspension, all mass sprung."""
    fields = single_axles().model_dump()
    tractor = fields["units"][0]
    for group in tractor["axle_groups"]:
        group |= {"roll_stiffness": 1e12, "tyre_roll_stiffness": 1e12}
    tractor["sprung"]["mass"] = tractor["mass"] * (1 - 1e-9)
    fields |= {"units": [tractor], "couplings": [], "stated": {}}
    return Vehicle(**fields)


def double() -> Vehicle:
    """Two of those semitrailers; a fifth wheel couples the second to the rear end of the first."""
    fields = single_axles().model_dump()
    second = deepcopy(fields["units"][1]) | {"name": "second"}
    coupling = deepcopy(fields["couplings"][0]) | {"name": "second_fifth_wheel", "leading_position": -10.0}
    return Vehicle(**fields | {"units": [*fields["units"], second], "couplings": [*fields["couplings"], coupling]})
