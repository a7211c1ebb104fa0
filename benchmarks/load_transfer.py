"""Load transfer ratio and the warning before a wheel lifts: observers on the nonlinear truck.

    python benchmarks/load_transfer.py

A single sine of the steer angle at 0.4 Hz, two of them (a double lane change), a step and a turn that tightens for 8 s,
each laden with a load of 1.2, 2.4 and 3.2 m height, empty, and empty with a high body; on a dry road and on snow. The
sensors are those of the article. Vehicle file and friction are otherwise exact: 0.74 times the factor of the tyres is
the peak friction of the tyre at its nominal load.

Errors are those of the load transfer ratio of an axle group from 1 s, when the manoeuvre begins, until the first wheel
lifts. The lead is the time from the warning to that instant; "false" is a warning without a lift, with the largest load
transfer ratio of an axle below 0.9.
"""

from collections.abc import Callable

import numpy as np

from fifthwheel.manoeuvres.courses import STANDARD_SPEED, OpenLoop
from fifthwheel.manoeuvres.open_loops import single_sine, single_track_steer, step_input
from fifthwheel.observe import Observer, ObserverSettings
from fifthwheel.plant import Plant, PlantRun, Properties, article_sensors, measure
from fifthwheel.record import Record
from fifthwheel.vehicle import Vehicle
from trust_runs import TRUCK, table

UNITS = ("tractor", "semitrailer")
GROUPS = ("tractor.front", "tractor.drive", "semitrailer")
SIGNALS = ("speed", "steer.tractor.front", *(f"{q}.{unit}" for q in ("yaw_rate", "roll_rate") for unit in UNITS))
PEAK = 0.74
BEGIN = 1.0
"""s."""
LIFTED = 0.995
"""Load transfer ratio of an axle with a wheel off the ground."""


def empty(cog_height: float = 1.2) -> Vehicle:
    """The truck without payload; its tyres are softer at their small load."""
    fields = TRUCK.model_dump()
    trailer = fields["units"][1]
    trailer |= {"payload": None, "mass": 13.328e3, "cog": -5.63, "yaw_inertia": 200e3}
    trailer["sprung"]["cog_height"] = cog_height
    trailer["axle_groups"][0]["cornering_stiffness"] = 750e3
    fields["units"][0]["axle_groups"][1]["cornering_stiffness"] = 560e3
    return Vehicle(**fields)


VEHICLES = {
    "load of 1.2 m": TRUCK,
    "load of 2.4 m": TRUCK.replace({"semitrailer.payload.height": 2.4}),
    "load of 3.2 m": TRUCK.replace({"semitrailer.payload.height": 3.2}),
    "empty": empty(),
    "empty, high body": empty(2.2),
}


def double_lane_change(vehicle: Vehicle, *, acceleration: float) -> OpenLoop:
    """A single sine to each side."""
    sine = single_sine(vehicle, acceleration=acceleration, duration=12.0)
    later = single_sine(vehicle, acceleration=acceleration, lead=4.5, duration=12.0)
    return OpenLoop(time=sine.time, steer=sine.steer - later.steer, speed=sine.speed, name="double lane change")


def tightening_turn(vehicle: Vehicle, *, acceleration: float) -> OpenLoop:
    """A steer angle that rises for 8 s."""
    time = np.arange(1001) * 0.01
    steer = single_track_steer(vehicle, STANDARD_SPEED, acceleration) * np.clip((time - BEGIN) / 8, 0, 1)
    return OpenLoop(time=time, steer=steer, speed=np.full_like(time, STANDARD_SPEED), name="turn")


COURSES: dict[str, tuple[Callable[..., OpenLoop], tuple[float, ...], tuple[float, ...]]] = {
    "sine": (single_sine, (2.0, 3.0, 3.5, 4.0), (1.0, 2.0)),
    "double lane change": (double_lane_change, (2.5, 3.5), (2.0,)),
    "step": (step_input, (4.0, 5.0), ()),
    "turn": (tightening_turn, (4.0, 5.0, 6.0), (3.0,)),
}
"""Of each course its lateral accelerations on a dry road and on snow, m/s^2."""


def truth_of(run: PlantRun) -> dict[str, np.ndarray]:
    """Load transfer ratio (N,) of each axle group."""
    ratios = {}
    for unit in run.vehicle.units:
        for group in unit.axle_groups:
            axles = [f"{unit.name}.{axle.name}" for axle in group.axles]
            loads = np.array([run.truth[f"vertical_force.{axle}"] for axle in axles])
            own = np.array([run.truth[f"load_transfer.{axle}"] for axle in axles])
            ratios[unit.group_path(group)] = (loads * own).sum(axis=0) / loads.sum(axis=0)
    return ratios


def measured(run: PlantRun, friction: float | None) -> list[str]:
    """Largest error and rms of each axle group, and the lead of the warning; with a mark where it is inconsistent."""
    sensors = {name: sensor for name, sensor in article_sensors(TRUCK).items() if name in SIGNALS}
    signals = measure(run.time, {name: run.truth[name] for name in SIGNALS}, sensors, seed=1)
    settings = ObserverSettings(bank=0.0, steer_offset=0.0, friction=friction)
    states = Observer(run.vehicle, SIGNALS, settings).batch(Record(time=run.time, signals=signals, name="run"))
    largest = np.max([np.abs(v) for n, v in run.truth.items() if n.startswith("load_transfer.")], axis=0)
    lift = int((largest > LIFTED).argmax()) if largest.max() > LIFTED else len(run.time)
    part = slice(int((run.time >= BEGIN).argmax()), lift)
    cells = []
    for path, truth in truth_of(run).items():
        error = (states.values[f"load_transfer.{path}"] - truth)[part]
        cells.append(f"{np.abs(error).max():.3f}, {np.sqrt(np.mean(error**2)):.3f}")
    warned = states.lift_warning & (run.time >= BEGIN)
    lead = ""
    if lift < len(run.time):
        lead = f"{run.time[lift] - run.time[warned.argmax()]:.2f} s" if warned.any() else "missed"
    elif warned.any():
        lead = "false" if largest.max() < 0.9 else "no lift"
    return [*cells, lead + (" *" if (states.status[part] != 0).any() else "")]


def main() -> None:
    """Print the tables."""
    for title, linear in (("saturating tyres", False), ("linear tyres", True)):
        rows = []
        for name, vehicle in VEHICLES.items():
            for factor, column in ((1.0, 1), (0.35, 2)):
                plant = Plant(vehicle, Properties(friction=factor))
                for course, entry in COURSES.items():
                    for acceleration in entry[column]:
                        run = plant.drive(entry[0](vehicle, acceleration=acceleration), until_rollover=True)
                        largest = [np.abs(v).max() for n, v in run.truth.items() if n.startswith("load_transfer.")]
                        labels = name, f"{course}, {acceleration:g}, {PEAK * factor:.2g}", f"{max(largest):.2f}"
                        rows.append([*labels, *measured(run, None if linear else PEAK * factor)])
        heads = ("truck", "course, m/s², friction", "largest", *(f"{group}: max, rms" for group in GROUPS), "lead")
        print(f"\n{title}\n\n" + "\n".join(table(heads, rows)), flush=True)
    print("* INCONSISTENT for a part of the run")


if __name__ == "__main__":
    main()
