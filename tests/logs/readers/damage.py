"""Damaged files, and what a reader has to make of them: samples, or an error of ours that names the file."""

import random
import struct
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from fifthwheel.errors import SignalError
from fifthwheel.logs.log import Log

_SIZES = (b"\xff" * 8, bytes(8), bytes(5) + b"\x7f\0\0", bytes(3) + b"\x7f" + bytes(4), struct.pack("<Q", 64))


def damaged(whole: bytes, rng: random.Random) -> Iterator[bytes]:
    """Cut at many places; with flipped bits; with bytes that announce absurd sizes."""
    for k in range(20):
        yield whole[: len(whole) * k // 20]
    for _ in range(50):
        data = bytearray(whole)
        for _ in range(rng.choice([1, 1, 4])):
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        yield bytes(data)
    for k in range(30):
        data = bytearray(whole)
        at = rng.randrange(len(data) - 8) if k % 2 else rng.randrange(len(data) // 8) * 8
        data[at : at + 8] = rng.choice(_SIZES)
        yield bytes(data)


def pieces_of_damaged(open_log: Callable[[Path], Log], wholes: Iterable[bytes], folder: Path) -> int:
    """How many pieces were read from damaged copies of some files; nothing but a SignalError may come instead."""
    rng = random.Random(4)
    pieces = 0
    for k, whole in enumerate(wholes):
        for n, data in enumerate(damaged(whole, rng)):
            path = folder / f"damaged{k}_{n}"  # HDF5 remembers files by name
            path.write_bytes(data)
            try:
                with open_log(path) as log:
                    pieces += sum(piece.time is not None for piece in log.pieces(log.columns))
            except SignalError as error:
                assert path.name in str(error)  # noqa: PT017
            path.unlink()
    return pieces
