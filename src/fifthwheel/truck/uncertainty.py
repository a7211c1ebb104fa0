"""The uncertainty of the masses and lengths of a vehicle, as independent changes that each alter several parameters.

One scale weighs all units, one drawing gives the positions of all axles, and a payload mass is the difference of a
laden and an unladen mass. Numbers from one measurement share its error, so a change alters all of them.

A number with a stated standard deviation is altered by one change only, so that the changes together give it
exactly the stated standard deviation. This change is its own, except for the axles of a group whose positions are all
stated: they share one change. All other numbers have the standard deviations of their rows (`quantities`).
"""

from collections.abc import Mapping
from dataclasses import dataclass

from fifthwheel.base.names import ParameterPath, begins_with
from fifthwheel.truck.quantities import MASS_SCALE, quantity_of
from fifthwheel.truck.unit import ACCELEROMETERS, Unit
from fifthwheel.truck.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Change:
    """A random change of a vehicle, N(0, 1), independent of all others: parameter = value + slope * change."""

    name: str
    slopes: Mapping[str, float]
    """Change of each parameter by one standard deviation, SI, by path."""


def changes(vehicle: Vehicle) -> tuple[Change, ...]:
    """The uncertainty of a vehicle as independent changes, front to rear; empty if every number is exact.

    The changes are `MASS_SCALE`; of each unit `<unit>.mass`, `<unit>.payload.mass`, `<unit>.cog`,
    `<unit>.axle_positions` and `<unit>.coupling`; `<group>.axle_positions` of several axles whose positions are all
    stated; the self-steering and the command steering of axles, and the yaw stiffness and damping of couplings, where
    they are not 0; and the path of every other parameter with a stated standard deviation above 0. A change that alters
    no parameter is left out. Roll stiffness, heights, yaw inertia and relaxation lengths have a change of their own
    only if their standard deviation is stated. The place of an accelerometer and the driveline have none: they do not
    change the lateral motion.
    """
    stated = vehicle.stated
    slopes: dict[str, dict[str, float]] = {MASS_SCALE: {}}
    for i, unit in enumerate(vehicle.units):
        mass = f"{unit.name}.mass"
        if mass not in stated:
            slopes[MASS_SCALE] |= _mass_scale(vehicle, unit)
        sigma = stated.get(mass, quantity_of("mass").sigma * unit.mass)
        slopes[mass] = _scaled_masses(vehicle, unit, sigma / unit.mass)
        slopes |= _division(vehicle, unit)
        cog = f"{unit.name}.cog"
        slopes[cog] = {cog: stated.get(cog, cog_sigma(laden=unit.payload is not None))}
        slopes |= _positions(vehicle, i)
        for axle in unit.axles:
            for key, row in (("self_steering", "self_steering.castor"), ("command_steering", "command_steering")):
                path = f"{unit.name}.{axle.name}.{key}"
                if getattr(axle, key):
                    slopes[path] = {path: stated.get(path, quantity_of(row).sigma)}
    for coupling in vehicle.couplings:
        for row in ("yaw_stiffness.spring", "yaw_damping.damper"):
            key = row.partition(".")[0]
            if value := getattr(coupling, key):
                path = f"{coupling.name}.{key}"
                slopes[path] = {path: stated.get(path, quantity_of(row).sigma_of(value))}
    altered = {path for by_path in slopes.values() for path in by_path}
    parsed = {path: ParameterPath.of(path) for path in stated if path not in altered}
    slopes |= {
        path: {path: stated[path]}
        for path, (unit_name, component, _) in parsed.items()
        if unit_name != "driveline" and not any(begins_with(component, key) for key in ACCELEROMETERS)
    }
    nonzero = {name: {path: s for path, s in by_path.items() if s} for name, by_path in slopes.items()}
    return tuple(Change(name=name, slopes=by_path) for name, by_path in nonzero.items() if by_path)


def cog_sigma(*, laden: bool) -> float:
    """Standard deviation of the CoG position of a unit, m, where nobody states it."""
    return quantity_of("cog" if laden else "cog.unladen").sigma


def _mass_scale(vehicle: Vehicle, unit: Unit) -> dict[str, float]:
    """Slopes of the mass scale on a unit: a body of the same shape and another density."""
    p, fraction = vehicle.parameters(), quantity_of(MASS_SCALE).sigma
    keys = ("yaw_inertia", "sprung.roll_inertia", "sprung.roll_yaw_product")
    inertias = {path: fraction * p[path] for key in keys if (path := f"{unit.name}.{key}") not in vehicle.stated}
    return _scaled_masses(vehicle, unit, fraction) | inertias


def _scaled_masses(vehicle: Vehicle, unit: Unit, fraction: float) -> dict[str, float]:
    """Slopes of the masses of a unit whose mass changes by a fraction: stated ones stay, the others take it all."""
    masses = {f"{unit.name}.sprung.mass": unit.sprung.mass}
    if unit.payload is not None:
        masses[f"{unit.name}.payload.mass"] = unit.payload.mass
    free = {path: mass for path, mass in masses.items() if path not in vehicle.stated}
    scale = fraction * sum(masses.values()) / sum(free.values()) if free else 0.0
    return {f"{unit.name}.mass": fraction * unit.mass} | {path: scale * mass for path, mass in free.items()}


def _division(vehicle: Vehicle, unit: Unit) -> dict[str, dict[str, float]]:
    """Changes of the division of a unit's mass between payload and sprung body, whose sum stays.

    A stated mass of the sprung body determines the division as well as a stated payload. If both are stated, each has
    its change, and the axles and wheels take the difference: the mass of the unit stays.
    """
    if unit.payload is None:
        return {}
    body, payload = f"{unit.name}.sprung.mass", f"{unit.name}.payload.mass"
    of_body, of_payload = vehicle.stated.get(body), vehicle.stated.get(payload)
    if of_body is None:
        default = quantity_of("payload.mass").sigma * unit.payload.mass
        sigma = default if of_payload is None else of_payload
        return {payload: {payload: sigma, body: -sigma}}
    return {body: {body: of_body, payload: -of_body}} if of_payload is None else {}


def _positions(vehicle: Vehicle, i: int) -> dict[str, dict[str, float]]:
    """Changes of the positions on unit i from its front reference: the first axle, or the coupling in front of it."""
    unit, stated = vehicle.units[i], vehicle.stated
    reference = vehicle.couplings[i - 1].trailing_position if i else unit.axles[0].position
    distances = {f"{unit.name}.{axle.name}.position": axle.position - reference for axle in unit.axles}
    scale = quantity_of("axle_positions").sigma / max(max(map(abs, distances.values())), 1.0)
    axles = {path: scale * distance for path, distance in distances.items()}
    slopes = {f"{unit.name}.axle_positions": {path: s for path, s in axles.items() if path not in stated}}
    for group in unit.axle_groups:
        paths = [f"{unit.name}.{axle.name}.position" for axle in group.axles]
        if len(paths) > 1 and all(path in stated for path in paths):  # one measurement to the middle of the group
            slopes[f"{unit.group_path(group)}.axle_positions"] = {path: stated[path] for path in paths}
    if i < len(vehicle.couplings):
        path = f"{vehicle.couplings[i].name}.leading_position"
        wheelbase = reference - unit.axle_groups[-1].position if i else vehicle.wheelbase
        sigma = quantity_of("coupling").sigma * abs(wheelbase)
        slopes[f"{unit.name}.coupling"] = {} if path in stated else {path: sigma}
    return slopes
