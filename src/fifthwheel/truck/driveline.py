"""What the longitudinal balance of a vehicle needs: losses, rotating masses, resistances, engine, gears and brakes.

    (m + m_rot) dv/dt = F - rho/2 CdA v^2 - m g (c_r + grade),    m_rot = wheels * rotating_mass + J ratio^2

with the force F = efficiency * torque * ratio, and the ratio of engine speed to speed in rad/m.
"""

from collections.abc import Mapping
from typing import Any, Self

from pydantic import model_validator

from fifthwheel.base.errors import VehicleError
from fifthwheel.truck.classes import Figure
from fifthwheel.truck.component import Component, NonNegative, Positive, number
from fifthwheel.truck.quantities import DRAG_AREA, ROLLING_RESISTANCE, TYRES

AIR_DENSITY = 1.2
"""kg/m^3"""
DRIVELINE: Mapping[str, Figure] = {
    "efficiency": Figure(0.945, 0.01, "gearbox 0.97 to 0.99 and drive axle 0.96 to 0.97 under load"),
    "torque_scale": Figure(1.0, 0.02, "torque that engine control units broadcast is within 5 % of a dynamometer"),
    "speed_scale": Figure(1.0, 0.007, "tyre wear changes the rolling radius by up to 3 % between two calibrations"),
    "engine_inertia": Figure(3.5, 1.0, "engines of 11 to 13 litres with flywheel: 2.5 to 5 kg m^2"),
    "rotating_mass": Figure(55.0, 11.0, "wheel, tyre and brake disc: 13 to 15 kg m^2 at 0.5 m"),
    "drag_area": Figure(TYRES[DRAG_AREA].default, 0.9, "drag coefficient 0.5 to 0.8 times 8 to 10 m^2"),
    "rolling_resistance": Figure(TYRES[ROLLING_RESISTANCE].default, 0.001, "truck tyres of ISO 28580: 0.004 to 0.008"),
}
"""Numbers of heavy trucks with their standard deviations. There are none for engine and gears."""


def _optional(unit: str, description: str, low: float, high: float) -> Any:
    """A number that may be missing, with the range of road vehicles."""
    return number(unit, description, default=None, plausible=(low, high))


class Driveline(Component):
    """The table `[driveline]` of a vehicle file; `DRIVELINE` has the numbers that it omits, except engine and gears."""

    owner = "driveline"
    efficiency: Positive | None = _optional("1", "Power at the wheels over power of the engine.", 0.7, 1.0)
    torque_scale: Positive | None = _optional("1", "Engine torque in the log over the true one.", 0.7, 1.3)
    speed_scale: Positive | None = _optional("1", "Speed in the log over the true one.", 0.9, 1.1)
    engine_inertia: NonNegative | None = _optional(
        "kg m^2", "Engine with flywheel, clutch and gearbox input.", 0.1, 20.0
    )
    rotating_mass: NonNegative | None = _optional(
        "kg", "Of a wheel with its tyre: inertia over rolling radius squared.", 1.0, 300.0
    )
    drag_area: NonNegative | None = _optional("m^2", "Drag coefficient times frontal area.", 0.5, 20.0)
    rolling_resistance: NonNegative | None = _optional("1", "Rolling resistance over load.", 0.002, 0.05)
    engine_torque: Positive | None = _optional("N m", "Largest torque of the engine.", 100.0, 10e3)
    engine_power: Positive | None = _optional("W", "Largest power of the engine.", 20e3, 2e6)
    governed_speed: Positive | None = _optional("rad/s", "Largest speed of the engine under load.", 80.0, 500.0)
    launch_torque: Positive | None = _optional("N m", "Torque of the engine while the clutch closes.", 50.0, 10e3)
    launch_speed: Positive | None = _optional("rad/s", "Speed of the engine while the clutch closes.", 40.0, 300.0)
    lowest_gear: Positive | None = _optional("1", "Ratio of the lowest gear that starts the truck.", 1.0, 50.0)
    highest_gear: Positive | None = _optional("1", "Ratio of the highest gear.", 0.3, 3.0)
    gear_step: Positive | None = _optional("1", "Ratio of a gear over that of the next higher one.", 1.05, 3.0)
    shift_time: NonNegative | None = _optional("s", "Time without driving force in a gear change.", 0.0, 5.0)
    final_drive: Positive | None = _optional("1", "Ratio of the driven axles.", 1.0, 15.0)
    tyre_radius: Positive | None = _optional("m", "Rolling radius of the driven tyres.", 0.2, 1.5)

    @model_validator(mode="after")
    def _check(self) -> Self:
        for lower, higher in (("launch_speed", "governed_speed"), ("highest_gear", "lowest_gear")):
            low, high = getattr(self, lower), getattr(self, higher)
            if None not in (low, high) and not low < high:
                unit = self.si_units[lower].removeprefix("1")
                limit, got = (f"{x:.4g} {unit}".rstrip() for x in (high, low))
                raise VehicleError(f"{lower}: expected less than {higher}, {limit}, got {got}; correct one of them")
        return self


def drag(drag_area: Any, speed: Any) -> Any:
    """Drag of the air, N, at a speed in still air, m/s; numbers, arrays or symbols."""
    return AIR_DENSITY / 2 * drag_area * speed * speed


def rotating_mass(wheels: float, of_wheel: Any, engine_inertia: Any, squared_ratio: Any) -> Any:
    """What wheels, each with a rotating mass, kg, and the engine, kg m^2, add to the accelerated mass, kg.

    The squared ratio is that of engine speed over speed, 1/m^2.
    """
    return wheels * of_wheel + engine_inertia * squared_ratio


def driveline_numbers(driveline: Driveline | None, stated: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Value and standard deviation, SI, of each number of `Driveline` by its key: of the vehicle, else of `DRIVELINE`.

    A value in the vehicle file without a standard deviation has the relative one of `DRIVELINE`. The arguments are the
    fields of the vehicle.
    """
    given = {} if driveline is None else driveline.model_dump(exclude_none=True)
    numbers = {}
    for key, figure in DRIVELINE.items():
        value = given.get(key, figure.value)
        numbers[key] = value, stated.get(f"driveline.{key}", figure.relative * value)
    return numbers


def require_shares(brakes: Mapping[str, float]) -> None:
    """Raise VehicleError unless all shares are 0 or more, and one is above 0; no brakes at all are permitted."""
    if brakes and not (min(brakes.values()) >= 0 and 0 < sum(brakes.values()) < 1e6):
        raise VehicleError(f"brakes: expected fractions of 0 or more, one above 0, got {dict(brakes)}; correct them")
