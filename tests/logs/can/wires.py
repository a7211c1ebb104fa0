"""Frames with known values, and files of every format that hold them."""

import warnings
from pathlib import Path

import can
import numpy as np

from fifthwheel.errors import SignalError
from fifthwheel.logs.can.frames import Frames, no_frames, read_frames

FORMATS = ("asc", "blf", "log", "trc")


def message(time: float, number: int, data: bytes, *, extended: bool = True, bus: int = 0, **more: bool) -> can.Message:
    return can.Message(
        timestamp=time,
        arbitration_id=number,
        data=None if more.get("is_remote_frame") else data,
        dlc=len(data),
        is_extended_id=extended,
        channel=bus,
        check=True,
        **more,
    )


def write(path: Path, messages: list[can.Message]) -> Path:
    """A file in the format of its ending, as python-can writes it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with can.Logger(path) as writer:
            for one in messages:
                writer.on_message_received(one)
    return path


def read(path: Path) -> Frames:
    """All frames of a file, and all notes."""
    batches = [frames for frames, _ in read_frames(path)]
    return joined(batches)


def read_or_refuse(path: Path) -> Frames | None:
    """All frames; None where the file is refused with its name."""
    try:
        return read(path)
    except SignalError as error:
        if path.name not in str(error):
            raise
        return None


def joined(batches: list[Frames]) -> Frames:
    width = max((frames.data.shape[1] for frames in batches), default=8)
    parts = [no_frames(), *batches]
    return Frames(
        time=np.concatenate([frames.time for frames in parts]),
        id=np.concatenate([frames.id for frames in parts]),
        extended=np.concatenate([frames.extended for frames in parts]),
        bus=np.concatenate([frames.bus for frames in parts]),
        data=np.concatenate([np.pad(frames.data, ((0, 0), (0, width - frames.data.shape[1]))) for frames in parts]),
        length=np.concatenate([frames.length for frames in parts]),
        notes=tuple(note for frames in parts for note in frames.notes),
    )


def payloads(frames: Frames) -> list[bytes]:
    return [bytes(row[:size]) for row, size in zip(frames.data, frames.length, strict=True)]


def vdc2(yaw_rate: float, lateral: float = 0.0) -> bytes:
    """Payload of VDC2, PGN 61449."""
    yaw, side = round((yaw_rate + 3.92) * 8192), round((lateral + 15.687) * 2048)
    return b"\x4f\x7d\x60" + yaw.to_bytes(2, "little") + side.to_bytes(2, "little") + b"\x7d"
