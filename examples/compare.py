"""Accuracy and time of own estimators beside those of fifthwheel, over simulated lane changes."""

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import fifthwheel as fw
from fifthwheel.apps.studies import Identified, exact_guess, initial_guess, observer

STATE = "rms.sideslip.semitrailer"
SETTLING_TIME = 1.0
"""Left out of the errors of states, s: filters differ in what they assume on the first sample."""
LANE_CHANGES = {"lane changes": fw.SimulatedRun(count=2)}


def compare(estimators: Mapping[str, fw.Estimator], *, seeds: int = 5, jobs: int | None = None) -> list[dict]:
    """Print and return, for each estimator, the mean over the seeds.

    The Kalman filter runs with the parameters of the truck, and with the initial values that all other estimators get:
    each cornering stiffness and yaw inertia is at 80 or 120 %.

    Args:
        estimators: by name.
        seeds: number of seeds.
        jobs: processes, one per core by default.
    """
    kalman = fw.StatesOf(observer)
    others = {"Kalman filter, initial values": kalman, **estimators, "one stage, then Kalman filter": Identified()}
    rows = []
    with TemporaryDirectory() as folder:
        for guess, chosen in ((exact_guess, {"Kalman filter, true values": kalman}), (initial_guess, others)):
            out = Path(folder) / f"{guess.__name__}.parquet"
            table = fw.study(
                ["cheng_cebon_2011"],
                chosen,
                out,
                manoeuvres=LANE_CHANGES,
                seeds=range(seeds),
                guess=guess,
                settling_time=SETTLING_TIME,
                jobs=jobs,
            )
            rows += [_mean(name, [row for row in table.to_pylist() if row["estimator"] == name]) for name in chosen]
    print(f"{'':32}{'sideslip, deg':>14}{'parameters':>12}{'CPU, s':>9}")
    for row in rows:
        error = "" if row["parameters"] is None else f"{100 * row['parameters']:.1f} %"
        print(f"{row['estimator']:32}{np.degrees(row['sideslip']):14.4f}{error:>12}{row['seconds']:9.2f}")
    return rows


def _mean(name: str, rows: list[dict]) -> dict:
    """Mean rms error of the trailer's sideslip, rms relative error of stiffnesses and yaw inertia, median time."""
    for row in rows:
        if row["error"]:
            raise RuntimeError(row["error"])
    errors = [
        row["estimate"] / row["truth"] - 1
        for row in rows
        if row["parameter"].endswith(("cornering_stiffness", "yaw_inertia"))
    ]
    return {
        "estimator": name,
        "sideslip": float(np.mean([row[STATE] for row in rows])),
        "parameters": float(np.sqrt(np.mean(np.square(errors)))) if errors else None,
        "seconds": float(np.median([row["seconds"] for row in rows])),
    }
