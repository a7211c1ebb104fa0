"""Memory that is free again, back to the operating system."""

import ctypes
import functools
from collections.abc import Callable


def release_memory() -> None:
    """Give the freed memory of this process back, where its C library keeps it.

    That of glibc keeps the holes that freed arrays below 32 MB leave. A large array does not fit into one, so that the
    holes of a long record would add to it.
    """
    _trim()(0)


@functools.cache
def _trim() -> Callable[[int], object]:
    """The function of glibc; other libraries have none."""
    try:
        return ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return lambda _: None
