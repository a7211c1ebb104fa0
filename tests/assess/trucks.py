"""Trucks with simple closed forms: single axles, no relaxation lengths."""

from copy import deepcopy

from fifthwheel.vehicle import Vehicle, get


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
