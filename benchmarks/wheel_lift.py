"""Record of the warning before a wheel lifts: drawn trucks, manoeuvres and sensors on the nonlinear truck.

    python benchmarks/wheel_lift.py --first 10000 --lifts 500 --distance 1000 --out wheel_lift_record.md

Each seed draws a laden truck whose first wheel lifts at 0.15 to 0.5 g in a steady turn, a speed of 60 to 90 km/h, a
manoeuvre with 0.7 to 1.6 times that acceleration, the friction of a dry road, its bank, and the errors of all sensors.
Seeds are drawn until the wheels of one side of an axle have lifted in the stated number of manoeuvres; trucks that
cannot be built, or that jackknife, are drawn again.

The observer has the truck as a user has it: the numbers of an identification or of a file, with the errors of
`user_errors`, friction and half track with errors too, and the default settings otherwise. "Exact" is the same warning
with the true numbers and exact sensors. The lead is the time from the first warning to the first instant at which an
axle has a load transfer ratio of 0.995.

The distance is everyday driving of drawn trucks (payload at 0.8 to 2.2 m) with the same errors. A warning is false if
no axle reaches a load transfer ratio of 0.8 in the 3 s after it.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from classes import COMBINATIONS, Draw, drawn_truck
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import Observer, ObserverSettings, States
from fifthwheel.model.manoeuvres import Course
from fifthwheel.model.manoeuvres.courses import OpenLoop, everyday
from fifthwheel.model.manoeuvres.open_loops import INTERVAL, sine_with_dwell, single_sine, single_track_steer
from fifthwheel.model.plant import Plant, PlantRun, Properties, Sensor, measure
from fifthwheel.results.assess.rollover import rollover
from fifthwheel.results.assess.truck import Truck
from fifthwheel.truck import Vehicle
from trust_runs import table

KINDS = ("step", "lane change", "double lane change", "tightening turn", "sine with dwell")
LEAD = 3.0
"""Straight ahead before a manoeuvre, s."""
LIFTED = 0.995
"""Load transfer ratio of an axle with the wheels of one side off the ground."""
WANTED = 0.5
"""Lead of the warning, s."""
MARGIN, FOLLOWING = 0.8, 3.0
"""Of a warning that is not false: load transfer ratio of an axle, and time, s, within which it is reached."""
PEAK = 0.74
"""Friction of the tyres at large slip, of a factor of 1."""
DEGREE = np.pi / 180
RELATIVE_ERRORS = {
    "cornering_stiffness": 0.06,
    "roll_stiffness": 0.08,
    "tyre_roll_stiffness": 0.08,
    "roll_damping": 0.25,
    "yaw_inertia": 0.05,
    "relaxation_length": 0.2,
}
"""Standard deviations of the user's numbers, of each axle group and unit."""


def drawn(draw: Draw, number: int, lifts: tuple[float, float], heights: tuple[float, float] | None = None) -> Vehicle:
    """A truck whose first wheel lifts at such a lateral acceleration, g; by default with the payload as `classes.py`
    draws it."""
    while True:
        truck = drawn_truck(draw, *COMBINATIONS[number % len(COMBINATIONS)])
        if heights:
            truck = truck.replace({"semitrailer.payload.height": draw.within(heights)})
        try:
            if lifts[0] < first_lift(truck) < lifts[1]:
                return truck
        except FifthwheelError:  # it does not stand upright
            continue


def first_lift(truck: Vehicle) -> float:
    """Lateral acceleration of a steady turn at which the first wheel lifts, g."""
    return min(lift for each in rollover(Truck(vehicle=truck)) for lift in each.lifts.values())


def drawn_course(draw: Draw, truck: Vehicle, kind: str) -> OpenLoop:
    """A manoeuvre about as hard as the truck tolerates."""
    speed, limit = draw.within((60, 90)) / 3.6, STANDARD_GRAVITY * first_lift(truck)
    if kind in ("step", "tightening turn"):
        rise, hardest = ((0.1, 0.5), (0.7, 1.5)) if kind == "step" else ((2.0, 8.0), (0.9, 1.5))
        time = np.arange(round(16 / INTERVAL) + 1) * INTERVAL
        steer = single_track_steer(truck, speed, limit * draw.within(hardest))
        steer = steer * np.clip((time - LEAD) / draw.within(rise), 0, 1)
        return OpenLoop(time=time, steer=steer, speed=np.full_like(time, speed), name=kind)
    given = {"speed": speed, "acceleration": limit * draw.within((0.7, 1.6)), "lead": LEAD, "duration": 16.0}
    if kind == "sine with dwell":
        dwell = draw.within((0.5, 1.5))
        return sine_with_dwell(truck, frequency=draw.within((0.25, 0.6)), dwell=dwell, **given)
    frequency = draw.within((0.2, 0.5))
    sine = single_sine(truck, frequency=frequency, **given)
    if kind == "lane change":
        return sine
    given["lead"] += 1 / frequency + draw.within((0.0, 1.5))
    back = single_sine(truck, frequency=frequency, **given)
    return OpenLoop(time=sine.time, steer=sine.steer - back.steer, speed=sine.speed, name=kind)


def user_errors(draw: Draw, truck: Vehicle) -> Vehicle:
    """The truck as its user has it."""
    normal, numbers = draw.rng.normal, truck.parameters()
    changes = {}
    for path, value in numbers.items():
        kind = path.rpartition(".")[2]
        if kind in RELATIVE_ERRORS and value:
            changes[path] = value * float(np.exp(RELATIVE_ERRORS[kind] * normal()))
        elif kind == "roll_axis_height":
            changes[path] = value + 0.04 * normal()
    changes["semitrailer.payload.height"] = numbers["semitrailer.payload.height"] + 0.08 * normal()
    heavier = 1 + 0.015 * normal()
    return truck.replace(changes | {n: heavier * numbers[n] for n in ("semitrailer.mass", "semitrailer.payload.mass")})


def drawn_sensors(draw: Draw, truck: Vehicle) -> dict[str, Sensor]:
    """Gyros as those of the class `mems` after correction of their offset, steer angle and speed of a bus."""
    normal = draw.rng.normal
    steer = {"scale": 1 + 0.01 * normal(), "bias": 0.002 * normal(), "quantisation": 1 / 1024 / 20, "latency": 0.01}
    sensors = {
        "speed": Sensor(variance=0.01**2, quantisation=1 / 256 / 3.6, rate=10.0),
        truck.steer_signals()[0]: Sensor(**steer),
    }
    for quantity, noise in (("yaw_rate", 0.15), ("roll_rate", 0.5)):
        for unit in truck.units:
            errors = {"scale": 1 + 0.0075 * normal(), "bias": 0.001 * normal(), "misalignment": 0.5 * DEGREE * normal()}
            sensors[f"{quantity}.{unit.name}"] = Sensor(variance=(noise * DEGREE) ** 2, latency=0.01, **errors)
    return sensors


def estimated(draw: Draw, run: PlantRun, *, exact: bool = False) -> States:
    """States of the observer of the user, or with the true numbers and exact sensors."""
    sensors = drawn_sensors(draw, run.vehicle)
    noise = {name: sensor.variance for name, sensor in sensors.items() if "rate" in name}
    friction, track = PEAK * run.properties.friction, run.properties.half_track
    user = user_errors(draw, run.vehicle)
    errors = np.exp(0.08 * draw.rng.normal()), 1 + 0.02 * draw.rng.normal()
    if exact:
        user, sensors, errors = run.vehicle, {name: Sensor() for name in sensors}, (1.0, 1.0)
    settings = ObserverSettings(friction=friction * errors[0], half_track=track * errors[1], noise=noise)
    signals = measure(run.time, run.truth, sensors, seed=draw.rng.integers(1 << 30).item())
    return Observer(user, signals, settings).batch(Record(time=run.time, signals=signals, name=run.name))


def largest_ratio(run: PlantRun) -> Array:
    """Largest load transfer ratio of an axle (N,)."""
    ratios = [np.abs(values) for name, values in run.truth.items() if name.startswith("load_transfer.")]
    return np.max(ratios, axis=0)


def errors_of(states: States, run: PlantRun, end: int) -> Array:
    """Largest and rms error of the load transfer ratio of an axle group from the manoeuvre to sample `end`."""
    part, found = slice(int(LEAD / (run.time[1] - run.time[0])), end), []
    for unit in run.vehicle.units:
        for group in unit.axle_groups:
            axles = [f"{unit.name}.{axle.name}" for axle in group.axles]
            loads = np.array([run.truth[f"vertical_force.{axle}"] for axle in axles])
            moved = (loads * np.array([run.truth[f"load_transfer.{axle}"] for axle in axles])).sum(axis=0)
            found.append((states.values[f"load_transfer.{unit.group_path(group)}"] - moved / loads.sum(axis=0))[part])
    return np.array([np.abs(found).max(), np.sqrt(np.mean(np.square(found)))])


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """One manoeuvre."""

    kind: str
    largest: float  # load transfer ratio of an axle
    lead: float | None  # of the warning, s; negative infinity without one; None where no wheel lifts
    exact_lead: float | None  # with the true numbers and exact sensors
    warned: bool
    errors: Array  # largest and rms error of the load transfer ratio of an axle group


def outcome(seed: int) -> Outcome | None:
    """The manoeuvre of a seed; None where the truck cannot be built, or jackknifes."""
    draw, kind = Draw(seed), KINDS[seed // len(COMBINATIONS) % len(KINDS)]
    try:
        truck = drawn(draw, seed, (0.15, 0.5), (1.4, 3.0))
        properties = Properties(friction=draw.within((0.85, 1.15)), bank=0.015 * draw.rng.normal())
        run = Plant(truck, properties).drive(drawn_course(draw, truck, kind), until_rollover=True)
    except ValueError:
        return None
    ratio = largest_ratio(run)
    lifts = bool(ratio.max() > LIFTED)
    end = int((ratio > LIFTED).argmax()) if lifts else len(ratio)
    user, exact = (estimated(draw, run, exact=exact) for exact in (False, True))

    def lead(states: States) -> float:
        warned = states.lift_warning & (run.time >= LEAD - 0.5)
        return float(run.time[end] - run.time[warned.argmax()]) if warned[: end + 1].any() else -np.inf

    return Outcome(
        kind=kind,
        largest=float(ratio.max()),
        lead=lead(user) if lifts else None,
        exact_lead=lead(exact) if lifts else None,
        warned=bool(user.lift_warning.any()),
        errors=errors_of(user, run, end),
    )


def outcomes(first: int, lifts: int) -> Iterator[Outcome]:
    """Manoeuvres until a wheel has lifted in `lifts` of them."""
    seed = first
    while lifts > 0:
        found = outcome(seed)
        seed += 1
        if found is not None:
            lifts -= found.lead is not None
            yield found


def everyday_course(draw: Draw, seed: int) -> Course:
    """Ten minutes, about 10 km."""
    return everyday(duration=600.0, seed=seed, speed=draw.within((22.0, 25.0)))


def everyday_run(seed: int) -> tuple[float, int, int, float]:
    """Distance, km; warnings; false ones; largest load transfer ratio of an axle."""
    draw = Draw(seed)
    truck = drawn(draw, seed, (0.3, 2.0))
    properties = Properties(friction=draw.within((0.85, 1.15)), bank=0.015 * draw.rng.normal())
    run = Plant(truck, properties).drive(everyday_course(draw, seed), rate=50.0)
    return warnings_of(draw, run)


def warnings_of(draw: Draw, run: PlantRun) -> tuple[float, int, int, float]:
    """Distance, km; warnings; false ones; largest load transfer ratio of an axle."""
    ratio, warned = largest_ratio(run), estimated(draw, run).lift_warning
    begins = np.flatnonzero(warned & ~np.append(False, warned[:-1]))
    after = round(FOLLOWING * 50)
    false = sum(ratio[k : k + after].max() < MARGIN for k in begins)
    return float(run.truth["speed"].mean() * run.time[-1] / 1000), len(begins), int(false), float(ratio.max())


def lift_table(found: list[Outcome]) -> list[str]:
    """Of each manoeuvre the leads, with the user's numbers and with exact ones."""
    rows = []
    for kind in (*KINDS, "all"):
        of_kind = [o for o in found if kind in (o.kind, "all") and o.lead is not None and o.exact_lead is not None]
        if not of_kind:
            continue
        cells = []
        for leads in (np.array([o.lead for o in of_kind]), np.array([o.exact_lead for o in of_kind])):
            low, middle = np.quantile(leads, (0.05, 0.5), method="lower")
            met = 100 * np.mean(leads >= WANTED - 1e-9)
            cells += [f"{met:.1f} %", f"{low:.2f}, {middle:.2f} s", f"{leads.min():.2f} s", int((leads < 0).sum())]
        largest, rms = np.quantile([o.errors for o in of_kind], 0.95, axis=0)
        rows.append([kind, len(of_kind), *cells[:4], *cells[4:6], f"{largest:.2f}, {rms:.2f}"])
    heads = ("manoeuvre", "lifts", "lead of 0.5 s or more", "5 %, median", "shortest", "missed")
    exact = ("exact: 0.5 s or more", "exact: 5 %, median", "95 % of the errors of the ratio: largest, rms")
    return table((*heads, *exact), rows)


def near_table(found: list[Outcome]) -> list[str]:
    """Of manoeuvres without a lift how many are warned of, by the largest load transfer ratio of an axle."""
    edges, rows = (0.0, 0.6, 0.7, 0.8, 0.9, LIFTED), []
    for low, high in pairwise(edges):
        warned = [o.warned for o in found if o.lead is None and low <= o.largest < high]
        rows.append([f"{low:g} to {high:g}", len(warned), sum(warned)])
    return table(("largest ratio of an axle", "manoeuvres without a lift", "warnings"), rows)


def main() -> None:
    """Print the tables, or write them to a file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=10_000, help="first seed")
    parser.add_argument("--lifts", type=int, default=500, help="manoeuvres in which a wheel lifts")
    parser.add_argument("--distance", type=float, default=1000.0, help="of everyday driving, km")
    parser.add_argument("--out", type=Path, help="file for the tables; default: the terminal")
    options = parser.parse_args()
    found: list[Outcome] = []
    for each in outcomes(options.first, options.lifts):
        found.append(each)
        print(each, file=sys.stderr, flush=True)
    lines = [*lift_table(found), "", *near_table(found), ""] if found else []
    distance, warnings, false, seed, largest = 0.0, 0, 0, options.first, 0.0
    while distance < options.distance:
        try:
            result = everyday_run(seed)
        except ValueError as error:  # it cannot be built
            print(error, file=sys.stderr)
        else:
            print(seed, *result, file=sys.stderr, flush=True)
            distance, warnings, false = distance + result[0], warnings + result[1], false + result[2]
            largest = max(largest, result[3])
        seed += 1
    lines.append(
        f"{distance:.0f} km of everyday driving, largest load transfer ratio of an axle {largest:.2f}: {warnings} "
        f"warnings, {false} of them false."
    )
    text = "\n".join(lines) + "\n"
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
