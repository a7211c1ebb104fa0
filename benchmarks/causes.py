"""Whether the first message on a faulty log names the fault, and whether a clean log has none; writes causes.md.

    python benchmarks/causes.py [--seed 1] [--clean 20] [--jobs 1] [--only NAME ...]

Two lane changes, at 60 and 80 km/h, of the nonlinear truck with errors of all numbers of the vehicle file and of all
sensors, drawn from what is stated of them (`sharpness.CAREFUL`). Each fault is added to both logs or to the vehicle
file. The first message is the first line of a refusal, else the first caution of the report. A fault is named if the
message has one of its words, and a clean log is clean if the report has no caution.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.apps.workflow.runs import run_identification
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import OneStage
from fifthwheel.model.manoeuvres import lane_changes
from fifthwheel.model.plant import Plant, Properties
from fifthwheel.truck import Vehicle
from sharpness import CAREFUL, careful_truck
from trust_corruptions import DEGREE, ROLL, ROLL2, SPEED, STEER, YAW, YAW2, gained, late, on
from trust_coverage import drawn_file, log_errors, measured_record, shared_errors
from trust_runs import TRUCK, table

SPEEDS = (60.0, 80.0)
"""km/h"""


@dataclass(frozen=True, kw_only=True)
class Fault:
    """One fault, and the words of a message that names it."""

    name: str
    words: tuple[str, ...]
    record: Callable[[Record], Record] = lambda record: record
    vehicle: Callable[[Vehicle], Vehicle] = lambda vehicle: vehicle


def exchanged(one: str, other: str, record: Record) -> Record:
    return record.with_signals({one: record.signals[other], other: record.signals[one]})


def mixed(signal: str, other: str, angle: float, record: Record) -> Record:
    """A gyro that is turned by an angle, rad, towards another axis."""
    signals = record.signals
    return record.with_signals({signal: np.cos(angle) * signals[signal] + np.sin(angle) * signals[other]})


def frozen(signal: str, record: Record) -> Record:
    values = record.signals[signal].copy()
    first = int(np.argmax(np.abs(values) > np.abs(values).max() / 2))
    values[first:] = values[first]
    return record.with_signals({signal: values})


def scaled(factors: Mapping[str, float], vehicle: Vehicle) -> Vehicle:
    values = vehicle.parameters()
    return vehicle.replace({path: factor * values[path] for path, factor in factors.items()})


def moved(paths: Sequence[str], distance: float, vehicle: Vehicle) -> Vehicle:
    values = vehicle.parameters()
    return vehicle.replace({path: values[path] + distance for path in paths})


def copied(source: str, target: str, record: Record) -> Record:
    return record.with_signals({target: record.signals[source]})


def drifting(signals: Sequence[str], rate: float, record: Record) -> Record:
    """Signals of a logger whose clock is slow by a fraction."""
    time = record.time
    return record.with_signals({name: np.interp(time * (1 + rate), time, record.signals[name]) for name in signals})


def lighter(mass: float, vehicle: Vehicle) -> Vehicle:
    """The vehicle with less payload, kg."""
    values = vehicle.parameters()
    return vehicle.replace({name: values[name] - mass for name in ("semitrailer.mass", "semitrailer.payload.mass")})


def file(name: str, words: str, change: Callable[[Vehicle], Vehicle]) -> Fault:
    return Fault(name=name, words=tuple(words.split("|")), vehicle=change)


def log(name: str, words: str, change: Callable[[Record], Record]) -> Fault:
    return Fault(name=name, words=tuple(words.split("|")), record=change)


DRIVE, FIFTH_WHEEL = "tractor.drive.position", "fifth_wheel.leading_position"
SOFT = {"semitrailer.cornering_stiffness": 0.25}
AXLES = ["semitrailer.front.position", "semitrailer.middle.position", "semitrailer.rear.position"]
FAULTS = (
    log("trailer logger 0.32 s late", "late", on((YAW2, ROLL2), late(0.32))),
    log("steer angle 0.25 s late", f"{STEER} is|{STEER}: 0", on(STEER, late(0.25))),
    log("trailer yaw rate 0.1 s late", f"{YAW2} is", on(YAW2, late(0.1))),
    log("steer angle positive right", f"{STEER}: the sign", on(STEER, gained(-1))),
    log("trailer yaw rate positive right", f"{YAW2}: the sign", on(YAW2, gained(-1))),
    log("trailer roll rate positive left", f"{ROLL2}: the sign", on(ROLL2, gained(-1))),
    log("steering wheel angle", "steering-wheel angle", on(STEER, gained(18.5))),
    log("steering ratio 40 % too small", f"times {STEER}", on(STEER, gained(1.4))),
    log("steering ratio 2.2 times", f"times {STEER}", on(STEER, gained(1 / 2.2))),
    log("steer offset 2 deg", f"{STEER} has an offset", on(STEER, gained(1, 2 * DEGREE))),
    log("yaw rates in degrees", "degrees", on((YAW, YAW2), gained(1 / DEGREE))),
    log("trailer yaw rate in degrees", f"{YAW2}: |degrees", on(YAW2, gained(1 / DEGREE))),
    log("gain of the trailer's yaw rate 40 % off", f"{YAW2} is", on(YAW2, gained(1.4))),
    log("offset of the trailer's yaw rate 2 deg/s", f"{YAW2} has an offset", on(YAW2, gained(1, 2 * DEGREE))),
    log("yaw rates exchanged", "exchange|swap", partial(exchanged, YAW, YAW2)),
    log("roll rates exchanged", "exchange|swap", partial(exchanged, ROLL, ROLL2)),
    log("yaw and roll rate of the trailer exchanged", f"{YAW2} in|{ROLL2} in", partial(exchanged, YAW2, ROLL2)),
    log("trailer roll gyro turned by 24 deg", f"gyro of {ROLL2}", partial(mixed, ROLL2, YAW2, 24 * DEGREE)),
    log("trailer yaw rate freezes in the lane change", "constant", partial(frozen, YAW2)),
    log("trailer yaw rate has the tractor's samples", "the same samples", partial(copied, YAW, YAW2)),
    log("clock of the trailer's logger 4 % slow", "clock|early", partial(drifting, (YAW2, ROLL2), 0.04)),
    log("speed in km/h", "km/h", on(SPEED, gained(3.6))),
    file("payload 8 t too small", "mass", partial(lighter, 8000.0)),
    file("trailer axles 1 m too far to the rear", "axles of the trailer", partial(moved, AXLES, -1.0)),
    file("drive axle 0.5 m too far to the rear", "drive.position|axles of the tractor", partial(moved, [DRIVE], -0.5)),
    file("fifth wheel 0.6 m too far to the front", "fifth_wheel", partial(moved, [FIFTH_WHEEL], 0.6)),
    file("tractor yaw inertia 60 % too small", "tractor.yaw_inertia", partial(scaled, {"tractor.yaw_inertia": 0.4})),
    file("trailer CoG 1 m too far to the front", "semitrailer.cog", partial(moved, ["semitrailer.cog"], 1.0)),
    file("tyres of the trailer four times too soft", "unstable|cornering_stiffness", partial(scaled, SOFT)),
)


def logs_and_file(seed: int) -> tuple[list[Record], Vehicle]:
    """Two logs, and a vehicle file with errors."""
    rng, settings = np.random.default_rng([seed, 31]), OneStage(given=CAREFUL)
    vehicle = initial_guess(drawn_file(careful_truck(), rng), seed)
    shared, records = shared_errors(settings, rng), []
    for i, speed in enumerate(SPEEDS):
        own = shared | log_errors(settings, rng)
        run = Plant(TRUCK, Properties(bank=own["bank"])).drive(lane_changes(count=1, speed=speed / 3.6))
        records.append(measured_record(run.time, run.truth, own, f"{speed:.0f} km/h", 100 * seed + i))
    return records, vehicle


def messages(name: str, seed: int) -> list[str]:
    """The messages of a refusal, or the cautions, with the fault of this name, if there is one."""
    fault = next((fault for fault in FAULTS if fault.name == name), None)
    records, vehicle = logs_and_file(seed)
    try:
        if fault:
            records, vehicle = [fault.record(record) for record in records], fault.vehicle(vehicle)
        run = run_identification(records, vehicle, OneStage(given=CAREFUL))
    except FifthwheelError as error:
        return str(error).splitlines()
    return list(run.conclusion.cautions)


def parser_of(description: str | None) -> argparse.ArgumentParser:
    """The options of a study of the faults."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--clean", type=int, default=20, help="number of clean pairs of logs")
    parser.add_argument("--jobs", type=int, default=1)
    return parser


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--only", nargs="*", help="words of the names of faults")
    arguments = parser.parse_args()
    faults = [f for f in FAULTS if not arguments.only or any(word in f.name for word in arguments.only)]
    with ProcessPoolExecutor(arguments.jobs) as pool:
        rows, named = [], 0
        names = [fault.name for fault in faults]
        for fault, found in zip(faults, pool.map(partial(messages, seed=arguments.seed), names), strict=True):
            first = found[0] if found else "none"
            right = bool(found) and any(word in first for word in fault.words)
            named += right
            rows.append((fault.name, "yes" if right else "no", str(len(found)), first))
            print(*rows[-1], sep=" | ", flush=True)
        print(f"{named} of {len(faults)} faults are named first", flush=True)
        seeds = range(arguments.seed + 1, arguments.seed + 1 + arguments.clean)
        clean = list(pool.map(partial(messages, ""), seeds))
    alarms = [f"seed {seed}: {found[0]}" for seed, found in zip(seeds, clean, strict=True) if found]
    print(f"{len(alarms)} of {len(clean)} clean pairs of logs have a caution", *alarms, sep="\n", flush=True)
    if not arguments.only:
        lines = [
            f"# The first message on a fault (seed {arguments.seed})",
            "",
            f"{named} of {len(faults)} faults are named first. {len(alarms)} of {len(clean)} clean pairs have one.",
            "",
            *table(["fault", "named", "messages", "first message"], rows),
            *[f"- {alarm}" for alarm in alarms],
        ]
        Path(__file__).with_suffix(".md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
