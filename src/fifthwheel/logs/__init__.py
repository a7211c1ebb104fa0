"""Log files: a record is read from a log by a signal map, and written as a log. Live samples take the same map.

Names are imported when they are first used: the process that reads a file needs none of them.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fifthwheel.logs.files import read_log, write_record
    from fifthwheel.logs.live import LiveMap
    from fifthwheel.logs.readers.isolated import start_reader
    from fifthwheel.logs.signal_map import SignalMap

_MODULES = {
    "LiveMap": "live",
    "SignalMap": "signal_map",
    "read_log": "files",
    "start_reader": "readers.isolated",
    "write_record": "files",
}

__all__ = ["LiveMap", "SignalMap", "read_log", "start_reader", "write_record"]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    return value
