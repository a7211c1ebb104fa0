"""The rows of the gross errors: their sizes in the units of priors, and the range of what a truck can have."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.one_stage.identification import _implausible
from fifthwheel.estimate.identify.unknowns.parameters import one_stage_unknowns
from fifthwheel.estimate.identify.unknowns.unknown import Unknown, gross_error, is_possible
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import QUANTITIES, quantity_of

STEER = "steer.tractor.front"
OUTPUTS = (
    *("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.semitrailer", "articulation.semitrailer"),
    *("lateral_acceleration.tractor", "wheel_speed_difference.semitrailer"),
)


def unknowns(truck: Vehicle, tyres: str = "saturating") -> dict[str, Unknown]:
    steered = truck.with_logged_steering([STEER], "a log")
    return {u.name: u for u in one_stage_unknowns(steered, OUTPUTS, OneStage(tyres=tyres))}


def test_the_size_of_a_gross_error(truck: Vehicle) -> None:
    """Of masses and of the logarithm of numbers above 0 as a fraction, of positions in m, else SI; the range is three
    of them."""
    for name, path, size in (
        ("mass_scale", "semitrailer.mass", 0.3),
        ("semitrailer.payload.mass", "semitrailer.sprung.mass", 0.3),  # which replaces the payload
        ("semitrailer.axle_positions", "semitrailer.rear.position", 0.6),  # the axle that moves most
        ("tractor.coupling", "fifth_wheel.leading_position", 0.4),
        ("semitrailer.cornering_stiffness.variation", "semitrailer.cornering_stiffness", 0.3),
        (f"{STEER}.gain", f"{STEER}.gain", 0.4),
    ):
        unknown = unknowns(truck)[name]
        error = gross_error(unknown)
        relative = path.endswith("mass") or name.endswith("variation")
        change = unknown.scale * error.size * unknown.slopes[path] / (truck.parameters()[path] if relative else 1.0)
        assert abs(change) == pytest.approx(size), name
        for sign in (-1, 1):
            assert is_possible(unknown, sign * 2.99 * error.size)
            assert not is_possible(unknown, sign * 3.01 * error.size)


def test_what_few_trucks_have_is_noted(truck: Vehicle) -> None:
    """Of uncertain numbers only: the cornering stiffness is an estimate."""
    known = unknowns(truck)
    moved = dict.fromkeys(known, 0.0)
    moved |= {"tyre.combined_slip": 3.6, "body.drag_area": -7.9, "tyre.shape": 2.9}
    moved["semitrailer.cornering_stiffness"] = 5.0
    solution: Any = SimpleNamespace(
        problem=SimpleNamespace(names=list(moved), unknowns_by_name=known),
        minimum=SimpleNamespace(z=np.array(list(moved.values()))),
    )
    slip, drag = _implausible(solution)
    assert slip.startswith("tyre.combined_slip: the logs move it by +3.6 prior sigma, which few trucks have.")
    assert drag.startswith("body.drag_area: the logs move it by -7.9 prior sigma, beyond what a truck can have.")


def test_a_wide_prior_covers_what_a_truck_can_have(truck: Vehicle) -> None:
    """Then three standard deviations of the prior, or of its tail, are possible."""
    soft = unknowns(truck)["semitrailer.roll_stiffness"]
    for scale, possible in ((0.499, 0.5), (0.5, 0.5), (0.8, 0.8)):
        unknown = replace(soft, scale=scale, tail=1.0)
        assert (gross_error(unknown) is not None) == (scale < 0.5)
        assert is_possible(unknown, 2.99 * possible / scale)
        assert not is_possible(unknown, 3.01 * possible / scale)
    for tail, limit in ((3.0, 9.0), (0.5, 3.0)):
        unknown = replace(unknowns(truck)["semitrailer.cornering_stiffness"], tail=tail)
        assert gross_error(unknown) is None
        assert is_possible(unknown, -0.99 * limit)
        assert not is_possible(unknown, -1.01 * limit)
    assert is_possible(unknowns(truck)["road.friction"], 99.0)


def test_each_row_is_of_an_unknown(truck: Vehicle) -> None:
    stated = dict.fromkeys(("semitrailer.front.position", "fifth_wheel.leading_position"), 0.05)
    stated["fifth_wheel.trailing_position"] = 0.05
    joint = {f"fifth_wheel.{key}": 1e3 for key in ("roll_damping", "yaw_stiffness", "yaw_damping")}
    weighed = truck.replace(joint).with_stated({"semitrailer.sprung.mass": 50.0})
    cases = ((truck, "saturating"), (truck, "linear"), (truck.with_stated(stated), "saturating"), (weighed, "linear"))
    used = {id(quantity_of(name)) for vehicle, tyres in cases for name in unknowns(vehicle, tyres)}
    unused = {key for key, row in QUANTITIES.items() if row.gross and id(row) not in used}
    assert unused == {"time_base.delay"}  # of logs with several time bases


def test_a_change_means_the_same_whatever_its_standard_deviation(truck: Vehicle) -> None:
    """So the knowledge from earlier logs holds also where it is stated anew."""
    name, found = "semitrailer.axle_positions", []
    for sigma in ("1 cm", "10 cm"):
        vehicle, settings = applied(truck, OneStage(given={"semitrailer.wheelbase": f"+- {sigma}"}))
        found.append(next(u for u in one_stage_unknowns(vehicle, [], settings) if u.name == name))
    assert found[0].moves == pytest.approx(found[1].moves)
    assert found[1].scale == pytest.approx(10 * found[0].scale)
    assert max(map(abs, found[0].moves.values())) == 1.0
