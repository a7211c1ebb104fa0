"""How long a driver who obeys the coach needs to calibrate a truck, and how right the estimates are then.

    python benchmarks/coach.py [--seeds 4] [--first 9000] [--only careful]

Every seed draws the errors of all numbers of the vehicle file and of all sensors from what is stated of them
(`sharpness.KNOWLEDGE`), and begins with cornering stiffnesses and yaw inertia at 80 or 120 %. The nonlinear truck then
drives what the coach says, until the coach is done or ten minutes have passed. The driver is not exact: amplitude
within 20 %, speed within 3 %. Between two manoeuvres 10 s pass, of which nothing is learned.

Errors are in per cent of the true value: the nominal stiffness of the tyre model. 95 % of them should be below 2 sigma.
"""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from fifthwheel.apps.live.coach import Coach
from fifthwheel.apps.live.learning import Learning
from fifthwheel.apps.live.node import Output
from fifthwheel.apps.live.status import LiveFault, NodeStatus
from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.data.record import Record
from fifthwheel.estimate.design.next_manoeuvre import InformativeManoeuvre
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.online import LearnedValue, Learner
from fifthwheel.model.manoeuvres import Course
from fifthwheel.model.manoeuvres.courses import LaneChange, OpenLoop
from fifthwheel.model.plant import Plant, Properties
from sharpness import KNOWLEDGE
from trust_coverage import GYROS, SPEED, STEER, drawn_file, log_errors, measured_record, shared_errors
from trust_runs import TRUCK, table

SIGNALS = (SPEED, STEER, *GYROS)
PAUSE = 10.0
"""Time between two manoeuvres, s."""
LONGEST = 600.0
"""s"""
RATE = 100.0
"""Hz"""


@dataclass(frozen=True, kw_only=True)
class Found:
    """The result of one seed."""

    minutes: float
    manoeuvres: int
    done: bool
    estimates: Mapping[str, LearnedValue]
    targets: Mapping[str, float]


def course_of(step: InformativeManoeuvre, left: bool, rng: np.random.Generator) -> Course:
    """What a driver makes of a manoeuvre."""
    side = (1.0 if left else -1.0) * rng.uniform(0.8, 1.2)
    manoeuvre = replace(step.manoeuvre, speed=step.manoeuvre.speed * rng.uniform(0.97, 1.03))
    if manoeuvre.frequency is not None:
        lane_change = LaneChange(
            offset=abs(side) * (manoeuvre.offset(step.size) or 0.0), length=manoeuvre.speed / manoeuvre.frequency
        )
        path = lane_change.path(count=1, speed=manoeuvre.speed)
        sign = np.sign(side)
        return replace(path, y=sign * path.y, heading=sign * path.heading, curvature=sign * path.curvature)
    steer = side * step.size * manoeuvre.steer(TRUCK, RATE)[: round(manoeuvre.period * RATE)]
    time = np.arange(len(steer)) / RATE
    return OpenLoop(time=time, steer=steer, speed=np.full_like(time, manoeuvre.speed), name=manoeuvre.kind)


def outputs(learning: Learning, record: Record) -> Iterator[Output]:
    """What a node gives for the samples of a record."""
    for k, time in enumerate(record.time.tolist()):
        sample = {"time": time, **{name: float(record.signals[name][k]) for name in SIGNALS}}
        states = learning.push(sample)
        yield Output(
            time=time,
            bus_time=time,
            status=NodeStatus(int(states["status"])),
            faults=LiveFault.NONE,
            problems={},
            states=states,
            samples=(sample,),
        )


def drive(knowledge: str, seed: int) -> Found:
    """Drive what the coach says."""
    truck, stated = KNOWLEDGE[knowledge]
    settings, rng = OneStage(given=stated, tyres="linear"), np.random.default_rng([seed, 43])
    file = initial_guess(drawn_file(truck, rng), seed)
    errors = shared_errors(settings, rng) | log_errors(settings, rng)
    plant = Plant(TRUCK, Properties(bank=errors["bank"]))
    learning = Learning(Learner(file, SIGNALS, settings), file)
    coach, now = Coach(learning), 0.0
    while not coach.advice.done and now < LONGEST:
        run = plant.drive(course_of(coach.plan.steps[0], coach.advice.manoeuvres % 2 == 0, rng), rate=RATE)
        record = measured_record(run.time, run.truth, errors, f"manoeuvre at {now:.0f} s", seed + round(now))
        record = replace(record, time=record.time + now)
        for output in outputs(learning, record):
            coach.update(output)
        now = float(record.time[-1]) + PAUSE
    return Found(
        minutes=now / 60,
        manoeuvres=coach.advice.manoeuvres,
        done=coach.advice.done,
        estimates={e.name: e for e in learning.learner.parameters},
        targets=coach.targets,
    )


def rows(found: list[Found]) -> Iterator[tuple[str, ...]]:
    """Of each parameter with a target."""
    true = TRUCK.parameters()
    for name, target in found[0].targets.items():
        error = np.array([f.estimates[name].value / true[name] - 1 for f in found])
        sigma = np.array([f.estimates[name].sigma / true[name] for f in found])
        numbers = [f"{100 * x:.1f}" for x in (np.mean(error), np.sqrt(np.mean(error**2)), np.mean(sigma))]
        reached = sum(f.estimates[name].sigma <= target * abs(f.estimates[name].value) for f in found)
        within = sum(abs(error) < 2 * sigma)
        yield name, f"{reached} of {len(found)}", *numbers, f"{within} of {len(found)}"


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--first", type=int, default=9000)
    parser.add_argument("--only", choices=list(KNOWLEDGE), default=None)
    options = parser.parse_args()
    for knowledge in [options.only] if options.only else KNOWLEDGE:
        found = []
        for seed in range(options.first, options.first + options.seeds):
            found.append(drive(knowledge, seed))
            last = found[-1]
            state = "done" if last.done else "not done"
            print(f"{knowledge}, {seed}: {state}, {last.minutes:.1f} min, {last.manoeuvres} manoeuvres", flush=True)
        minutes = [f.minutes for f in found]
        print(f"\n{knowledge}: {np.mean(minutes):.1f} min on average, at most {max(minutes):.1f} min")
        heads = ("", "target reached", "mean error %", "rms error %", "mean sigma %", "within 2 sigma")
        print("\n".join([*table(heads, rows(found)), ""]), flush=True)


if __name__ == "__main__":
    main()
