"""A dictionary that does not change."""

from typing import Any, NoReturn, TypeVar

V = TypeVar("V")


class ReadOnlyDict(dict[str, V]):
    """A dictionary that refuses changes.

    It is a `dict` and not a `MappingProxyType`, because pandas reads any other mapping as a list of its keys:
    `pandas.DataFrame(record.signals)` would be one column of names.
    """

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("read-only; make a new record, for example by record.with_signals")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return ReadOnlyDict, (dict(self),)
