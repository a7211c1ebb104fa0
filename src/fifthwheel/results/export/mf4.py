"""States as an ASAM MDF file, by asammdf."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

from asammdf import MDF, Signal

from fifthwheel.data.channels import si_unit
from fifthwheel.estimate.observe import States, Status


def write_mf4(states: Sequence[States], path: Path) -> None:
    """Write states as MDF 4.1, a channel group of each record: states in SI, each with "<state>.sigma", status, nis."""
    names: dict[str, Any] = {f"val_{k}": int(status) for k, status in enumerate(Status)}
    names |= {f"text_{k}": status.name for k, status in enumerate(Status)}
    with MDF(version="4.10") as mdf:
        for record in states:
            channels = [Signal(record.status, record.time, name="status", conversion=names)]
            channels.append(Signal(record.nis, record.time, name="nis"))
            for name, values in record.values.items():
                for ending, samples in (("", values), (".sigma", record.sigma[name])):
                    channels.append(Signal(samples, record.time, name=name + ending, unit=si_unit(name) or ""))
            mdf.append(channels, acq_name=record.name, common_timebase=True)
        content = BytesIO()  # it would change the ending of a temporary file
        mdf.save(content, compression=2)
    path.write_bytes(content.getvalue())
