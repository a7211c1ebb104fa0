"""The outcome of one identification: one experiment, one arm, one seed; and all outcomes as tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pyarrow as pa

from fifthwheel.apps.cheng_cebon_2011.experiments import LANDING_LEG, Experiment
from fifthwheel.apps.studies.estimators import ParameterEstimate
from fifthwheel.apps.studies.result_table import Row, RunName, as_table, run_rows
from fifthwheel.apps.studies.scenarios import initial_guess, true_value
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, identify
from fifthwheel.estimate.observe import Observer

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
    estimates: Mapping[str, ParameterEstimate]  # parameters and derived quantities
    rms: Mapping[str, float]  # rms error of the states of the last unit, and of its sideslip at the landing leg, SI
    histories: Mapping[str, tuple[Array, Array]]  # time and estimate of every parameter; empty unless kept
    states: Mapping[str, Array]  # time and states of the last unit; empty unless kept

    @property
    def values(self) -> dict[str, float]:
        """Values of the estimates, SI."""
        return {name: estimate.value for name, estimate in self.estimates.items()}


def outcome(experiment: Experiment, arm_index: int, seed: int, *, keep: bool) -> Outcome:
    """Identify with one arm and one seed; `keep` keeps histories and states."""
    arm = experiment.arms[arm_index]
    record = experiment.run.record(experiment.sensors, seed=seed)
    result = identify([record], initial_guess(arm.assumed, seed, arm.fixed), arm.settings)
    states = observed_states(result, record)
    truth = experiment.run.truth
    rms = {name: float(np.sqrt(np.mean((values - truth[name]) ** 2))) for name, values in states.items()}
    return Outcome(
        experiment=experiment.name,
        arm=arm.name,
        seed=seed,
        estimates={e.name: e for e in (*result.parameters, *result.derived)},
        rms=rms,
        histories=histories(result) if keep else {},
        states={"time": record.time, **states} if keep else {},
    )


def observed_states(result: Identification, record: Record) -> dict[str, Array]:
    """States of the last unit by the identified vehicle, (N,) each."""
    unit = result.vehicle.units[-1]
    settings, sideslip = result.observer_settings(record.name), f"sideslip.{unit.name}"
    at_landing_leg = replace(settings, positions={sideslip: OPTICAL_POSITION})
    values = Observer(result.vehicle, record.signals, settings).batch(record).values
    names = [sideslip, *(f"{quantity}.{unit.name}" for quantity in ("roll", "roll_rate", "yaw_rate"))]
    states = {name: values[name] for name in names if name in values}
    on_roll_axis = Observer(result.vehicle, record.signals, at_landing_leg).batch(record).values[sideslip]
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


def parameter_table(experiments: Mapping[str, Experiment], outcomes: Sequence[Outcome]) -> pa.Table:
    """A row for each experiment, arm, seed and parameter, with the columns of `study`.

    `manoeuvre` is the experiment or variant, `estimator` the arm. truth_low and truth_high are the range of effective
    stiffness.
    """
    rows: list[Row] = []
    for outcome in outcomes:
        experiment = experiments[outcome.experiment]
        truth = partial(true_value, experiment.run.vehicle, experiment.stiffness)
        name = RunName(experiment.run.vehicle.name, outcome.experiment, "article", outcome.arm, outcome.seed)
        rows += run_rows(name._asdict() | {"error": ""}, outcome.estimates.values(), truth, outcome.rms)
    return as_table(rows).drop_columns(["seconds", "digest"])


def history_table(experiments: Mapping[str, Experiment], outcomes: Sequence[Outcome]) -> pa.Table:
    """Parameters and states over time of the outcomes that have histories: experiment, arm, seed, name, time (s),
    estimate and, for a state, truth (SI)."""
    tables = []
    for outcome in outcomes:
        truth = experiments[outcome.experiment].run.truth
        states = dict(outcome.states)
        time = states.pop("time", np.zeros(0))
        series: dict[str, tuple[Array, Array, Array | None]] = {
            name: (*history, None) for name, history in outcome.histories.items()
        }
        series |= {name: (time, values, truth[name]) for name, values in states.items()}
        for name, (instants, values, true) in series.items():
            n = len(instants)
            tables.append(
                pa.table(
                    {
                        "experiment": pa.array([outcome.experiment] * n).dictionary_encode(),
                        "arm": pa.array([outcome.arm] * n).dictionary_encode(),
                        "seed": pa.array([outcome.seed] * n, pa.int64()),
                        "name": pa.array([name] * n).dictionary_encode(),
                        "time": pa.array(instants, pa.float64()),
                        "estimate": pa.array(values, pa.float64()),
                        "truth": pa.nulls(n, pa.float64()) if true is None else pa.array(true, pa.float64()),
                    }
                )
            )
    return pa.concat_tables(tables).unify_dictionaries() if tables else pa.table({})
