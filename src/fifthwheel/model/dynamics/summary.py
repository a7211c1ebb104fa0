"""What a vehicle is, in numbers that an engineer checks first."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from fifthwheel.base import pages
from fifthwheel.base.arguments import expect
from fifthwheel.base.formatting import enumerated, fixed
from fifthwheel.base.pages.html import Displayed
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.channels import ROLL_RATE, SignalName, is_of
from fifthwheel.model.dynamics.state_space import (
    Mode,
    critical_speed,
    matrices,
    modes,
    rearward_amplification,
    understeer_gradient,
)
from fifthwheel.truck import Vehicle


@dataclass(frozen=True, kw_only=True)
class VehicleSummary(Displayed):
    """Loads, handling and modes of a vehicle at one speed; `print` shows a table."""

    name: str
    speed: float
    """m/s."""
    axle_loads: dict[str, float]
    """Static vertical load of each axle group by its path, N."""
    understeer_gradient: float
    """See `understeer_gradient`, rad s^2/m."""
    critical_speed: float | None
    """Lowest speed at which the vehicle is unstable, m/s; None up to 80 m/s."""
    rearward_amplification: float | None
    """Of the last unit (ISO 14791); None for a single unit, or where the vehicle is unstable."""
    modes: tuple[tuple[float, float], ...]
    """Frequency, Hz, and damping ratio of each oscillation."""
    motions: tuple[str, ...]
    """Main motion of each oscillation: "yaw", or "roll, tractor and lead against semitrailer"."""

    def rows(self) -> list[tuple[str, str]]:
        """Name and value of each quantity, with its unit."""
        rows = [(f"load, {path}", f"{fixed(load / 1e3, 1)} kN") for path, load in self.axle_loads.items()]
        gradient = np.degrees(self.understeer_gradient) * STANDARD_GRAVITY
        rows.append(("understeer gradient", f"{fixed(float(gradient), 2)} deg/g"))
        stable = "above 288 km/h" if self.critical_speed is None else f"{fixed(3.6 * self.critical_speed, 0)} km/h"
        rows.append(("critical speed", stable))
        if self.rearward_amplification is not None:
            rows.append(("rearward amplification", fixed(self.rearward_amplification, 2)))
        for (frequency, damping), motion in zip(self.modes, self.motions, strict=True):
            rows.append((f"oscillation in {motion}", f"{fixed(frequency, 2)} Hz, damping ratio {fixed(damping, 2)}"))
        return rows

    def table(self, head: str = "Value") -> pages.Table:
        """The rows below their heads."""
        return pages.Table(("Quantity", f"{head}>"), self.rows(), label="Loads and handling")

    def _document(self) -> pages.Document:
        return pages.Document(f"{self.name} {self.at_speed}", [self.table()])

    @property
    def at_speed(self) -> str:
        """The speed in words."""
        return f"at {fixed(3.6 * self.speed, 0)} km/h"


def summarize(vehicle: Vehicle, speed: float = 80 / 3.6) -> VehicleSummary:
    """Axle loads, understeer gradient, critical speed, rearward amplification and oscillations of a vehicle.

    Args:
        vehicle: the vehicle; at least one axle is steerable.
        speed: m/s.

    Raises:
        VehicleError: the speed is not positive, no axle is steerable, or the axle loads are not determined.

    Example:
        >>> import fifthwheel as fw
        >>> summary = fw.summarize(fw.vehicle("cheng_cebon_2011"))
        >>> print(summary)  # doctest: +ELLIPSIS
        cheng_cebon_2011 at 80 km/h
        <BLANKLINE>
        Quantity                                                            Value
        load, tractor.front                                               67.6 kN
        ...
    """
    expect("vehicle", vehicle, Vehicle)
    limit = critical_speed(vehicle)
    oscillations = [mode for mode in modes(vehicle, speed) if mode.eigenvalue.imag > 1e-9]
    stable = limit is None or speed < limit
    return VehicleSummary(
        name=vehicle.name,
        speed=speed,
        axle_loads=vehicle.axle_loads(),
        understeer_gradient=understeer_gradient(vehicle),
        critical_speed=limit,
        rearward_amplification=rearward_amplification(vehicle, speed)[0] if stable and len(vehicle.units) > 1 else None,
        modes=tuple((mode.frequency, mode.damping) for mode in oscillations),
        motions=_motions(vehicle, speed, oscillations),
    )


def _motions(vehicle: Vehicle, speed: float, oscillations: list[Mode]) -> tuple[str, ...]:
    """Main motion of each oscillation: yaw for those next to the eigenvalues of the model without roll, else roll."""
    system = matrices(vehicle, speed, roll=True)
    values, yaw = np.linalg.eigvals(system.A), np.linalg.eigvals(matrices(vehicle, speed, roll=False).A)
    near, _ = linear_sum_assignment(np.abs(np.subtract.outer(values, yaw)))
    rest = np.delete(values, near)
    rates = {i: SignalName.of(name).place for i, name in enumerate(system.states) if is_of(name, ROLL_RATE)}
    return tuple(
        f"roll, {_rolling(mode, rates)}" if np.isclose(rest, mode.eigenvalue).any() else "yaw" for mode in oscillations
    )


def _rolling(mode: Mode, rates: Mapping[int, str]) -> str:
    """The units, by the states of their roll rates, that roll most in an oscillation, and those that roll against them.

    Units with less than half of the largest amplitude are left out.
    """
    largest = mode.shape[max(rates, key=lambda i: abs(mode.shape[i]))]
    shape = {unit: complex(mode.shape[i] / largest) for i, unit in rates.items()}
    sides = [[unit for unit, x in shape.items() if abs(x) > 0.5 and (x.real > 0) == along] for along in (True, False)]
    return " against ".join(enumerated(side) for side in sides if side)
