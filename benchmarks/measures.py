"""Performance measures against independent calculations, and the coverage of their intervals.

    python benchmarks/measures.py              the table of five vehicles
    python benchmarks/measures.py --trucks 100 coverage of drawn trucks
    python benchmarks/measures.py --trucks 100 --cheap --higher 2.5 4.5
    python benchmarks/measures.py --trucks 100 --around file

Each drawn truck is a vehicle of the catalogue whose load is 1 to 2.2 times as high; with other factors more are near a
threshold.
A vehicle file with random errors describes it: those of `truck.uncertainty.changes`, of the priors of numbers on
which the file states nothing, of the half track and of the driveline. `assess` sees the file only. The table counts how
many true measures lie in the interval of 90 %, and how many trucks meet the thresholds of all levels, beside the mean
of the probability that they do. With `--around file` the file is exact, and the truth has the random errors.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from tests.results.assess.test_longitudinal import RATIO, N, balanced, simulated
from tests.results.assess.test_low_speed_turn import rolled
from tests.results.assess.trucks import CATALOGUE, with_engine

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.formatting import percent
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.estimate.observe.uncertainty import displaced
from fifthwheel.model.dynamics import linear_system
from fifthwheel.results.assess import assess, lane_change, longitudinal, low_speed_turn
from fifthwheel.results.assess.assessment import FAMILIES
from fifthwheel.results.assess.low_speed_turn import RADIUS
from fifthwheel.results.assess.propagation import Neighbourhood, complete, of_vehicle
from fifthwheel.results.assess.truck import Body, Truck, Values
from fifthwheel.truck import get


def subject(name: str) -> Truck:
    """A vehicle of the catalogue with engine, gears and overhangs."""
    truck = Truck(vehicle=with_engine(get(name)))
    between = {f"{truck.vehicle.units[i].name}.front_overhang": 1.5 for i in truck.semitrailers()}
    between |= dict.fromkeys(low_speed_turn.unstated(truck).get("tail_swing", ())[:-1], 0.0)
    return replace(truck, body=Body(rear_overhang=2.0, between=between))


def independent(truck: Truck) -> Values:
    """The new measures by other calculations; see the tests from which they come."""
    vehicle, first = truck.vehicle, truck.vehicle.units[0]
    weight, driven = sum(unit.mass for unit in vehicle.units) * GRAVITY, f"{first.name}.drive"
    corners = rolled(truck, 0.0, math.pi / 2, 80.0)
    front = corners[:, 0, 0]
    values = {"frontal_swing": front[0].real.max() - RADIUS, "tail_swing": -corners[-1, 1, 0].imag.min()}
    lead, pairs = 0, []
    for i in truck.semitrailers():
        y = front[i].imag[front[i].imag > 0]
        outside = front[i].real[front[i].imag > 0] - np.interp(y, front[lead].imag, front[lead].real)
        pairs.append((outside.max(), front[i].real.max() - front[lead].real.max()))
        lead = i
    if pairs:
        values["frontal_swing_difference"], values["frontal_swing_maxima"] = np.max(pairs, axis=0)
    whole = rolled(truck, truck.body.front_overhang, 2 * math.pi, 0.0)
    across = [np.linspace(0, 1, 11)[:, None] * (p[1] - p[0]) + p[0] for f, r in whole for p in along(f, r)]
    values["turning_circle"] = min(np.abs(points - 1j * RADIUS).min() for points in across)
    for name, torque in (("startability", "launch_torque"), ("gradeability", "engine_torque")):
        force, low, high = N[torque] * N["efficiency"] * N["lowest_gear"] * RATIO, 0.0, 1.0
        for _ in range(50):
            grade = (low + high) / 2
            angle = math.atan(grade)
            load = balanced(vehicle, grade, {driven: grade * weight})[driven]
            slips = 0.8 * load < (grade + N["rolling_resistance"]) * weight
            stalls = force < weight * (math.sin(angle) + N["rolling_resistance"] * math.cos(angle))
            low, high = (low, grade) if slips or stalls else (grade, high)
        values[name] = low
    cubic = [0.6 * N["drag_area"], 0.0, weight * (0.01 + N["rolling_resistance"]), -N["efficiency"] * N["engine_power"]]
    root = max(r.real for r in np.roots(cubic) if abs(r.imag) < 1e-9)
    values["grade_speed"] = min(root, N["governed_speed"] / (N["highest_gear"] * RATIO))
    values["acceleration_time"] = min(simulated(vehicle, start, skip) for start in range(4) for skip in (1, 2, 3))
    static = vehicle.axle_loads()
    braked = balanced(vehicle, -0.4, {path: -0.4 * load for path, load in static.items()})
    values["braking_efficiency"] = min(braked[path] / load for path, load in static.items())
    return values | {"rearward_amplification_set": amplification(truck)}


def along(front: np.ndarray, rear: np.ndarray) -> list[np.ndarray]:
    """Outer and inner points at places along a unit."""
    return [part * front + (1 - part) * rear for part in np.linspace(0, 1, 101)]


def amplification(truck: Truck) -> float:
    """By the response over time."""
    rear = truck.vehicle.units[-1:]
    for coupling, unit in zip(reversed(truck.vehicle.couplings), reversed(truck.vehicle.units[:-1]), strict=True):
        if not coupling.roll_stiffness:
            break
        rear = (unit, *rear)
    run = lane_change.linear(truck)
    system = linear_system(truck.vehicle, truck.speed, [f"cog_acceleration.{unit.name}" for unit in rear])
    response = system.response(run.time, {system.inputs[0]: run.steer})
    total, moments = 0.0, 0.0
    for unit in rear:
        moment = unit.sprung.mass * unit.sprung.cog_height
        if load := unit.payload:
            moment += load.mass * (load.floor_height + load.height / 2)
        total, moments = total + moment * response[f"cog_acceleration.{unit.name}"], moments + moment
    return float(np.abs(total).max() / moments / np.abs(run.acceleration["front"]).max())


def print_comparison() -> None:
    """The table of five vehicles: fifthwheel, and the independent calculation."""
    print("| measure | " + " | ".join(f"`{name}`" for name in CATALOGUE) + " |", "|---" * 6 + "|", sep="\n")
    trucks = [subject(name) for name in CATALOGUE]
    families = (
        low_speed_turn.measure,
        low_speed_turn.measure_circle,
        longitudinal.measure,
        longitudinal.measure_braking,
    )
    families = (*families, lane_change.measure)
    ours = [{k: v for family in families for k, v in family(truck).items()} for truck in trucks]
    theirs = [independent(truck) for truck in trucks]
    for name in theirs[0]:
        cells = [f"{a[name]:.4g}, {b[name]:.4g}" if name in a else "" for a, b in zip(ours, theirs, strict=True)]
        print(f"| {name} | " + " | ".join(cells) + " |")


def drawn(rng: np.random.Generator, name: str, higher: Sequence[float]) -> tuple[Truck, Truck]:
    """A true truck, whose payload is higher by a factor in a range, and the truck of a file with random errors."""
    truth = subject(name)
    truth = replace(truth, vehicle=longitudinal.completed(truth.vehicle))
    p, factor = truth.vehicle.parameters(), rng.uniform(*higher)
    truth = truth.changed({path: factor * p[path] for path in p if path.endswith("payload.height")})
    sigmas = longitudinal.sigmas(truth.vehicle)
    uncertainty = complete(of_vehicle(truth.vehicle), truth.body, replaced=tuple(sigmas), stated=sigmas)
    around, S = Neighbourhood(truth, uncertainty), uncertainty.columns()
    centre = np.array([around.given[path] for path in uncertainty.names])
    while True:
        values = displaced(uncertainty.names, centre, S @ rng.normal(size=S.shape[1]), around.positive)
        try:
            return truth, truth.changed(dict(zip(uncertainty.names, values.tolist(), strict=True)))
        except FifthwheelError:  # such as a CoG behind the axles
            continue


def measured(truck: Truck) -> Values:
    """All measures of a truck that it has."""
    values = Values()
    for family in FAMILIES:
        try:
            values |= family(truck)
        except FifthwheelError:  # an unstable truck
            continue
    return values


def print_coverage(count: int, higher: Sequence[float], around: str, *, cheap: bool) -> None:
    """The table of drawn trucks."""
    inside: dict[str, list[bool]] = {}
    met: dict[str, list[tuple[float, bool]]] = {}
    for seed in range(count):
        pair = drawn(np.random.default_rng(seed), CATALOGUE[seed % len(CATALOGUE)], higher)
        truth, file = pair if around == "truth" else reversed(pair)
        true = measured(truth)
        for result in assess(file.vehicle, body=file.body, nonlinear=False, cheap=cheap):
            if result.interval is None or result.name not in true:
                continue
            kind = result.name.partition(".")[0]
            inside.setdefault(kind, []).append(result.interval[0] <= true[result.name] <= result.interval[1])
            for threshold in result.thresholds:
                if threshold.probability is not None:
                    sign = 1 if threshold.sense == "at least" else -1
                    value = threshold.value
                    if kind == "rearward_amplification_set":
                        value = 5.7 * true["rollover_threshold_rear"]
                    meets = sign * (true[result.name] - value) >= 0
                    met.setdefault(kind, []).append((threshold.probability, meets))
    print(
        "| measure | intervals | cover | thresholds | doubtful | mean probability | met |", "|---" * 7 + "|", sep="\n"
    )
    for kind, hits in inside.items():
        row = [kind, str(len(hits)), percent(float(np.mean(hits)))]
        if kind in met:
            probabilities, meets = np.array(met[kind]).T
            doubtful = np.sum((probabilities > 0.02) & (probabilities < 0.98))
            row += [str(len(meets)), str(doubtful), percent(probabilities.mean()), percent(meets.mean())]
        print("| " + " | ".join(row + [""] * (7 - len(row))) + " |", flush=True)


def main() -> None:
    """Print one of the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trucks", type=int, help="number of drawn trucks for the table of coverage")
    parser.add_argument("--higher", type=float, nargs=2, default=(1.0, 2.2), help="factors on the payload height")
    parser.add_argument("--around", choices=("truth", "file"), default="truth", help="what has no random errors")
    parser.add_argument("--cheap", action="store_true", help="only the measures without a simulation")
    options = parser.parse_args()
    if options.trucks:
        print_coverage(options.trucks, options.higher, options.around, cheap=options.cheap)
    else:
        print_comparison()


if __name__ == "__main__":
    main()
