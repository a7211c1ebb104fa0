"""Log files: a record is read from a log by a signal map, and written as a log. Live samples take the same map."""

from fifthwheel.logs.files import read_log, write_record
from fifthwheel.logs.live import LiveMap
from fifthwheel.logs.signal_map import SignalMap

__all__ = ["LiveMap", "SignalMap", "read_log", "write_record"]
