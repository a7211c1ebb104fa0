"""A sample of a large file: parts that are spread evenly over it."""

PARTS = 8
_LARGE = 100e6
"""Bytes of a file from which on it is sampled, if the caller wants a sample."""
_PART = 3e6
"""Bytes of a part, at least."""
_SAMPLED = 0.08
"""Fraction of a file that its parts hold, at least; checks of a record with less refuse it as mostly gaps."""


def is_large(size: int) -> bool:
    """Whether a file of this size, bytes, is sampled."""
    return size > _LARGE


def part_size(size: int) -> int:
    """Bytes of each part of a file of this size, bytes."""
    return int(max(_PART, _SAMPLED * size / PARTS))


def parts_of(count: int, size: int) -> list[tuple[int, int]]:
    """First of each part, and the one after its last, of `count` samples of a file of this size, bytes."""
    length = min(count, max(1, round(count * part_size(size) / size)))
    starts = [k * (count - length) // (PARTS - 1) for k in range(PARTS)]
    parts: list[tuple[int, int]] = []
    for start in starts:  # those of few samples overlap
        first = max(start, parts[-1][1]) if parts else start
        parts += [(first, start + length)] if start + length > first else []
    return parts


def sample_note(size: int) -> str:
    """Note on a sample of a file of this size, bytes."""
    read = f"a sample of {PARTS * part_size(size) / 1e6:.0f} of {size / 1e6:.0f} MB was read"
    return f"{read}, in {PARTS} parts of the file: ranges, missing samples and findings are those of the sample"
