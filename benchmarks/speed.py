"""Speed, as figures of one run on one core, beside the peers on the same problem.

    python benchmarks/speed.py            # needs the test extra: statsmodels and filterpy

* dual EKF step: 4 states, 4 parameters, 2 channels, exact derivatives;
* 8-state Kalman step: the yaw-roll model, its discretisation recomputed at every step, 4 channels;
* both alone and in a batch of vehicles (several to a vector register);
* statsmodels and filterpy: the same 8-state filter with its matrices given, not recomputed;
* Observer.push and Learner.push: one sample at a time, from a dict to a dict;
* identification in one stage: 120 s at 100 Hz, by what is unknown;
* the nonlinear truck at 1 ms: seconds driven by seconds taken;
* the command line: `fifthwheel identify` on 120 s at 100 Hz, 15 lane changes, as a whole process with the
  compiled steps on disk and without; `fifthwheel --help`.

Every figure is the best of several runs; ratios are what to look at.
"""

import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from fifthwheel import dynamics, logs, vehicle
from fifthwheel.filters import Noise, dual, kalman, sample_rows
from fifthwheel.filters.model import pack_array
from fifthwheel.identify import OneStage, identify
from fifthwheel.identify.parameters import stage_1_names
from fifthwheel.identify.recursive import Learner
from fifthwheel.logs import Record
from fifthwheel.native import Scan
from fifthwheel.observe import Observer
from fifthwheel.observe.prepare import steered_as_logged
from fifthwheel.simulate import simulate

SAMPLES, VEHICLES = 20_000, 64
LAGGING = vehicle.get("cheng_cebon_2011")
FIVE = OneStage(priors={}, consider={}, nuisances=False)
ERRORS = OneStage(priors={}, consider={})
TRUCK = LAGGING.replace({f"{path}.relaxation_length": 0.0 for path in LAGGING.axle_loads()})  # 4 and 8 states


def best(work: Callable[[], object], runs: int = 5) -> float:
    """Seconds."""
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def rows(model: dynamics.ChainModel) -> np.ndarray:
    """Samples of a weave at 88 km/h with noise."""
    time_step = np.full(SAMPLES, 0.01)
    steer = 0.01 * np.sin(np.arange(SAMPLES) * 0.025)
    speed = np.full(SAMPLES, 24.4)
    y = np.random.default_rng(0).normal(size=(SAMPLES, len(model.outputs))) * 4e-3
    return sample_rows(time_step, np.column_stack([speed, steer, speed, steer]), y)


def steps_per_second(scan: Scan, carry: np.ndarray, sample: np.ndarray, constant: np.ndarray) -> tuple[float, float]:
    """Millions of steps a second, alone and in a batch; the arrays are laid out beforehand."""
    alone = SAMPLES / best(lambda: scan(carry, sample, constant))
    carries, constants = (np.repeat(a[None], VEHICLES, axis=0) for a in (carry, constant))
    part = sample[:2000]
    laid = [scan._to_lanes(a) for a in (carries, np.broadcast_to(part, (VEHICLES, *part.shape)), constants)]
    groups = len(laid[0])
    output = np.empty((groups, len(part), scan.n_output, scan.lanes))
    addresses = [a.ctypes.data for a in (*laid, output)]
    seconds = best(lambda: scan.vector(len(part), groups, *addresses))
    return alone / 1e6, VEHICLES * len(part) / seconds / 1e6


def dual_figures() -> tuple[float, float]:
    truck = steered_as_logged(TRUCK, simulate(TRUCK, count=1))
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
    return steps_per_second(dual.step(model, scaling.logarithmic), start.vector(), rows(model), constant)


@dataclass(frozen=True, eq=False)
class Given:
    """A linear model whose matrices are given, as the peers have theirs."""

    transition: ca.Function
    observation: ca.Function
    state_jacobian: ca.Function

    @classmethod
    def of(cls, n: int, m: int) -> "Given":
        """n states, m channels; c = [transition matrix, design], no inputs."""
        x, dt, d, p, c = (
            ca.SX.sym(name, size) for name, size in zip("xtdpc", (n, 1, 0, 0, n * n + m * n), strict=True)
        )
        F, H = ca.reshape(c[: n * n], n, n), ca.reshape(c[n * n :], m, n)
        return cls(
            ca.Function("f", [x, dt, d, p, c], [F @ x]),
            ca.Function("h", [x, d, p, c], [H @ x]),
            ca.Function("F", [x, dt, d, p, c], [F]),
        )


def kalman_figures() -> tuple[tuple[float, float], tuple[float, float], dict[str, float]]:
    """Ours with its discretisation recomputed, ours with matrices given, the peers; million steps a second."""
    truck = steered_as_logged(TRUCK, simulate(TRUCK, count=1))
    outputs = ("roll_rate.tractor", "roll_rate.semitrailer", "yaw_rate.tractor", "yaw_rate.semitrailer")
    model = dynamics.model(truck, outputs, roll=True)
    c = model.known_values(dynamics.all_parameters(truck, outputs))
    noise = Noise(process=np.eye(8) * 1e-6, measurement=np.array([4.52e-4, 4.70e-5, 1.52e-5, 1.11e-5]))
    carry = np.concatenate([np.zeros(8), pack_array(np.eye(8) * 1e-4)])
    sample = rows(model)
    own = steps_per_second(kalman.step(model), carry, sample, np.concatenate([c, noise.vector()]))
    x, d = ca.SX.sym("x", 8), ca.SX.sym("d", 4)
    forward = model.transition(x, 0.01, d, ca.SX(0, 1), c)
    F = np.array(ca.Function("F", [x, d], [ca.jacobian(forward, x)])(np.zeros(8), sample[0, 1:5]))
    H = np.eye(8)[[model.states.index(name) for name in outputs]]
    y = sample[:, 5:9]
    given = Given.of(8, 4)
    matrices = np.concatenate([F.ravel(order="F"), H.ravel(order="F")])
    plain = sample_rows(sample[:, 0], np.empty((SAMPLES, 0)), y)
    same = steps_per_second(kalman.step(given), carry, plain, np.concatenate([matrices, noise.vector()]))
    return own, same, {"statsmodels": _statsmodels(F, H, noise, y), "filterpy": _filterpy(F, H, noise, y[:2000])}


def _statsmodels(F: np.ndarray, H: np.ndarray, noise: Noise, y: np.ndarray) -> float:
    from statsmodels.tsa.statespace.kalman_filter import KalmanFilter

    peer = KalmanFilter(k_endog=4, k_states=8, k_posdef=8)
    peer.bind(np.asfortranarray(y.T))
    peer["design"], peer["transition"], peer["selection"] = H, F, np.eye(8)
    peer["obs_cov"], peer["state_cov"] = np.diag(noise.measurement), noise.process * 0.01
    peer.initialize_known(np.zeros(8), np.eye(8) * 1e-4)
    peer.tolerance = 0  # no shortcut once the gain is steady: ours has none, its speed may change
    return len(y) / best(peer.filter, 3) / 1e6


def _filterpy(F: np.ndarray, H: np.ndarray, noise: Noise, y: np.ndarray) -> float:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from filterpy.kalman import KalmanFilter

    peer = KalmanFilter(dim_x=8, dim_z=4)
    peer.F, peer.H, peer.R, peer.Q = F, H, np.diag(noise.measurement), noise.process * 0.01

    def run() -> None:
        for sample in y:
            peer.predict()
            peer.update(sample)

    return len(y) / best(run, 3) / 1e6


def push_figures(live: Callable[[Record], Observer | Learner]) -> tuple[float, float]:
    """Median and 99th percentile of a push, microseconds."""
    record = simulate(LAGGING, count=5)
    observer = live(record)
    columns = {"time": record.time.tolist()} | {name: values.tolist() for name, values in record.signals.items()}
    samples = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    times = []
    for sample in samples:
        start = time.perf_counter_ns()
        observer.push(sample)
        times.append(time.perf_counter_ns() - start)
    median, high = np.percentile(times[50:], [50, 99]) / 1e3
    return float(median), float(high)


def one_stage_figures() -> dict[str, float]:
    """Seconds of an identification of 120 s at 100 Hz, steps compiled, by what is unknown."""
    record, values = simulate(LAGGING, count=15, seed=1), LAGGING.parameters()
    names = stage_1_names(LAGGING)
    guess = LAGGING.replace({n: values[n] * f for n, f in zip(names, (0.8, 1.2, 0.8, 1.2), strict=True)})
    cases = {
        "five parameters": FIVE,
        "and steering, gyros, bank": ERRORS,
        "and what is known roughly": OneStage(),
    }
    return {name: best(lambda s=s: identify([record], guess, s), 3) for name, s in cases.items()}


def plant_figure() -> float:
    """How many times faster than the drive itself the nonlinear truck is."""
    from fifthwheel.plant import Plant, course

    plant, lanes = Plant(TRUCK), course("lane_changes", TRUCK, count=2)
    return lanes.duration / best(lambda: plant.drive(lanes), runs=3)


def command_figures() -> dict[str, float]:
    """Seconds of whole processes."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "drive.csv"
        logs.write(simulate(TRUCK, count=15), log)
        command = [sys.executable, "-m", "fifthwheel"]
        job = [*command, "identify", str(log), "-v", "cheng_cebon_2011", "-o", folder]

        def run(arguments: list[str], **environment: str) -> None:
            subprocess.run(arguments, check=True, capture_output=True, env=os.environ | environment)

        cache = str(Path(folder) / "cache")
        run(job, FIFTHWHEEL_CACHE=cache)
        return {
            "identify": best(lambda: run(job, FIFTHWHEEL_CACHE=cache), 3),
            "identify, nothing compiled yet": best(lambda: run(job, FIFTHWHEEL_CACHE=""), 3),
            "--help": best(lambda: run([*command, "--help"])),
        }


def main() -> None:
    """Print the table."""
    print(f"{'million steps/s':36s} {'alone':>8} {'batch':>8}")
    print(f"{'dual EKF, 4 states, 4 parameters':36s} {'{:8.2f} {:8.2f}'.format(*dual_figures())}")
    own, given, peers = kalman_figures()
    print(f"{'Kalman, 8 states, discretised anew':36s} {own[0]:8.2f} {own[1]:8.2f}")
    print(f"{'Kalman, 8 states, matrices given':36s} {given[0]:8.2f} {given[1]:8.2f}")
    for name, peer in peers.items():
        ratios = f"{own[0] / peer:.1f} and {given[0] / peer:.1f} times as fast"
        print(f"{'  ' + name + ', matrices given':36s} {peer:8.3f}          ours: {ratios}")
    pushed: dict[str, Callable[[Record], Observer | Learner]] = {
        "Observer.push, us": lambda record: Observer(LAGGING, record.signals),
        "Learner.push, five parameters, us": lambda record: Learner(LAGGING, record.signals, FIVE),
        "Learner.push, and sensors, bank, us": lambda record: Learner(LAGGING, record.signals, ERRORS),
        "Learner.push, by default, us": lambda record: Learner(LAGGING, record.signals),
    }
    for name, live in pushed.items():
        median, high = push_figures(live)
        print(f"{name:36s} median {median:.1f}, 99 % {high:.1f}")
    for name, seconds in one_stage_figures().items():
        print(f"{'one stage, ' + name + ', s':36s} {seconds:8.2f}")
    print(f"{'nonlinear truck, times real time':36s} {plant_figure():8.1f}")
    for name, seconds in command_figures().items():
        print(f"{'fifthwheel ' + name + ', s':36s} {seconds:8.2f}")


if __name__ == "__main__":
    main()
