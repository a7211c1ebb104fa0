"""Attributes that are computed when they are first used."""

import functools
from collections.abc import Callable
from contextlib import nullcontext
from typing import Any, TypeVar

T = TypeVar("T")


class lazy(functools.cached_property[T]):  # noqa: N801 (a decorator)
    """`functools.cached_property` without its lock, which only Python 3.11 has.

    A process that forks while a thread computes the attribute would otherwise inherit a lock that nobody releases. Two
    threads may compute the attribute at the same time; its function must not have other effects.
    """

    def __init__(self, function: Callable[[Any], T]) -> None:
        super().__init__(function)
        self.lock = nullcontext()
