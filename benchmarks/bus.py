"""Bias of cornering stiffnesses by what a bus does to a log: rates of messages, held samples, quantisation.

    python benchmarks/bus.py [--seeds 10] [--first 5000] [--jobs 2] [--only 100 ...]

Each seed draws the errors of the vehicle file and of the sensors of the careful case of `sharpness.py`, and the phase
of every message. The nonlinear truck drives five lane changes at 60 and at 80 km/h. Every case has the same draws. The
messages are held to a table of 100 Hz; "as rows" takes each row as a sample, as a record from arrays does, "as a log"
reads the table from a file, of which only renewed values count as samples.
"""

import argparse
import tempfile
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np

from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.types import Array
from fifthwheel.data.channels import SignalName
from fifthwheel.data.logs import read_log, write_record
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.model.manoeuvres import lane_changes
from sharpness import CAREFUL, careful_truck, estimate_samples, true_signals
from trust_coverage import GYROS as VARIANCES
from trust_coverage import Sample, drawn_file, log_errors, measured_record, shared_errors
from trust_runs import table

SPEEDS = (60 / 3.6, 80 / 3.6)
VDC2 = {"speed": 1 / 256 / 3.6, "steer": 1 / 1024 / 20, "yaw_rate": 1 / 8192, "roll_rate": 1 / 8192}
"""Resolution of CCVS and VDC2 in SI; that of the steering wheel with a ratio of 20."""
NAMES = ("tractor.front.cornering_stiffness", "tractor.drive.cornering_stiffness", "semitrailer.cornering_stiffness")


@dataclass(frozen=True, kw_only=True)
class Bus:
    """Rates of messages by quantity, Hz; None where a channel has a value in each row."""

    rates: Mapping[str, float]
    quantised: bool = False
    as_log: bool = True
    jitter: float = 0.0
    """Standard deviation of the instants of messages, s."""

    def record(self, record: Record, rng: np.random.Generator) -> Record:
        """The table of 100 Hz that a logger on this bus writes."""
        signals = {name: self._held(record.time, values, name, rng) for name, values in record.signals.items()}
        table = replace(record, signals=signals, reference={})
        if not self.as_log:
            return table
        with tempfile.TemporaryDirectory() as folder:
            write_record(table, f"{folder}/{record.name}.csv")
            return read_log(f"{folder}/{record.name}.csv")

    def _held(self, time: Array, values: Array, name: str, rng: np.random.Generator) -> Array:
        quantity = SignalName.of(name).quantity
        period = 1 / self.rates.get(quantity, 100.0)
        phase, noise = rng.uniform(), rng.normal(size=10_000)  # drawn in every case, so that all have the same draws
        if quantity in self.rates:
            sent = time[0] + (np.arange(1 + (time[-1] - time[0]) / period) + phase - 1) * period
            sent = np.sort(sent + self.jitter * noise[: sent.size])
            part = np.interp(sent, time, np.arange(time.size)) % 1.0
            lost = VARIANCES.get(name, 0.0) * 2 * part * (1 - part)  # an interpolation averages the noise
            message = np.interp(sent, time, values) + np.sqrt(lost) * noise[-sent.size :]
            values = message[np.maximum(np.searchsorted(sent, time, side="right") - 1, 0)]
        step = VDC2[quantity] if self.quantised else 0.0
        return np.rint(values / step) * step if step else values


SLOW_INPUTS = {"steer": 20.0, "speed": 10.0}
SLOW = SLOW_INPUTS | {"yaw_rate": 20.0, "roll_rate": 20.0}
CASES = {
    "100 Hz": Bus(rates={}),
    "100 Hz, quantised": Bus(rates={}, quantised=True),
    "steer 20 Hz, speed 10 Hz, as rows": Bus(rates=SLOW_INPUTS, as_log=False),
    "steer 20 Hz, speed 10 Hz, as a log": Bus(rates=SLOW_INPUTS),
    "steer and gyros 20 Hz, speed 10 Hz, as rows": Bus(rates=SLOW, as_log=False),
    "steer and gyros 20 Hz, speed 10 Hz, as a log": Bus(rates=SLOW),
    "the same, quantised, jitter 2 ms, as a log": Bus(rates=SLOW, quantised=True, jitter=0.002),
}


@cache
def logs(seed: int) -> tuple[Record, ...]:
    """The logs of a seed as a logger of 100 Hz without a bus writes them."""
    settings, rng = OneStage(given=CAREFUL), np.random.default_rng([seed, 29])
    drawn_file(careful_truck(), rng)
    shared = shared_errors(settings, rng)
    records = []
    for i, speed in enumerate(SPEEDS):
        errors = shared | log_errors(settings, rng)
        signals = true_signals(lane_changes(count=5, speed=speed), errors["bank"], nonlinear=True)
        records.append(measured_record(*signals, errors, f"log{i}", seed * 100 + i))
    return tuple(records)


def samples(seed: int, case: str) -> dict[str, Sample]:
    """Errors and sigmas of the estimates of a seed, as fractions; empty if a log is refused."""
    settings, phases = OneStage(given=CAREFUL), np.random.default_rng([seed, 31])
    file = drawn_file(careful_truck(), np.random.default_rng([seed, 29]))
    try:
        result = identify([CASES[case].record(log, phases) for log in logs(seed)], initial_guess(file, seed), settings)
    except FifthwheelError as error:
        print(f"seed {seed}: {error}", flush=True)
        return {}
    return dict(estimate_samples(result))


def main() -> None:
    """Print the table of the cases."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=5000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--only", nargs="*", default=[""], help="parts of the names of cases")
    arguments = parser.parse_args()
    cases = [case for case in CASES if any(part in case for part in arguments.only)]
    seeds = range(arguments.first, arguments.first + arguments.seeds)
    runs = list(product(seeds, cases))
    with ProcessPoolExecutor(arguments.jobs) as pool:
        results = dict(zip(runs, pool.map(samples, *zip(*runs, strict=True)), strict=True))
    rows = []
    for case, name in product(cases, NAMES):
        found = [results[seed, case][name] for seed in seeds if name in results[seed, case]]
        error, sigma = (100 * np.array([getattr(s, key)[0] for s in found]) for key in ("error", "sigma"))
        numbers = (error.mean(), sigma.mean(), np.sqrt(np.mean(error**2)))
        rows.append((case, name, str(len(found)), *(f"{x:.1f}" for x in numbers)))
    heads = ("case", "parameter", "logs", "mean error, %", "mean sigma, %", "rms error, %")
    print("\n".join(table(heads, rows)))


if __name__ == "__main__":
    main()
