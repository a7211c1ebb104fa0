"""Numbers in the payloads of many frames at once, or of one frame."""

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Bits:
    """Position of a number in a payload, as in a DBC: bit k is bit k % 8 of byte k // 8."""

    start: int
    """Its lowest bit; its highest bit when it is big endian."""
    length: int
    """1 to 64."""
    little: bool = True
    signed: bool = False
    floating: bool = False
    """IEEE 754 of 16, 32 or 64 bits."""

    @property
    def span(self) -> tuple[int, int]:
        """First byte, and the byte after the last."""
        first = self.start >> 3
        if self.little:
            return first, (self.start + self.length - 1 >> 3) + 1
        return first, (8 * first + 7 - (self.start & 7) + self.length - 1 >> 3) + 1

    def present(self, length: NDArray[np.int32]) -> NDArray[np.bool_]:
        """(n,) whether payloads of these lengths contain it."""
        return length >= self.span[1]

    def raw(self, data: NDArray[np.uint8]) -> NDArray[np.uint64] | NDArray[np.int64] | NDArray[np.floating]:
        """(n,) numbers in payloads (n, width): unsigned, signed or floating; zeros where the width is too small."""
        first, end = self.span
        if end > data.shape[1]:
            return np.zeros(len(data), np.uint64)
        if self.little:
            order, shift = range(first, end), self.start & 7
        else:
            order, shift = range(end - 1, first - 1, -1), -(8 * first + 7 - (self.start & 7) + self.length) % 8
        number = np.zeros(len(data), np.uint64)
        for k, byte in enumerate(order):
            part = data[:, byte].astype(np.uint64)
            number |= part >> np.uint64(shift) if k == 0 else part << np.uint64(8 * k - shift)
        if self.length < 64:
            number &= np.uint64((1 << self.length) - 1)
        if self.floating:
            return number.astype(f"u{self.length // 8}").view(f"f{self.length // 8}")
        if self.signed:
            sign = np.uint64(1 << (self.length - 1))
            return ((number ^ sign) - sign).view(np.int64)
        return number

    def number(self, payload: bytes) -> int | float:
        """The number in one payload that contains it, equal to that of `raw`."""
        first, end = self.span
        if self.little:
            number = int.from_bytes(payload[first:end], "little") >> (self.start & 7)
        else:
            number = int.from_bytes(payload[first:end], "big") >> -(8 * first + 7 - (self.start & 7) + self.length) % 8
        number &= (1 << self.length) - 1
        if self.floating:
            code = {2: "e", 4: "f", 8: "d"}[size := self.length // 8]
            value: float = struct.unpack(f"<{code}", number.to_bytes(size, "little"))[0]
            return value
        if self.signed:
            sign = 1 << (self.length - 1)
            return (number ^ sign) - sign
        return number
