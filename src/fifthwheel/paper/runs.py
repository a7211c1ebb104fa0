"""One identification of an experiment under one arm and one seed, and what is kept of it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.identify import Identification, TwoStage, identify
from fifthwheel.identify.parameters import stage_1_names
from fifthwheel.logs import Record
from fifthwheel.observe import Observer
from fifthwheel.paper.experiments import LANDING_LEG, Arm
from fifthwheel.plant import Drive, Sensor
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]
OPTICAL_PLACE = -2.34  # m, on the trailer, 4.1.3
TRACE_ROWS = 1500  # of the first pass, enough for a figure


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What one run found."""

    experiment: str
    arm: str
    seed: int
    values: Mapping[str, float]  # parameters and derived quantities, SI
    sigma: Mapping[str, float | None]
    verdicts: Mapping[str, str]
    rms: Mapping[str, float]  # of the error of states of the last unit, and of its sideslip at the landing leg, SI
    traces: Mapping[str, tuple[Array, Array]]  # of the first seed: parameter -> time, value of the filter
    states: Mapping[str, Array]  # of the first seed: time and states of the last unit


def started(told: Vehicle, seed: int, held: Mapping[str, float]) -> Vehicle:
    """The truck with each parameter of stage 1 at 80 or 120 %, those held at their own value."""
    names = stage_1_names(told)
    factors = np.random.default_rng([seed, 7]).choice([0.8, 1.2], len(names))
    values = told.parameters()
    return told.replace({name: values[name] * f for name, f in zip(names, factors, strict=True)} | dict(held))


def run(drive: Drive, sensors: Mapping[str, Sensor], arm: Arm, seed: int, *, experiment: str, keep: bool) -> Outcome:
    """Identify, observe, compare."""
    record = drive.record(sensors, seed=seed)
    found = identify([record], started(arm.told, seed, arm.held), arm.settings)
    estimates = (*found.parameters, *found.derived)
    states, rms = observed(found, record, drive, arm.settings)
    return Outcome(
        experiment=experiment,
        arm=arm.name,
        seed=seed,
        values={e.name: e.value for e in estimates},
        sigma={e.name: e.sigma for e in estimates},
        verdicts={e.name: str(e.verdict) for e in estimates},
        rms=rms,
        traces=histories(found) if keep else {},
        states=states if keep else {},
    )


def observed(
    found: Identification, record: Record, drive: Drive, settings: TwoStage
) -> tuple[dict[str, Array], dict[str, float]]:
    """States of the last unit by time, and the rms of their errors over the whole record."""
    unit = drive.vehicle.units[-1].name
    own = found.observer_settings(record.name)
    names = [f"{quantity}.{unit}" for quantity in ("sideslip", "roll", "roll_rate", "yaw_rate")]
    here = Observer(found.vehicle, record.signals, own).batch(record).values
    leg = Observer(found.vehicle, record.signals, replace(own, places={f"sideslip.{unit}": OPTICAL_PLACE}))
    states = {name: here[name] for name in names if name in here}
    leaning = drive.vehicle.units[-1].roll_axis_height * here[f"roll_rate.{unit}"] / record.signals["speed"]
    states[LANDING_LEG] = leg.batch(record).values[f"sideslip.{unit}"] + leaning  # it sees the road under the body
    errors: dict[str, Any] = {name: values - drive.truth[name] for name, values in states.items()}
    return {"time": record.time, **states}, {n: float(np.sqrt(np.mean(e**2))) for n, e in errors.items()}


def histories(found: Identification) -> dict[str, tuple[Array, Array]]:
    """Time and value of every parameter as the filter went: the first pass, thinned, and the end of every other."""
    thin = {}
    for trace in found.traces.values():
        ends = [*(start - 1 for start in trace.starts[1:]), len(trace.time) - 1]
        rows = np.unique([*np.linspace(0, ends[0], TRACE_ROWS).astype(int), *ends])
        for i, name in enumerate(trace.names):
            thin[name] = trace.time[rows], trace.values[rows, i]
    return thin
