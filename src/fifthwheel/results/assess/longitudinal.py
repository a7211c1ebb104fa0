"""Startability, gradeability, acceleration and braking.

The first three follow from the engine and the gears that `[driveline]` states. The force at the driven wheels in a gear
is that of the engine, and at most the friction of the road:

    F = efficiency * torque * gear * final drive / tyre radius,        F <= mu N of the driven group,

with the torque `launch_torque` while the clutch closes, up to `launch_speed` of the engine, and the smaller of
`engine_torque` and `engine_power` / speed above, up to `governed_speed`. The gears lie in geometric steps. On a grade
tan(a) the truck needs

    F = m g (sin a + c_r cos a) + rho / 2 CdA v^2.

Startability and gradeability: the steepest grade in the lowest gear, with the launch torque and with the largest torque
of the engine. The load of the driven group on the grade follows from `Vehicle.axle_loads`. Speed on a grade: the
highest speed that the engine keeps on 1 %. Acceleration: the time for 100 m from rest on a level road at full load,
with a gear change at the governed speed, during which nothing drives; the truck starts in the gear, and changes by the
number of gears, that take the least time. Turbo lag and the torque that the gearbox limits are not included.

National Transport Commission, Performance-Based Standards Scheme, The Standards and Vehicle Assessment Rules (2008).
The driven group is the last one of `Vehicle.driven_groups`.

Braking efficiency: a group with the braking force F_x needs the friction -F_x / N, and the efficiency is the
deceleration z over the largest of them: the fraction of the friction that a stop without locked wheels can use. The
brakes are those that are stated, else F_x = -z N_0, in proportion to the static loads. R. D. Ervin and Y. Guy, The
influence of weights and dimensions on the stability and control of heavy-duty trucks in Canada, UMTRI-86-35 (1986).
"""

import math
from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np

from fifthwheel.base.formatting import enumerated
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.results.assess.low_speed_turn import FRICTION
from fifthwheel.results.assess.measures import title
from fifthwheel.results.assess.truck import Truck, Values
from fifthwheel.truck import Vehicle
from fifthwheel.truck.driveline import drag, driveline_numbers, rotating_mass

GRADE, DISTANCE = 0.01, 100.0
"""Rise over run of the speed on a grade, and distance of the acceleration, m."""
START_GEARS, SKIPPED = 4, (1, 2, 3)
"""Number of gears in which the truck may start, and numbers of gears of one change."""
POINTS = 60
"""Speeds at which a gear is evaluated."""
TORQUES = {"startability": "launch_torque", "gradeability": "engine_torque"}
"""Torque of the engine that climbs, by measure."""
_LOWEST = ("lowest_gear", "final_drive", "tyre_radius")
_ENGINE = ("engine_torque", "engine_power", "launch_speed", "governed_speed", "highest_gear", "gear_step")
NEEDED: Mapping[str, tuple[str, ...]] = {
    "startability": ("launch_torque", *_LOWEST),
    "gradeability": ("engine_torque", *_LOWEST),
    "grade_speed": (*_ENGINE, *_LOWEST),
    "acceleration_time": ("launch_torque", "shift_time", *_ENGINE, *_LOWEST),
}
"""Keys of `[driveline]` that each measure needs; `DRIVELINE` has the others."""
OF_SENSORS = ("torque_scale", "speed_scale")
"""Keys of `[driveline]` that belong to the sensors of a log."""
DECELERATION = 0.4
"""Of the stop, g."""


def numbers(vehicle: Vehicle) -> dict[str, tuple[float, float]]:
    """Value and standard deviation, SI, of each number of the driveline that is stated or has a figure, by its key."""
    given = {} if vehicle.driveline is None else vehicle.driveline.model_dump(exclude_none=True)
    stated = {key: (value, vehicle.stated.get(f"driveline.{key}", 0.0)) for key, value in given.items()}
    return stated | driveline_numbers(vehicle.driveline, vehicle.stated)


def _values(vehicle: Vehicle) -> dict[str, float]:
    return {key: value for key, (value, _) in numbers(vehicle).items()}


def sigmas(vehicle: Vehicle) -> dict[str, float]:
    """Standard deviation, SI, of each number of the driveline that the measures use, by its path; of none if the engine
    is not stated."""
    used = {} if len(unstated(vehicle)) == len(NEEDED) else numbers(vehicle)
    return {f"driveline.{key}": sigma for key, (_, sigma) in used.items() if key not in OF_SENSORS and sigma}


def completed(vehicle: Vehicle) -> Vehicle:
    """The vehicle with every number of its driveline, if its engine is stated."""
    if not sigmas(vehicle):
        return vehicle
    return type(vehicle)(**vehicle.model_dump() | {"driveline": _values(vehicle)})


def unstated(vehicle: Vehicle) -> dict[str, tuple[str, ...]]:
    """Paths of the numbers of the driveline that a vehicle lacks, by the measure that needs them."""
    known = numbers(vehicle)
    missing = {
        measure: tuple(f"driveline.{key}" for key in keys if key not in known) for measure, keys in NEEDED.items()
    }
    return {measure: paths for measure, paths in missing.items() if paths}


def measure(truck: Truck) -> Values:
    """The measures whose numbers are stated: startability and gradeability, rise over run; speed on the grade, m/s;
    time for 100 m, s."""
    missing, n = unstated(truck.vehicle), _values(truck.vehicle)
    values = Values()
    for name, torque in TORQUES.items():
        if name not in missing:
            values[name] = min(grades(truck, _pull(n, torque)))
    if "grade_speed" not in missing:
        values["grade_speed"] = speed_on_grade(truck, n)
    if "acceleration_time" not in missing:
        values |= {"acceleration_time": time} if math.isfinite(time := time_from_rest(truck, n)) else {}
    return values


def notes(truck: Truck, values: Values) -> list[str]:
    """What limits startability and gradeability, and why there is no speed on the grade or no time for 100 m, by the
    measures of the truck."""
    n = _values(truck.vehicle)
    limited: dict[str, list[str]] = {}
    for name, torque in TORQUES.items():
        if name in values:
            of_engine, of_friction = grades(truck, _pull(n, torque))
            friction = f"the friction of the driven axles (coefficient {FRICTION}), not by the engine"
            limited.setdefault(friction if of_friction < of_engine else "the engine", []).append(title(name))
    found = [f"{enumerated(titles)}: limited by {limit}" for limit, titles in limited.items()]
    if values.get("grade_speed") == 0:
        cure = "check driveline.engine_torque, driveline.engine_power and driveline.lowest_gear"
        found.append(f"{title('grade_speed')}: 0, the engine is too weak for the grade in every gear; {cure}")
    if "acceleration_time" not in {*values, *unstated(truck.vehicle)}:
        reason = "the truck does not start on a level road; check driveline.launch_torque and driveline.lowest_gear"
        if values["startability"] > 0:
            reason = (
                "after a gear change the engine is slower than driveline.launch_speed; check it, driveline.gear_step"
                " and driveline.governed_speed"
            )
        found.append(f"{title('acceleration_time')}: none, {reason}")
    return found


def grades(truck: Truck, force: float) -> tuple[float, float]:
    """Rise over run that a force of the driveline, N, can climb, and that the friction of the driven group permits."""
    vehicle, (rolling, _) = truck.vehicle, numbers(truck.vehicle)["rolling_resistance"]
    weight, driven = _weight(vehicle), vehicle.driven_groups()[-1]
    level = vehicle.axle_loads()[driven]
    rise = vehicle.axle_loads(1.0, {driven: weight})[driven] - level  # of its load over cos a, for each rise over run
    of_friction = (FRICTION * level - rolling * weight) / (weight - FRICTION * rise)
    along = force / weight / math.hypot(1.0, rolling)
    of_engine = math.tan(math.asin(along) - math.atan(rolling)) if along < 1 else math.inf
    return of_engine, of_friction


def speed_on_grade(truck: Truck, n: Mapping[str, float]) -> float:
    """Highest speed, m/s, at which the engine keeps the speed on `GRADE`; 0 if there is none."""
    highest = n["governed_speed"] / _ratio(n, n["highest_gear"])
    speeds = np.linspace(0.0, highest, 20 * POINTS)[1:]
    force = np.max([_force(n, gear, speeds) for gear in _gears(n)], axis=0)
    excess = force - _resistance(truck, n, speeds) - _weight(truck.vehicle) * GRADE
    if not (kept := np.flatnonzero(excess >= 0)).size:
        return 0.0
    k = int(kept[-1])
    if k + 1 == speeds.size:
        return highest
    return float(speeds[k] + (speeds[k + 1] - speeds[k]) * excess[k] / (excess[k] - excess[k + 1]))


def time_from_rest(truck: Truck, n: Mapping[str, float]) -> float:
    """Shortest time, s, for `DISTANCE` on a level road; inf if the engine cannot start the truck."""
    gears = _gears(n)
    choices = product(range(min(START_GEARS, len(gears))), SKIPPED)
    return min((_time(truck, n, gears[first::skip]) for first, skip in choices), default=math.inf)


def _time(truck: Truck, n: Mapping[str, float], gears: Array) -> float:
    """Time, s, for `DISTANCE` in gears, one after the other; inf if the clutch does not close in one of them."""
    time = distance = speed = 0.0
    for k, gear in enumerate(gears.tolist()):
        if k:
            lost = float(_resistance(truck, n, speed)) / _weight(truck.vehicle) * GRAVITY * n["shift_time"]
            rolled = (speed - lost / 2) * n["shift_time"]
            if distance + rolled >= DISTANCE:
                return time + (DISTANCE - distance) / (speed - lost / 2)
            time, distance, speed = time + n["shift_time"], distance + rolled, speed - lost
            if speed < n["launch_speed"] / _ratio(n, gear):
                return math.inf
        v, rate = _rates(truck, n, gear, speed)
        if not rate[0] > 0:
            return math.inf if not k else time + (DISTANCE - distance) / speed
        reached = np.logical_and.accumulate(rate > 0)
        v, rate = v[: reached.sum() + 1], rate[reached]
        lasting = np.diff(v) / rate
        passed = distance + np.cumsum(lasting * (v[1:] + v[:-1]) / 2)
        if passed[-1] >= DISTANCE:
            j = int(np.argmax(passed >= DISTANCE))
            left = DISTANCE - (passed[j - 1] if j else distance)
            return float(time + lasting[:j].sum() + 2 * left / (v[j] + math.sqrt(v[j] ** 2 + 2 * rate[j] * left)))
        time, distance, speed = time + float(lasting.sum()), float(passed[-1]), float(v[-1])
    return time + (DISTANCE - distance) / speed


def _rates(truck: Truck, n: Mapping[str, float], gear: float, speed: float) -> tuple[Array, Array]:
    """Speeds in a gear from a given one up to the governed one, (N + 1,) m/s, and accelerations between, (N,) m/s^2."""
    ratio, vehicle = _ratio(n, gear), truck.vehicle
    engaged, highest = n["launch_speed"] / ratio, n["governed_speed"] / ratio
    kinks = [v for v in (engaged, n["engine_power"] / n["engine_torque"] / ratio) if speed < v < highest]
    v = np.unique([*np.linspace(speed, highest, POINTS), *kinks])
    middle = (v[1:] + v[:-1]) / 2
    closed = middle > engaged
    launch = n["launch_torque"] * n["efficiency"] * ratio
    friction = FRICTION * vehicle.axle_loads()[vehicle.driven_groups()[-1]]
    force = np.minimum(np.where(closed, _force(n, gear, middle), launch), friction)
    of_engine = np.where(closed, ratio**2, 0.0)
    rotating = rotating_mass(sum(vehicle.tyres().values()), n["rotating_mass"], n["engine_inertia"], of_engine)
    return v, (force - _resistance(truck, n, middle)) / (_weight(vehicle) / GRAVITY + rotating)


def _force(n: Mapping[str, float], gear: float, speeds: Array) -> Array:
    """Largest force of the driveline in a gear, N, at speeds (N,) above 0, m/s; 0 where the engine cannot turn so."""
    ratio = _ratio(n, gear)
    engine = speeds * ratio
    torque = np.minimum(n["engine_torque"], n["engine_power"] / engine)
    turns = (engine >= n["launch_speed"]) & (engine <= n["governed_speed"] * (1 + 1e-9))
    return np.asarray(np.where(turns, torque * n["efficiency"] * ratio, 0.0))


def _gears(n: Mapping[str, float]) -> Array:
    """Ratios from the lowest to the highest gear in equal steps, as near to `gear_step` as possible."""
    span = n["lowest_gear"] / n["highest_gear"]
    count = max(round(math.log(span) / math.log(n["gear_step"])), 0) if span > 1 else 0
    return np.geomspace(n["lowest_gear"], n["highest_gear"], count + 1)


def _pull(n: Mapping[str, float], torque: str) -> float:
    """Force of the driveline in the lowest gear, N, with the torque of a key."""
    return n[torque] * n["efficiency"] * _ratio(n, n["lowest_gear"])


def _ratio(n: Mapping[str, float], gear: float) -> float:
    """Engine speed over speed, rad/m."""
    return gear * n["final_drive"] / n["tyre_radius"]


def _resistance(truck: Truck, n: Mapping[str, float], speed: Any) -> Any:
    """Drag and rolling resistance on a level road, N, at a speed, m/s."""
    return drag(n["drag_area"], speed) + n["rolling_resistance"] * _weight(truck.vehicle)


def _weight(vehicle: Vehicle) -> float:
    return sum(unit.mass for unit in vehicle.units) * GRAVITY


def measure_braking(truck: Truck) -> Values:
    """The braking efficiency; 0 if an axle group lifts."""
    static = truck.vehicle.axle_loads()
    shares = static
    if stated := truck.body.brakes:
        per_fraction = sum(static.values()) / sum(stated.values())
        shares = {path: fraction * per_fraction for path, fraction in stated.items() if fraction}
    braked = truck.vehicle.axle_loads(-DECELERATION, {path: -DECELERATION * share for path, share in shares.items()})
    return {"braking_efficiency": max(0.0, min(braked[path] / share for path, share in shares.items()))}
