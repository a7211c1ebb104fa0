"""Sideslip near the limits of adhesion: observers with linear and with saturating tyres on the nonlinear truck.

    python benchmarks/limits.py [--only states braking laws]

A single sine of the steer angle at 0.4 Hz, from 0.1 to 0.6 g of the front axle, on a dry road and on snow, with the
sensors of the article. The observer with saturating tyres has the friction 0.74 times the factor of the tyres, which is
the peak of the tyre 315/80 R 22.5 in PAC2002, and for comparison a friction that is 20 % wrong. Vehicle file and
sensors are otherwise exact.

The second table is that of the same manoeuvre while braking, of the laden truck and of an empty one, with a noise of
the speed of 0.1 m/s at 100 Hz: linear tyres, and saturating tyres without and with braking in the model.

The third table has the laws side by side, over the fraction of the friction that the axle uses which uses most: largest
side force over the load at that instant and the peak friction. The sideslip is that of the observer, as above; the
stiffnesses are those of an identification without noise, in which all but them, the yaw inertia, the payload height and
the friction is exact.
"""

import argparse

import casadi as ca
import numpy as np

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.estimate.stream import Status
from fifthwheel.model.manoeuvres import braked
from fifthwheel.model.manoeuvres.open_loops import single_sine
from fifthwheel.model.plant import Plant, PlantRun, Properties, Sensor, article_sensors, measure
from fifthwheel.truck import get
from trust_runs import TRUCK, table

UNITS = ("tractor", "semitrailer")
SIGNALS = ("speed", "steer.tractor.front", *(f"{q}.{unit}" for q in ("yaw_rate", "roll_rate") for unit in UNITS))
PEAK = 0.74
"""Peak friction of the tyre at its nominal load."""
OBSERVERS = {"linear": None, "saturating": 1.0, "friction 20 % low": 0.8, "friction 20 % high": 1.2}
"""Factor of the friction of each observer; None: linear tyres."""


EMPTY = get("auburn_6x4_unladen")
NOISY_SPEED = {"speed": Sensor(variance=0.1**2)}
BRAKING = (
    (TRUCK, 1.0, (0.5, 1.0, 2.0, 3.0), (0.0, 1.0, 2.0, 3.0)),
    (EMPTY, 1.0, (1.0, 2.0, 3.0, 4.0), (0.0, 1.0, 2.0, 3.0)),
    (TRUCK, 0.35, (0.5, 1.0, 1.5), (0.0, 0.5, 1.0, 1.5)),
    (EMPTY, 0.35, (0.5, 1.0, 1.5), (0.0, 0.5, 1.0, 1.5)),
)
"""Truck, factor of the tyres' friction, accelerations of the front axle and decelerations, m/s^2."""


FRACTIONS = {1.0: (0.2, 0.35, 0.5, 0.65, 0.8), 0.35: (0.35, 0.65, 0.8, 0.95)}
"""Of the friction, by the factor of the tyres' friction; the dry road has no manoeuvre with 0.95."""
GROUPS = ("tractor.front", "tractor.drive", "semitrailer")


def brush(slip: ca.SX, load: ca.SX, stiffness: ca.SX, friction: ca.SX) -> ca.SX:
    """Fiala's law, as a user's own."""
    s = ca.fmin(ca.fmax(stiffness * slip / (friction * load), -3), 3)
    return friction * load * s * (1 - ca.fabs(s) / 3 + s * s / 27)


LAWS = {"linear": "linear", "saturating": "saturating", "own law, brush": brush}


def errors(run: PlantRun, settings: ObserverSettings, other: dict[str, Sensor] | None = None) -> str:
    """Rms error of the sideslip of both units, deg; with a mark where the observer is inconsistent."""
    sensors = {name: sensor for name, sensor in article_sensors(run.vehicle).items() if name in SIGNALS} | (other or {})
    signals = measure(run.time, {name: run.truth[name] for name in SIGNALS}, sensors, seed=1)
    states = Observer(run.vehicle, SIGNALS, settings).batch(Record(time=run.time, signals=signals, name="sine"))
    rms = [np.sqrt(np.mean((states.values[f"sideslip.{u}"] - run.truth[f"sideslip.{u}"]) ** 2)) for u in UNITS]
    mark = " *" if (states.status == Status.INCONSISTENT).any() else ""
    return ", ".join(f"{np.degrees(x):.2f}" for x in rms) + mark


def largest(run: PlantRun) -> list[str]:
    """Largest u r over g, and largest sideslip of both units, deg."""
    acceleration = max(np.abs(run.truth["speed"] * run.truth[f"yaw_rate.{u}"]).max() for u in UNITS) / 9.81
    angles = (np.degrees(np.abs(run.truth[f"sideslip.{u}"]).max()) for u in UNITS)
    return [f"{acceleration:.2f}", ", ".join(f"{angle:.1f}" for angle in angles)]


def used(run: PlantRun, peak: float) -> float:
    """Largest fraction of the friction that an axle uses."""
    forces = [name for name in run.truth if name.startswith("lateral_force.")]
    loads = [run.truth[name.replace("lateral", "vertical")] for name in forces]
    return max(float(np.abs(run.truth[f] / N).max()) for f, N in zip(forces, loads, strict=True)) / peak


def laws() -> None:
    """Print the table of the laws over the fraction of the friction."""
    truth, exact, rows = TRUCK.parameters(), {"bank": 0.0, "steer_offset": 0.0}, []
    for friction, fractions in FRACTIONS.items():
        plant, accelerations = Plant(TRUCK, Properties(friction=friction)), np.arange(0.5, 5.1, 0.5) * friction**0.8
        reached = [used(plant.drive(single_sine(TRUCK, acceleration=a)), PEAK * friction) for a in accelerations]
        for fraction in fractions:
            acceleration = float(np.interp(fraction, reached, accelerations))
            run = plant.drive(single_sine(TRUCK, acceleration=acceleration))
            record = Record(time=run.time, signals={name: run.truth[name] for name in SIGNALS}, name="sine")
            cells = []
            for law in LAWS.values():
                settings = exact | ({} if law == "linear" else {"tyres": law, "friction": PEAK * friction})
                found = identify([record], TRUCK, OneStage(given={"others": "exact", "sensors": "exact"}, tyres=law))
                values = {e.name: e.value for e in found.parameters}
                stiffness = [values[n] / truth[n] - 1 for n in (f"{path}.cornering_stiffness" for path in GROUPS)]
                cells += [errors(run, ObserverSettings(**settings)), ", ".join(f"{100 * x:+.1f}" for x in stiffness)]
            title = f"{PEAK * friction:.2g}, {used(run, PEAK * friction):.2f}"
            rows.append([title, *largest(run), *cells])
            print(rows[-1], flush=True)
    heads = [f"{name}: {quantity}" for name in LAWS for quantity in ("sideslip, deg", "stiffnesses, %")]
    print("\n".join(table(("friction, used", "largest u r / g", "largest sideslip, deg", *heads), rows)))


def braking() -> None:
    """Print the table of braking in the manoeuvre; the truck brakes 1 s before it steers."""
    rows = []
    for truck, friction, accelerations, decelerations in BRAKING:
        exact = {"bank": 0.0, "steer_offset": 0.0}
        saturating = exact | {"friction": PEAK * friction}
        observers = exact, saturating | {"speed_smoothing": np.inf}, saturating
        for acceleration in accelerations:
            for deceleration in decelerations:
                course = single_sine(truck, acceleration=acceleration, lead=2.0, duration=8.0, speed=22.0)
                if deceleration:
                    course = braked(course, deceleration)
                run = Plant(truck, Properties(friction=friction)).drive(course)
                cells = [errors(run, ObserverSettings(**settings), NOISY_SPEED) for settings in observers]
                mass = sum(unit.mass for unit in truck.units) / 1e3
                title = f"{mass:.0f} t, {PEAK * friction:.2g}, {acceleration:g}, {deceleration:g}"
                rows.append([title, *largest(run), *cells])
    heads = ("mass, friction, m/s² lateral, braking", "largest u r / g", "largest sideslip, deg")
    print("\n".join(table((*heads, "linear, deg", "saturating, deg", "with braking, deg"), rows)))


def states() -> None:
    """Print the table of the states."""
    rows = []
    for friction, accelerations in ((1.0, (1.0, 2.0, 3.0, 3.5, 4.0)), (0.35, (0.5, 1.0, 1.5, 2.0))):
        for acceleration in accelerations:
            title = f"{PEAK * friction:.2g}, {acceleration:g}"
            try:
                run = Plant(TRUCK, Properties(friction=friction)).drive(single_sine(TRUCK, acceleration=acceleration))
            except FifthwheelError as error:
                rows.append([title, str(error)])
                continue
            exact = ObserverSettings(bank=0.0, steer_offset=0.0)
            cells = [
                errors(
                    run,
                    exact
                    if factor is None
                    else ObserverSettings(bank=0.0, steer_offset=0.0, friction=PEAK * friction * factor),
                )
                for factor in OBSERVERS.values()
            ]
            rows.append([title, *largest(run), *cells])
            print(rows[-1], flush=True)
    heads = ("friction, m/s²", "largest u r / g", "largest sideslip, deg", *(f"{name}, deg" for name in OBSERVERS))
    print("\n".join(table(heads, rows)))


def main() -> None:
    """Print the tables."""
    tables = {"states": states, "braking": braking, "laws": laws}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=tables, default=list(tables))
    for name in parser.parse_args().only:
        tables[name]()
    print("* INCONSISTENT for a part of the run")


if __name__ == "__main__":
    main()
