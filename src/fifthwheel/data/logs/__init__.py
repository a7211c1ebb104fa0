"""Log files: a record is read from a log by a signal map, and written as a log. Live samples take the same map.

Names are imported when they are first used: the process that reads a file needs none of them.
"""

from typing import TYPE_CHECKING

from fifthwheel.base.lazy import lazy_names

if TYPE_CHECKING:
    from fifthwheel.data.logs.files import read_log as read_log
    from fifthwheel.data.logs.files import write_record as write_record
    from fifthwheel.data.logs.live import LiveMap as LiveMap
    from fifthwheel.data.logs.readers.isolated import start_reader as start_reader
    from fifthwheel.data.logs.signal_map import SignalMap as SignalMap
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__)
