"""Numbers in the payload of many frames at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Bits:
    """Where a number lies in a payload, as a DBC says it: bit k is bit k % 8 of byte k // 8."""

    start: int
    """Its lowest bit; or, big endian, its highest."""
    length: int
    """1 to 64."""
    little: bool = True
    signed: bool = False
    floating: bool = False
    """IEEE 754 of 16, 32 or 64 bits."""

    @property
    def span(self) -> tuple[int, int]:
        """First byte, and the byte behind the last."""
        first = self.start >> 3
        if self.little:
            return first, (self.start + self.length - 1 >> 3) + 1
        return first, (8 * first + 7 - (self.start & 7) + self.length - 1 >> 3) + 1

    def there(self, length: NDArray[np.int32]) -> NDArray[np.bool_]:
        """(n,) whether payloads of these lengths hold it."""
        return length >= self.span[1]

    def raw(self, data: NDArray[np.uint8]) -> NDArray[np.uint64] | NDArray[np.int64] | NDArray[np.floating]:
        """(n,) numbers in payloads (n, width): unsigned, signed or floating; zeros where the width does not hold it."""
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
