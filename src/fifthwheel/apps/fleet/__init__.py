"""Many trucks, many trips, many machines: identify every trip of a manifest, combine them, follow changes.

>>> import fifthwheel as fw
>>> fw.fleet.FleetSettings(tyre_walk=0.01).false_alarms
0.05
"""

from fifthwheel.apps.fleet.attention import Attention
from fifthwheel.apps.fleet.manifest import Trip, read_manifest
from fifthwheel.apps.fleet.report import report
from fifthwheel.apps.fleet.run import FleetRun, run
from fifthwheel.base.options import FleetSettings

__all__ = ["Attention", "FleetRun", "FleetSettings", "Trip", "read_manifest", "report", "run"]
