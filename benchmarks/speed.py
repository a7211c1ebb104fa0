"""Speed on one core, compared with other libraries on the same problem.

    python benchmarks/speed.py            # needs the test extra: statsmodels and filterpy

* dual EKF step: 4 states, 4 parameters, 2 channels, exact derivatives;
* Kalman step: the yaw-roll model with 8 states and 4 channels, discretised at every step;
* both for one vehicle, and for a batch of vehicles (several per vector register);
* statsmodels and filterpy: the same filter with 8 states and constant matrices;
* Observer.push and Learner.push: one sample at a time, from a dict to a dict;
* identification in one stage: 120 s at 100 Hz, for several sets of unknowns;
* the nonlinear truck with a time step of 1 ms: simulated time divided by computing time;
* one evaluation of the posterior and its derivatives by all unknowns, divided by its floor, a plain simulation;
* the command line: `fifthwheel identify` on 120 s, 10 min and 1 h of everyday driving at 100 Hz, as a process with
  states and report, and `fifthwheel states`: duration, processor time and memory; the first without compiled steps;
  `fifthwheel --help`.
  The processor time is also divided by that of a bare import of the libraries, the floor of a process; the floor of
  the memory is that of the same process with the samples of the log.

Each number is the best of several runs. Ratios are more reliable than absolute numbers.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np
from threadpoolctl import threadpool_limits

from fifthwheel import truck as vehicle
from fifthwheel.apps.cheng_cebon_2011 import dual
from fifthwheel.base.native import Scan
from fifthwheel.data import logs
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters import Noise, kalman, sample_rows
from fifthwheel.estimate.filters.model import pack_array
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.one_stage.log_posterior import log_posterior
from fifthwheel.estimate.identify.unknowns.parameters import stage_1_names
from fifthwheel.estimate.observe import Observer
from fifthwheel.estimate.online.learner import Learner
from fifthwheel.model import dynamics
from fifthwheel.model.simulate import simulate

SAMPLES, VEHICLES = 20_000, 64
TRUCK = vehicle.get("cheng_cebon_2011")
FIVE = OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear")
ERRORS = OneStage(given={"others": "exact", "road.bank": "+- 0.03 rad"}, tyres="linear")
NOT_LAGGING = TRUCK.replace({f"{path}.relaxation_length": 0.0 for path in TRUCK.axle_loads()})  # 4 and 8 states


def best(work: Callable[[], object], runs: int = 5, clock: Callable[[], float] = time.perf_counter) -> float:
    """Shortest duration of several runs, s."""
    times = []
    for _ in range(runs):
        start = clock()
        work()
        times.append(clock() - start)
    return min(times)


def logged_truck() -> vehicle.Vehicle:
    """The truck with the steered axles that a simulated record has."""
    record = simulate(NOT_LAGGING, count=1)
    return NOT_LAGGING.with_logged_steering(record.signals, record.name)


def rows(model: dynamics.ChainModel) -> np.ndarray:
    """Samples of sinusoidal steering at 88 km/h, with noise as measurements."""
    time_step = np.full(SAMPLES, 0.01)
    steer = 0.01 * np.sin(np.arange(SAMPLES) * 0.025)
    speed = np.full(SAMPLES, 24.4)
    y = np.random.default_rng(0).normal(size=(SAMPLES, len(model.outputs))) * 4e-3
    return sample_rows(time_step, np.column_stack([speed, steer, speed, steer]), y)


def steps_per_second(scan: Scan, carry: np.ndarray, sample: np.ndarray, constant: np.ndarray) -> tuple[float, float]:
    """Million steps per second, for one vehicle and for a batch; the layout of the arrays is not included."""
    single = SAMPLES / best(lambda: scan(carry, sample, constant))
    carries, constants = (np.repeat(a[None], VEHICLES, axis=0) for a in (carry, constant))
    segment = sample[:2000]
    lanes = [scan._to_lanes(a) for a in (carries, np.broadcast_to(segment, (VEHICLES, *segment.shape)), constants)]
    groups = len(lanes[0])
    output = np.empty((groups, len(segment), scan.n_output, scan.lanes))
    addresses = [a.ctypes.data for a in (*lanes, output)]
    seconds = best(lambda: scan.vector(len(segment), groups, *addresses))
    return single / 1e6, VEHICLES * len(segment) / seconds / 1e6


def dual_speed() -> tuple[float, float]:
    """Million steps per second of the dual EKF, for one vehicle and for a batch."""
    truck = logged_truck()
    model = dynamics.model(truck, ("yaw_rate.tractor", "yaw_rate.semitrailer"), roll=False, free=stage_1_names(truck))
    values = dynamics.all_parameters(truck, model.outputs)
    centre = model.free_values(values)
    scaling = dual.Scaling(
        logarithmic=(True,) * 4, centre=centre, scale=np.full(4, 0.3), lower=centre / 8, upper=centre * 8
    )
    start = dual.DualState(x=np.zeros(4), P=np.eye(4) * 1e-4, z=np.zeros(4), Pz=np.eye(4), sensitivity=np.zeros((4, 4)))
    noise = Noise(process=np.eye(4) * 1e-6, measurement=np.array([1.52e-5, 1.11e-5]))
    constant = np.concatenate(
        [model.known_values(values), noise.vector(), scaling.vector(), np.zeros(4), [0.0, 1.0, 1.0]]
    )
    return steps_per_second(dual.dual_step(model, scaling.logarithmic), start.vector(), rows(model), constant)


@dataclass(frozen=True, eq=False)
class ConstantModel:
    """A linear model with constant matrices, as in the other libraries."""

    transition: ca.Function
    observation: ca.Function
    state_jacobian: ca.Function

    @classmethod
    def of(cls, n: int, m: int) -> "ConstantModel":
        """n states, m channels, no inputs; c = [transition matrix, observation matrix]."""
        x, dt, d, p, c = (
            ca.SX.sym(name, size) for name, size in zip("xtdpc", (n, 1, 0, 0, n * n + m * n), strict=True)
        )
        F, H = ca.reshape(c[: n * n], n, n), ca.reshape(c[n * n :], m, n)
        return cls(
            ca.Function("f", [x, dt, d, p, c], [F @ x]),
            ca.Function("h", [x, d, p, c], [H @ x]),
            ca.Function("F", [x, dt, d, p, c], [F]),
        )


def kalman_speed() -> tuple[tuple[float, float], tuple[float, float], dict[str, float]]:
    """Million steps per second: discretised at every step, with constant matrices, and other libraries."""
    truck = logged_truck()
    outputs = ("roll_rate.tractor", "roll_rate.semitrailer", "yaw_rate.tractor", "yaw_rate.semitrailer")
    model = dynamics.model(truck, outputs, roll=True)
    c = model.known_values(dynamics.all_parameters(truck, outputs))
    noise = Noise(process=np.eye(8) * 1e-6, measurement=np.array([4.52e-4, 4.70e-5, 1.52e-5, 1.11e-5]))
    carry = np.concatenate([np.zeros(8), pack_array(np.eye(8) * 1e-4)])
    sample = rows(model)
    discretised = steps_per_second(kalman.kalman_step(model), carry, sample, np.concatenate([c, noise.vector()]))
    x, d = ca.SX.sym("x", 8), ca.SX.sym("d", 4)
    forward = model.transition(x, 0.01, d, ca.SX(0, 1), c)
    F = np.array(ca.Function("F", [x, d], [ca.jacobian(forward, x)])(np.zeros(8), sample[0, 1:5]))
    H = np.eye(8)[[model.states.index(name) for name in outputs]]
    y = sample[:, 5:9]
    constant_model = ConstantModel.of(8, 4)
    matrices = np.concatenate([F.ravel(order="F"), H.ravel(order="F")])
    no_inputs = sample_rows(sample[:, 0], np.empty((SAMPLES, 0)), y)
    constants = np.concatenate([matrices, noise.vector()])
    constant = steps_per_second(kalman.kalman_step(constant_model), carry, no_inputs, constants)
    return (
        discretised,
        constant,
        {"statsmodels": _statsmodels(F, H, noise, y), "filterpy": _filterpy(F, H, noise, y[:2000])},
    )


def _statsmodels(F: np.ndarray, H: np.ndarray, noise: Noise, y: np.ndarray) -> float:
    from statsmodels.tsa.statespace.kalman_filter import KalmanFilter

    kalman_filter = KalmanFilter(k_endog=4, k_states=8, k_posdef=8)
    kalman_filter.bind(np.asfortranarray(y.T))
    kalman_filter["design"], kalman_filter["transition"], kalman_filter["selection"] = H, F, np.eye(8)
    kalman_filter["obs_cov"], kalman_filter["state_cov"] = np.diag(noise.measurement), noise.process * 0.01
    kalman_filter.initialize_known(np.zeros(8), np.eye(8) * 1e-4)
    kalman_filter.tolerance = 0  # update the gain at every step, as the filters here do
    return len(y) / best(kalman_filter.filter, 3) / 1e6


def _filterpy(F: np.ndarray, H: np.ndarray, noise: Noise, y: np.ndarray) -> float:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from filterpy.kalman import KalmanFilter

    kalman_filter = KalmanFilter(dim_x=8, dim_z=4)
    kalman_filter.F, kalman_filter.H = F, H
    kalman_filter.R, kalman_filter.Q = np.diag(noise.measurement), noise.process * 0.01

    def run() -> None:
        for sample in y:
            kalman_filter.predict()
            kalman_filter.update(sample)

    return len(y) / best(run, 3) / 1e6


def push_time(make: Callable[[Record], Observer | Learner]) -> tuple[float, float]:
    """Median and 99th percentile of the duration of a push, us."""
    record = simulate(TRUCK, count=5)
    estimator = make(record)
    columns = {"time": record.time.tolist()} | {name: values.tolist() for name, values in record.signals.items()}
    samples = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    times = []
    for sample in samples:
        start = time.perf_counter_ns()
        estimator.push(sample)
        times.append(time.perf_counter_ns() - start)
    median, percentile_99 = np.percentile(times[50:], [50, 99]) / 1e3
    return float(median), float(percentile_99)


def one_stage_time() -> dict[str, float]:
    """Duration of an identification of 120 s at 100 Hz with compiled steps, s, by the unknowns."""
    record, values = simulate(TRUCK, count=15, seed=1), TRUCK.parameters()
    names = stage_1_names(TRUCK)
    guess = TRUCK.replace({n: values[n] * f for n, f in zip(names, (0.8, 1.2, 0.8, 1.2), strict=True)})
    cases = {
        "five parameters": FIVE,
        "+ sensor errors, bank": ERRORS,
        "+ uncertain parameters": OneStage(tyres="linear"),
        "+ tyres that saturate": OneStage(),
    }
    return {name: best(lambda s=s: identify([record], guess, s), 3) for name, s in cases.items()}


def evaluation_ratio() -> tuple[int, float]:
    """Number of unknowns, and the processor time of an evaluation with derivatives over that of one without."""
    density = log_posterior([simulate(TRUCK, count=5, seed=1)], TRUCK, OneStage())
    problem, z = density.problem, density.solution.minimum.z
    with threadpool_limits(limits=1, user_api="blas"):
        whole, plain = (best(lambda f=f: f(z), clock=time.process_time) for f in (problem.expand, problem.cost))
    return len(z), whole / plain


def density_times(settings: OneStage) -> tuple[int, float, float]:
    """Number of unknowns, and the processor times of the density of the posterior and of its gradient for 16 s, ms."""
    density = log_posterior([simulate(TRUCK, count=2, seed=1)], TRUCK, settings)
    plain, gradient = (
        best(lambda f=f: f(density.mean), 20, clock=time.process_time) for f in (density, density.gradient)
    )
    return len(density.names), plain * 1e3, gradient * 1e3


def plant_speed() -> float:
    """Simulated time of the nonlinear truck divided by computing time."""
    from fifthwheel.model.manoeuvres import course
    from fifthwheel.model.plant import Plant

    plant, path = Plant(NOT_LAGGING), course("lane_changes", NOT_LAGGING, count=2)
    return path.duration / best(lambda: plant.drive(path), runs=3)


@dataclass(frozen=True)
class ProcessCost:
    """What a process needed."""

    wall: float  # s
    cpu: float  # s, of all threads and child processes
    memory: float  # MB, the largest of its processes
    record: float = 0.0  # MB, of the samples of its log

    def __str__(self) -> str:
        floor = bare_import()
        processor = f"processor {self.cpu:.2f} s ({self.cpu / floor.cpu:.1f} bare imports)"
        return f"{self.wall:8.2f} s, {processor}, {self.memory:.0f} MB (floor {floor.memory + self.record:.0f} MB)"


MEASURE = """
import json, os, subprocess, sys, time
start = time.perf_counter()
process = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL)
_, status, usage = os.wait4(process.pid, 0)
wall, cpu = time.perf_counter() - start, usage.ru_utime + usage.ru_stime
print(json.dumps([status, wall, cpu, usage.ru_maxrss / 1024]))
"""
"""Starts a process from a small one: the memory of a process counts from its fork on, so not from this one."""


@cache
def bare_import() -> ProcessCost:
    """Cost of a process that imports the libraries and does nothing."""
    return process_cost(["-c", "import numpy, scipy.linalg, scipy.signal, casadi"])


def process_cost(arguments: list[str], runs: int = 3, **environment: str) -> ProcessCost:
    """Cost of a Python process; the least processor time of several runs. Python keeps the bytecode of modules, as by
    default."""
    environment = {"PYTHONDONTWRITEBYTECODE": "", **environment}
    command = [sys.executable, "-c", MEASURE, sys.executable, *arguments]

    def once() -> ProcessCost:
        measured = subprocess.run(command, capture_output=True, text=True, check=True, env=os.environ | environment)
        status, *cost = json.loads(measured.stdout)
        if status:
            raise SystemExit(f"python {' '.join(arguments)}: status {status}\n{measured.stderr}")
        return ProcessCost(*cost)

    return min((once() for _ in range(runs)), key=lambda cost: cost.cpu)


def everyday_log(duration: int, folder: str) -> tuple[str, float]:
    """A file with everyday driving of the nonlinear truck at 100 Hz, and its size in memory, MB; `duration` in s."""
    from fifthwheel.model.manoeuvres import course
    from fifthwheel.model.plant import Plant

    log = Path(folder) / f"{duration}.csv"
    drive = course("everyday", TRUCK, duration=float(duration), seed=0)
    record = Plant(TRUCK).drive(drive).record(seed=0)
    logs.write_record(record, log)
    return str(log), (1 + len(record.signals) + len(record.reference)) * record.time.nbytes / 1e6


def log_costs(log: str, *commands: str, **environment: str) -> Iterator[tuple[str, ProcessCost]]:
    """Costs of commands on a log, first without compiled steps and then with them."""
    with tempfile.TemporaryDirectory() as cache:
        environment |= {"FIFTHWHEEL_CACHE": cache}
        for command in commands:
            name = f"{command}, {Path(log).stem} s"
            arguments = ["-m", "fifthwheel", command, log, "-v", "cheng_cebon_2011", "-o", f"{log} {command}"]
            yield f"{name}, first compilation", process_cost(arguments, 1, **environment)
            yield name, process_cost(arguments, 2, **environment)


def command_costs() -> Iterator[tuple[str, ProcessCost]]:
    """Costs of processes of the command line."""
    yield "--help", process_cost(["-m", "fifthwheel", "--help"])
    with tempfile.TemporaryDirectory() as folder:
        for duration in (120, 600, 3600):
            log, size = everyday_log(duration, folder)
            for name, cost in log_costs(log, "identify", "states"):
                yield name, replace(cost, record=size)


def main() -> None:
    """Print the table."""
    print(f"{'million steps/s':40s} {'single':>8} {'batch':>8}")
    print(f"{'dual EKF, 4 states, 4 parameters':40s} {'{:8.2f} {:8.2f}'.format(*dual_speed())}")
    discretised, constant, others = kalman_speed()
    print(f"{'Kalman, 8 states, discretised':40s} {discretised[0]:8.2f} {discretised[1]:8.2f}")
    print(f"{'Kalman, 8 states, constant matrices':40s} {constant[0]:8.2f} {constant[1]:8.2f}")
    for name, speed in others.items():
        ratios = f"{discretised[0] / speed:.1f} and {constant[0] / speed:.1f} times as fast"
        print(f"{'  ' + name + ', constant matrices':40s} {speed:8.3f}          fifthwheel: {ratios}")
    estimators: dict[str, Callable[[Record], Observer | Learner]] = {
        "Observer.push, us": lambda record: Observer(TRUCK, record.signals),
        "Learner.push, five parameters, us": lambda record: Learner(TRUCK, record.signals, FIVE),
        "Learner.push, + sensor errors, bank, us": lambda record: Learner(TRUCK, record.signals, ERRORS),
        "Learner.push, by default, us": lambda record: Learner(TRUCK, record.signals),
    }
    for name, make in estimators.items():
        median, percentile_99 = push_time(make)
        print(f"{name:40s} median {median:.1f}, 99 % {percentile_99:.1f}")
    for name, seconds in one_stage_time().items():
        print(f"{'one stage, ' + name + ', s':40s} {seconds:8.2f}")
    unknowns, ratio = evaluation_ratio()
    print(f"{f'derivatives by {unknowns} unknowns, plain simulations':40s} {ratio:8.1f}")
    for name, settings in (("linear", OneStage(tyres="linear")), ("saturating", OneStage())):
        unknowns, plain, gradient = density_times(settings)
        print(f"{f'density, {name}, {unknowns} unknowns, ms':40s} {plain:8.2f}, with gradient {plain + gradient:.2f}")
    print(f"{'nonlinear truck, times real time':40s} {plant_speed():8.1f}")
    for name, cost in command_costs():
        print(f"{'fifthwheel ' + name:40s} {cost}")


if __name__ == "__main__":
    main()
