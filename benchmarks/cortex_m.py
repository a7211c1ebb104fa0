"""The exported observer on emulated control units: flash, memory, stack and instructions of each sample.

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

from tests.export.cortex_m import CORES, emulated


def main() -> None:
    truck = fw.vehicle("cheng_cebon_2011")
    record = fw.simulate(truck, count=1, seed=3).cut(0.0, 2.0)
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
                with tempfile.TemporaryDirectory() as folder:
                    found = emulated(observer, record, core, Path(folder), option)
                median, first = int(np.median(found.instructions[1:])), int(found.instructions[0])
                sizes = f"{found.flash / 1e3:.0f} | {found.memory} | {found.stack} | {median} | {first}"
                print(f"| {name} | {len(observer.model.states)} | {core} | {option} | {sizes} |", flush=True)


if __name__ == "__main__":
    main()
