"""Frames with known values, and files of every format that hold them."""

import warnings
from dataclasses import dataclass
from pathlib import Path

import can
import numpy as np

from fifthwheel.data.logs.readers.can import read_frames

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


@dataclass
class Found:
    """All frames of a file, and all notes."""

    time: np.ndarray
    id: np.ndarray
    extended: np.ndarray
    bus: np.ndarray
    payloads: list[bytes]
    notes: list[str]

    def __len__(self) -> int:
        return self.time.size


def read(path: Path) -> Found:
    notes: list[str] = []
    batches = [frames for frames, _ in read_frames(path, notes)]
    arrays = [
        np.concatenate([np.empty(0), *(getattr(frames, name) for frames in batches)])
        for name in ("time", "id", "extended", "bus")
    ]
    payloads = [bytes(row[:size]) for frames in batches for row, size in zip(frames.data, frames.length, strict=True)]
    return Found(*arrays, payloads, notes)


def vdc2(yaw_rate: float, lateral: float = 0.0) -> bytes:
    """Payload of VDC2, PGN 61449."""
    yaw, side = round((yaw_rate + 3.92) * 8192), round((lateral + 15.687) * 2048)
    return b"\x4f\x7d\x60" + yaw.to_bytes(2, "little") + side.to_bytes(2, "little") + b"\x7d"
