"""Long combinations: which sensors their parameters need, and the error of the states of the last unit.

    python benchmarks/combinations.py [--only b_double ...]

Writes combinations.md beside this file. Parameters: sigma that `fifthwheel check` predicts from five lane changes of
the linear truck, with the default uncertainty of vehicle and sensors. States: root mean square error of the observer in
one lane change of the nonlinear truck, with its vehicle file and the noise of the article's gyros; the largest true
value is in the first row.
"""

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from fifthwheel.data.channels import SignalName
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.design.assess import predict_sigmas
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.observe import Observer
from fifthwheel.model.manoeuvres import lane_changes
from fifthwheel.model.plant import Plant, Sensor, article_sensors
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, get

NAMES = ("b_double", "a_double", "truck_dolly_semitrailer", "truck_full_trailer")
ANGLE_VARIANCE = np.radians(0.2) ** 2
"""Noise of an articulation sensor, rad^2."""
SEEDS = 10


def sensor_sets(vehicle: Vehicle) -> dict[str, tuple[str, ...]]:
    """Rates and angles that are measured, by the name of the set."""
    first, *behind = [unit.name for unit in vehicle.units]
    dollies = [name for name in behind if name == "dolly"]
    gyros = tuple(article_gyro_variance([first, *behind]))
    angles = tuple(f"articulation.{name}" for name in behind)

    def of(*names: str) -> tuple[str, ...]:
        return tuple(name for name in gyros if SignalName.of(name).unit in names)

    others = [name for name in (first, *behind) if name not in dollies]
    sets = {"gyros of all units": gyros, "gyros of all units, articulation angles": (*gyros, *angles)}
    if dollies:
        sets["gyros of all units but the dolly"] = of(*others)
        sets["gyros of all units but the dolly, articulation of the dolly"] = (*of(*others), "articulation.dolly")
    ends = of(first, behind[-1])
    return sets if ends in sets.values() else {**sets, "gyros of first and last unit": ends}


def with_noise(names: tuple[str, ...], vehicle: Vehicle) -> dict[str, float]:
    """Variance of each signal, SI squared."""
    gyros = article_gyro_variance([unit.name for unit in vehicle.units])
    return {name: gyros.get(name, ANGLE_VARIANCE) for name in names}


def parameter_table(vehicle: Vehicle, sets: Mapping[str, tuple[str, ...]]) -> list[str]:
    """Predicted sigma of every parameter, per cent, for every set of sensors."""
    columns = []
    for names in sets.values():
        record = simulate(vehicle, count=5, sensors=with_noise(names, vehicle))
        assessment = predict_sigmas([record], vehicle)
        columns.append({p.name: p for p in assessment.parameters})
    lines = ["| sigma, % | " + " | ".join(sets) + " |", "|---" * (1 + len(sets)) + "|"]
    for name in columns[0]:
        cells = []
        for column in columns:
            p = column.get(name)
            known = p is not None and p.verdict is Verdict.CONVERGED
            cells.append(f"{100 * p.sigma / abs(p.value):.1f}" if p and known else "–")
        lines.append(f"| `{name}` | " + " | ".join(cells) + " |")
    return [*lines, ""]


def state_table(vehicle: Vehicle, sets: Mapping[str, tuple[str, ...]]) -> list[str]:
    """Error of the states of the last unit of the nonlinear truck for every set of sensors, deg."""
    run = Plant(vehicle).drive(lane_changes(count=1))
    last = vehicle.units[-1].name
    states = [f"{quantity}.{last}" for quantity in ("sideslip", "roll", "articulation")]
    inputs = {n: s for n, s in article_sensors(vehicle).items() if SignalName.of(n).quantity in ("speed", "steer")}
    lines = ["| error, deg | " + " | ".join(f"`{name}`" for name in states) + " |", "|---" * (1 + len(states)) + "|"]
    peaks = [f"{np.degrees(np.abs(run.truth[name]).max()):.2f}" for name in states]
    lines.append("| *largest true value* | " + " | ".join(peaks) + " |")
    for title, names in sets.items():
        sensors = inputs | {n: Sensor(variance=v) for n, v in with_noise(names, vehicle).items()}
        squares = np.zeros(len(states))
        for seed in range(SEEDS):
            record = run.record(sensors, seed=seed)
            estimated = Observer(vehicle, record.signals).batch(record)
            squares += [np.mean((estimated.values[name] - run.truth[name]) ** 2) for name in states]
        lines.append(f"| {title} | " + " | ".join(f"{e:.3f}" for e in np.degrees(np.sqrt(squares / SEEDS))) + " |")
    return [*lines, ""]


def main() -> None:
    """Print the tables; without --only write combinations.md."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=NAMES, default=[], help="print these vehicles; write no file")
    options = parser.parse_args()
    text = [
        "# Long combinations",
        "",
        "Written by `python benchmarks/combinations.py`; its docstring explains the tables.",
        "",
    ]
    for name in options.only or NAMES:
        vehicle = get(name)
        sets = sensor_sets(vehicle)
        lines = [f"## {name}", "", *parameter_table(vehicle, sets), *state_table(vehicle, sets)]
        print("\n".join(lines), flush=True)
        text += lines
    if not options.only:
        Path(__file__).with_suffix(".md").write_text("\n".join(text), encoding="utf-8")


if __name__ == "__main__":
    main()
