"""Coverage of the 90 % intervals for trucks that are described by a brochure, a tape measure and weighbridge slips.

Each seed draws a truck: lengths, masses and loads from the ranges below, all other numbers from the spread of the
vehicle classes. The user of `fifthwheel vehicle new` knows the lengths to 1 cm, and slips with an error of 1 % of each
load; trucks with an odd seed have no empty slip, but a brochure. No height is known. The log is that of the linear
truck in lane changes, with errors of all sensors.

    python benchmarks/classes.py --trucks 60 --out table.md
"""

import argparse
import math
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fifthwheel.apps.workflow.new_vehicle import described_vehicle
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Axle, AxleGroup, Coupling, Payload, SprungMass, Unit, Vehicle
from fifthwheel.truck.classes import (
    CLASSES,
    DAMPING_TIME,
    FIFTH_WHEEL,
    FLOOR_HEIGHT,
    PAYLOAD_WIDTH,
    RELAXATION_LENGTH,
    AxleFigures,
    Figure,
    VehicleClass,
)
from fifthwheel.truck.slip import Slip
from trust_runs import sensor_sigma

INTERVAL = 1.645
"""Half width of a 90 % interval, in standard deviations."""
SPEED = 80 / 3.6
COUNT = 5
"""Lane changes of a log."""
COMBINATIONS = (
    ("tractor_4x2", "semitrailer_3"),
    ("tractor_6x2", "semitrailer_3"),
    ("tractor_6x4", "semitrailer_2"),
)
WHEELBASES = {"tractor_4x2": (3.6, 3.9), "tractor_6x2": (3.5, 4.4), "tractor_6x4": (3.2, 4.8)}
"""From the front axle to the first axle behind it, m."""
TRAILERS = {"semitrailer_2": (8.5, 12.0), "semitrailer_3": (7.0, 8.5)}
"""From the kingpin to the middle of the axles, m."""
GROSS = {"semitrailer_2": (20e3, 28e3), "semitrailer_3": (22e3, 34e3)}
"""Mass of the laden trailer, kg."""
SPREAD = 1.35
LENGTH_SIGMA, LOAD_SIGMA = 0.01, 0.01
"""Of a tape measure, m, and of a weighbridge, fraction of the load."""


class Draw:
    """Random numbers of one truck."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng([seed, 31])

    def of(self, figure: Figure) -> float:
        """A number by the spread of a class, within three standard deviations and above a fifth of its value."""
        while True:
            value = figure.value + figure.sigma * self.rng.normal()
            if abs(value - figure.value) <= 3 * figure.sigma and value > 0.2 * figure.value:
                return float(value)

    def within(self, limits: tuple[float, float]) -> float:
        """A number between two limits."""
        return float(self.rng.uniform(*limits))


def drawn_truck(draw: Draw, tractor_class: str, trailer_class: str) -> Vehicle:
    """A stable truck with every number."""
    while True:
        tractor, trailer = CLASSES[tractor_class], CLASSES[trailer_class]
        first = draw.within(WHEELBASES[tractor_class])
        rear = [-first - SPREAD * k for k in range(tractor.axle_counts[1])]
        wheelbase = -sum(rear) / len(rear)
        kingpin = draw.within((0.84, 0.98)) * wheelbase
        middle, count = draw.within(TRAILERS[trailer_class]), trailer.axle_counts[0]
        bogie = [-middle + 1.31 * ((count - 1) / 2 - k) for k in range(count)]
        mass, tare, gross = draw.of(tractor.tare), draw.of(trailer.tare), draw.within(GROSS[trailer_class])
        cog, rear_cog = draw.of(tractor.cog) * wheelbase, draw.within((0.62, 0.72)) * middle
        hitch = gross * (1 - rear_cog / middle)
        loads = [mass * (1 - cog / wheelbase) + hitch * (1 - kingpin / wheelbase)]
        loads = [*loads, mass + hitch - loads[0], gross - hitch]
        steer, drive = (
            _group(draw, n, tractor.groups[n], x, load)
            for n, x, load in zip(("front", "drive"), ([0.0], rear), loads[:2], strict=True)
        )
        units = (
            _unit(draw, tractor, "tractor", mass, None, -cog, wheelbase, (steer, drive)),
            _unit(
                draw,
                trailer,
                "semitrailer",
                gross,
                gross - tare,
                -rear_cog,
                middle,
                (_group(draw, "axles", trailer.groups["axles"], bogie, loads[2]),),
            ),
        )
        wheel = Coupling(
            leading_position=-kingpin,
            trailing_position=0.0,
            height=draw.of(FIFTH_WHEEL.height),
            roll_stiffness=draw.of(FIFTH_WHEEL.roll_stiffness),
        )
        truck = Vehicle(name="drawn", units=units, couplings=(wheel,))
        if np.linalg.eigvals(dynamics.matrices(truck, SPEED, roll=True).A).real.max() < -0.2:
            return truck


def _group(draw: Draw, name: str, figures: AxleFigures, positions: list[float], load: float) -> AxleGroup:
    count = len(positions)
    stiffness = count * draw.of(figures.roll_stiffness)
    axles = [
        Axle(name=name if count == 1 else f"{name}_{k}", position=x, steerable=name == "front")
        for k, x in enumerate(positions)
    ]
    return AxleGroup(
        name=name,
        axles=tuple(axles),
        cornering_stiffness=draw.of(figures.cornering_coefficient) * load * STANDARD_GRAVITY,
        roll_stiffness=stiffness,
        tyre_roll_stiffness=count * draw.of(figures.tyre_roll_stiffness),
        roll_damping=stiffness * draw.of(DAMPING_TIME),
        relaxation_length=draw.of(RELAXATION_LENGTH),
    )


def _unit(
    draw: Draw,
    kind: VehicleClass,
    name: str,
    mass: float,
    payload: float | None,
    cog: float,
    wheelbase: float,
    groups: tuple[AxleGroup, ...],
) -> Unit:
    figures = zip(groups, kind.groups.values(), strict=True)
    unsprung = sum(len(group.axles) * draw.of(figure.unsprung_mass) for group, figure in figures)
    body = mass - (payload or 0.0) - unsprung
    return Unit(
        name=name,
        mass=mass,
        cog=cog,
        yaw_inertia=mass * (draw.of(kind.body.yaw_gyration) * wheelbase) ** 2,
        roll_axis_height=draw.of(kind.body.roll_axis_height),
        sprung=SprungMass(
            mass=body,
            cog_height=draw.of(kind.body.cog_height),
            roll_inertia=body * draw.of(kind.body.roll_gyration) ** 2,
        ),
        payload=None
        if payload is None
        else Payload(
            mass=payload,
            height=draw.within((0.8, 2.2)),
            width=draw.of(PAYLOAD_WIDTH),
            floor_height=draw.of(FLOOR_HEIGHT),
        ),
        axle_groups=groups,
    )


def described(draw: Draw, truck: Vehicle, tractor_class: str, trailer_class: str, *, brochure: bool) -> Vehicle:
    """The vehicle file that `fifthwheel vehicle new` writes; by brochure: unladen mass of the trailer to 3 %."""
    tractor, trailer = truck.units
    groups = ("tractor.front", "tractor.drive", "semitrailer")

    def length(value: float) -> tuple[float, float]:
        return abs(value) + LENGTH_SIGMA * draw.rng.normal(), LENGTH_SIGMA

    def slip(loads: Mapping[str, float]) -> dict[str, float]:
        return {path: load / STANDARD_GRAVITY * (1 + LOAD_SIGMA * draw.rng.normal()) for path, load in loads.items()}

    assert trailer.payload is not None
    tare = trailer.mass - trailer.payload.mass
    unladen = truck.replace(
        {"semitrailer.mass": tare + 1, "semitrailer.payload.mass": 1.0, "semitrailer.cog": 0.96 * trailer.cog}
    )
    wheelbase = -tractor.axle_groups[1].position
    share = -tractor.cog / wheelbase * tractor.mass * STANDARD_GRAVITY
    alone = {groups[0]: tractor.mass * STANDARD_GRAVITY - share, groups[1]: share}
    known: dict[str, Any] = {
        "tractor": tractor_class,
        "trailer": trailer_class,
        "wheelbase": length(tractor.axle_groups[1].axles[0].position),
        "tractor_spread": length(SPREAD),
        "trailer_wheelbase": length(trailer.axle_groups[0].position),
        "trailer_spread": length(1.31),
    }
    if brochure:
        known["fifth_wheel"] = length(truck.couplings[0].leading_position)
        known["trailer_tare"] = (tare * (1 + 0.03 * draw.rng.normal()), 0.03 * tare)
    empty = {} if brochure else slip(unladen.axle_loads())
    weighed = Slip(laden=slip(truck.axle_loads()), solo=slip(alone), empty=empty, accuracy=LOAD_SIGMA)
    text = described_vehicle(known, weighed)
    return Vehicle.loads(text)


def logged(draw: Draw, truck: Vehicle, seed: int) -> Record:
    """Lane changes of the linear truck, with errors of all sensors from the priors of the identification."""
    settings, normal = OneStage(), draw.rng.normal
    units = [unit.name for unit in truck.units]
    noise = article_gyro_variance(units)
    record = simulate(truck, count=COUNT, speed=SPEED, seed=seed, sensors=noise)
    model = dynamics.model(truck, tuple(noise), roll=True)
    _, y = free_response(model, dynamics.all_parameters(truck, tuple(noise)), record.time, record.signals)
    truth: dict[str, Array] = dict(zip(noise, y.T, strict=True))
    steer, t = truck.steer_signals()[0], record.time
    signals = {"speed": record.signals["speed"]}

    def error(signal: str, kind: str) -> float:
        return sensor_sigma(f"{signal}.{kind}", settings) * normal()

    delayed = np.interp(t - error(steer, "delay"), t, record.signals[steer])
    signals[steer] = delayed / (1 + error(steer, "gain")) + error(steer, "offset")
    for name, variance in noise.items():
        other = name.replace("yaw", "roll") if name.startswith("yaw") else name.replace("roll", "yaw")
        angle = error(name, "misalignment") * (1 if name.startswith("yaw") else -1)
        value = math.cos(angle) * truth[name] + math.sin(angle) * truth[other]
        value = np.interp(t - error(name, "delay"), t, value)
        value = value * (1 + error(name, "gain")) + error(name, "offset")
        signals[name] = value + math.sqrt(variance) * normal(size=len(t))
    return Record(time=t, signals=signals, name="log")


def case(seed: int) -> dict[str, tuple[float, float, str]] | str:
    """Error and sigma as fractions of the truth, and verdict of each estimate; the message of a refusal."""
    draw = Draw(seed)
    classes = COMBINATIONS[seed % len(COMBINATIONS)]
    truck = drawn_truck(draw, *classes)
    try:
        file = described(draw, truck, *classes, brochure=seed % 2 == 1)
        result: Identification = identify([logged(draw, truck, seed)], file)
    except FifthwheelError as error:
        return str(error)
    true = truck.parameters()
    return {
        e.name: (e.value / true[e.name] - 1, (e.sigma or math.inf) / true[e.name], str(e.verdict))
        for e in result.parameters
        if e.name in true  # not the friction: the linear truck has none
    }


def table(cases: list[dict[str, tuple[float, float, str]]]) -> list[str]:
    """One row for each parameter, as Markdown."""
    lines = [
        "| | converged | coverage | mean error | rms error | mean sigma | beyond 3 sigma, converged |",
        "|" + "---|" * 7,
    ]
    everything: list[bool] = []
    for name in cases[0]:
        error, sigma, verdicts = (np.array(column) for column in zip(*[c[name] for c in cases], strict=True))
        converged = verdicts == "converged"
        covered = np.abs(error) <= INTERVAL * sigma
        silent = converged & (np.abs(error) > 3 * sigma)
        everything += list(covered)
        numbers = [
            f"{100 * x:.1f} %" for x in (error.mean(), np.sqrt((error**2).mean()), sigma[np.isfinite(sigma)].mean())
        ]
        lines.append(
            f"| {name} | {converged.mean():.0%} | {covered.mean():.0%} | {' | '.join(numbers)} | {silent.sum()} |"
        )
    lines.append(f"| all | | {np.mean(everything):.0%} | | | | |")
    return lines


def main() -> None:
    """Print and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trucks", type=int, default=60)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--out", type=Path, help="file for the table; default: the terminal")
    options = parser.parse_args()
    cases: list[dict[str, tuple[float, float, str]]] = []
    for seed in range(options.first, options.first + options.trucks):
        start = time.perf_counter()
        result = case(seed)
        summary = result if isinstance(result, str) else " ".join(f"{e / s:+.1f}{v[0]}" for e, s, v in result.values())
        print(f"[{seed}] {time.perf_counter() - start:.0f} s: {summary}", file=sys.stderr, flush=True)
        if not isinstance(result, str):
            cases.append(result)
    lines = [f"{len(cases)} of {options.trucks} trucks; the others are refused.", "", *table(cases)]
    text = "\n".join(lines) + "\n"
    if options.out:
        options.out.write_text(text, encoding="utf-8")
    else:
        print(text)


if __name__ == "__main__":
    main()
