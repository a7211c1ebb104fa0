"""Temporary files of this process, removed also when a signal ends the process at once."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

_pending: list[Callable[[], None]] = []


@contextmanager
def cleaned_up(action: Callable[[], None]) -> Iterator[None]:
    """Call `action` when the block ends, or when `clean_up` is called within it; it must be harmless to repeat."""
    _pending.append(action)
    try:
        yield
    finally:
        try:
            action()
        finally:
            _pending.remove(action)


def clean_up() -> None:
    """Remove the temporary files of all blocks, innermost first; for a process that exits within them."""
    for action in reversed(_pending):
        with suppress(Exception):
            action()
