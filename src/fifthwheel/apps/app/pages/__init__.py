"""The pages of the workbench, each filled by a function of the workspace."""

from collections.abc import Callable, Mapping

from fifthwheel.apps.app.pages import compare, explore, identify, log, signals, truck
from fifthwheel.apps.app.workspace import Workspace

BUILDERS: Mapping[str, Callable[[Workspace], None]] = {
    "log": log.build,
    "signals": signals.build,
    "truck": truck.build,
    "check": identify.build_check,
    "identify": identify.build,
    "explore": explore.build,
    "compare": compare.build,
    "history": compare.build_history,
}
