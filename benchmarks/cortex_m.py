"""The exported observer and learner on emulated control units: flash, memory, stack and instructions of each sample.

    python benchmarks/cortex_m.py

Needs gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm, Debian packages. QEMU counts instructions, not
clock cycles. The first sample starts the filter and takes longer.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import fifthwheel as fw

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.results.export.cortex_m import CORES, Emulation, emulated


def main() -> None:
    truck = fw.vehicle("cheng_cebon_2011")
    record = fw.simulate(truck, count=1, seed=3).cut(0.0, 4.0)
    print_observers(truck, record.cut(0.0, 2.0))
    print_learners(truck, record)


def print_observers(truck: fw.Vehicle, record: fw.Record) -> None:
    """A row for each observer, core and option of the compiler."""
    rigid = truck.replace({f"{path}.relaxation_length": 0.0 for path in truck.axle_loads()})
    yaw = [name for name in record.signals if not name.startswith("roll_rate")]
    observers = {
        "yaw": fw.Observer(rigid, yaw),
        "yaw and roll": fw.Observer(rigid, record.signals),
        "yaw, roll and relaxation lengths": fw.Observer(truck, record.signals),
    }
    sizes = "flash, KB | observer, bytes | stack, bytes | instructions a sample | of the first"
    print(f"| observer | states | core | option | {sizes} |\n" + "|---" * 9 + "|")
    for name, observer in observers.items():
        for core in CORES:
            for option in ("-Os", "-O2"):
                found = run(observer, record, core, option)
                median, first = int(np.median(found.instructions[1:])), int(found.instructions[0])
                sizes = f"{found.flash / 1e3:.0f} | {found.memory} | {found.stack} | {median} | {first}"
                print(f"| {name} | {len(observer.model.states)} | {core} | {option} | {sizes} |", flush=True)


def print_learners(truck: fw.Vehicle, record: fw.Record) -> None:
    """A row for each learner. With -O2 the compiler needs minutes."""
    five = fw.OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear")
    learners = {
        "five parameters": fw.Learner(truck, record.signals, five),
        "default": fw.Learner(truck, record.signals),
    }
    sizes = "flash, KB | learner, KB | stack, KB | instructions a sample | with a second step | of the first"
    print(f"| learner | estimated | considered | {sizes} |\n" + "|---" * 9 + "|")
    for name, learner in learners.items():
        found, layout = run(learner, record, "cortex-m7", "-Os"), learner.live.filter.layout
        usual, most = np.percentile(found.instructions[1:], [50, 100])
        sizes = (
            f"{found.flash / 1e3:.0f} | {found.memory / 1e3:.0f} | {found.stack / 1e3:.1f} | {usual:.0f} | {most:.0f}"
        )
        print(f"| {name} | {layout.n_z} | {layout.n_c} | {sizes} | {found.instructions[0]:.0f} |", flush=True)


def run(estimator: fw.Observer | fw.Learner, record: fw.Record, core: str, option: str) -> Emulation:
    """An estimator on a core."""
    with tempfile.TemporaryDirectory() as folder:
        return emulated(estimator, record, core, Path(folder), option)


if __name__ == "__main__":
    main()
