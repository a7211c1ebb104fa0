"""An exported estimator on an emulated Cortex-M: gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm."""

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import Observer
from fifthwheel.estimate.online import Learner
from fifthwheel.results.export import export_c
from fifthwheel.results.export.project import LEARNER_SOURCES, OBSERVER_SOURCES

GCC, SIZE, QEMU = "arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm"
MISSING = [tool for tool in (GCC, SIZE, QEMU) if shutil.which(tool) is None]
CORES = {
    "cortex-m4": ("fpv4-sp-d16", "mps2-an386"),
    "cortex-m7": ("fpv5-sp-d16", "mps2-an500"),
}
"""Floating-point unit and board of QEMU of each core."""
INSTRUCTIONS_PER_TICK = 40
"""QEMU with `-icount shift=0` takes 1 ns for an instruction; the boards' clock has 25 MHz."""


@dataclass(frozen=True, kw_only=True)
class Emulation:
    """What a core computed, and what it needed."""

    rows: np.ndarray  # [status, states, sigmas] of each sample
    flash: int
    """Bytes of code and constants of the library."""
    memory: int
    """Bytes of the estimator, and of the stack at its deepest by `-fstack-usage`."""
    stack: int
    instructions: np.ndarray
    """Of each push."""


CALLS = {
    "observer": ("fw_observer_push", "fw_start|fw_advance", "fw_matrices|fw_random_steer|fw_solve|fw_step"),
    "learner": (
        "fw_learner_push",
        "fw_advance",
        "fw_end_segment",
        "fw_finish_passes",
        "fw_joint_step",
        "fw_correct|fw_linearise|fw_predict_covariance",
        "fw_correct_state|fw_correct_estimates",
    ),
}
"""The deepest chain of calls; of several functions the one that needs most. An inlined function needs nothing."""


def emulated(
    estimator: Observer | Learner, record: Record, core: str, folder: Path, optimisation: str = "-O2"
) -> Emulation:
    """Replay a record in single precision on an emulated core."""
    unit, board = CORES[core]
    export_c(estimator, folder)
    kind = "learner" if isinstance(estimator, Learner) else "observer"
    signals = estimator.live.setup if isinstance(estimator, Learner) else estimator
    columns = [record.time, *[record.signals[name] for name in (*signals.inputs, *signals.outputs)]]
    table = np.column_stack(columns)
    rows = ",\n".join("{" + ", ".join(map(repr, row)) + "}" for row in table.tolist()).replace("nan", "(0.0 / 0.0)")
    text = f"#define ROWS {len(table)}\nstatic const double samples[ROWS][{table.shape[1]}] = {{\n{rows}}};\n"
    (folder / "log.h").write_text(text)
    names = [f"typedef fw_{kind} estimator;", *(f"#define estimator_{k} fw_{kind}_{k}" for k in ("init", "push"))]
    (folder / "estimator.h").write_text("\n".join([f'#include "fw_{kind}.h"', *names, ""]))
    here = Path(__file__).parent
    for name in ("startup.c", "main.c", "memory.ld"):
        shutil.copy(here / name, folder)
    target = [GCC, f"-mcpu={core}", "-mthumb", "-mfloat-abi=hard", f"-mfpu={unit}", "-DFW_FLOAT", optimisation]

    def run(*command: str) -> str:
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=900)
        assert done.returncode == 0, done.stderr[:2000]
        return done.stdout

    sources = LEARNER_SOURCES if kind == "learner" else OBSERVER_SOURCES
    objects = [name.replace(".c", ".o") for name in sources]
    run(*target, "-std=c99", "-fstack-usage", "-c", *sources)
    start = run(*target, "--specs=rdimon.specs", "--print-file-name=rdimon-crt0.o").strip()
    program = [*target, "-std=gnu99", "--specs=rdimon.specs", "-nostartfiles", "-T", "memory.ld", "startup.c", "main.c"]
    run(*program, *objects, start, "-lc", "-lrdimon", "-lm", "-o", "program.elf")
    machine = ["-M", board, "-cpu", core, "-nographic", "-icount", "shift=0", "-kernel", "program.elf"]
    output = run(QEMU, *machine, "-semihosting-config", "enable=on,target=native")
    values = np.array([[float(x) for x in line.split(",")] for line in output.splitlines() if line.count(",") > 2])
    memory = re.search(r"(\d+) bytes", output)
    assert memory
    usage = dict(re.findall(r":(\w+)[.\w]*\t(\d+)\t", "".join(path.read_text() for path in folder.glob("fw_*.su"))))
    return Emulation(
        rows=values[:, 1:],
        flash=sum(int(line.split()[0]) for line in run(SIZE, *objects).splitlines()[1:]),
        memory=int(memory[1]),
        stack=sum(max(int(usage.get(name, 0)) for name in names.split("|")) for names in CALLS[kind]),
        instructions=INSTRUCTIONS_PER_TICK * values[:, 0],
    )
