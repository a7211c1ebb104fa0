"""The outcome of one identification: one experiment, one arm, one seed."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fifthwheel._types import Array
from fifthwheel.cheng_cebon_2011.experiments import LANDING_LEG, Experiment
from fifthwheel.identify import Identification, identify
from fifthwheel.observe import Observer
from fifthwheel.record import Record
from fifthwheel.studies.scenarios import initial_guess

OPTICAL_POSITION = -2.34
"""x of the optical sideslip sensor on the trailer, m (section 4.1.3)."""
HISTORY_ROWS = 1500
"""Samples of the first pass that a history keeps."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Result of one identification, and the errors of the states with it."""

    experiment: str
    arm: str
    seed: int
    values: Mapping[str, float]
    """Parameters and derived quantities, SI."""
    sigmas: Mapping[str, float | None]
    """Standard deviations, SI; None for a fixed parameter."""
    verdicts: Mapping[str, str]
    rms: Mapping[str, float]
    """Rms error of the states of the last unit, and of its sideslip at the landing leg, SI."""
    histories: Mapping[str, tuple[Array, Array]]
    """Time and estimate of every parameter; empty unless kept."""
    states: Mapping[str, Array]
    """Time and states of the last unit; empty unless kept."""


def outcome(experiment: Experiment, arm_index: int, seed: int, *, keep: bool) -> Outcome:
    """Identify with one arm and one seed; `keep` keeps histories and states."""
    arm = experiment.arms[arm_index]
    record = experiment.run.record(experiment.sensors, seed=seed)
    result = identify([record], initial_guess(arm.assumed, seed, arm.fixed), arm.settings)
    estimates = (*result.parameters, *result.derived)
    states = observed_states(result, record)
    truth = experiment.run.truth
    rms = {name: float(np.sqrt(np.mean((values - truth[name]) ** 2))) for name, values in states.items()}
    return Outcome(
        experiment=experiment.name,
        arm=arm.name,
        seed=seed,
        values={e.name: e.value for e in estimates},
        sigmas={e.name: e.sigma for e in estimates},
        verdicts={e.name: str(e.verdict) for e in estimates},
        rms=rms,
        histories=histories(result) if keep else {},
        states={"time": record.time, **states} if keep else {},
    )


def observed_states(result: Identification, record: Record) -> dict[str, Array]:
    """States of the last unit by the identified vehicle, (N,) each."""
    unit = result.vehicle.units[-1]
    settings = result.observer_settings(record.name)
    at_landing_leg = replace(settings, positions={f"sideslip.{unit.name}": OPTICAL_POSITION})
    values = Observer(result.vehicle, record.signals, settings).batch(record).values
    names = [f"{quantity}.{unit.name}" for quantity in ("sideslip", "roll", "roll_rate", "yaw_rate")]
    states = {name: values[name] for name in names if name in values}
    on_roll_axis = (
        Observer(result.vehicle, record.signals, at_landing_leg).batch(record).values[f"sideslip.{unit.name}"]
    )
    # the sensor measures relative to the road, roll_axis_height below the roll axis
    roll_effect = unit.roll_axis_height * values[f"roll_rate.{unit.name}"] / record.signals["speed"]
    return states | {LANDING_LEG: on_roll_axis + roll_effect}


def histories(result: Identification) -> dict[str, tuple[Array, Array]]:
    """Time and estimate of every parameter: the first pass, downsampled, and the end of every other pass."""
    samples = {}
    for history in result.histories.values():
        ends = [*(start - 1 for start in history.starts[1:]), len(history.time) - 1]
        rows = np.unique([*np.linspace(0, ends[0], HISTORY_ROWS).astype(int), *ends])
        for i, name in enumerate(history.names):
            samples[name] = history.time[rows], history.values[rows, i]
    return samples
