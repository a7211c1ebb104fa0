"""The result of an identification, with its display and its files."""

from typing import TYPE_CHECKING

from fifthwheel._lazy import lazy_names

if TYPE_CHECKING:
    from fifthwheel.identify.result.identification import Identification as Identification
    from fifthwheel.identify.result.parts import Estimate as Estimate
    from fifthwheel.identify.result.parts import Fit as Fit
    from fifthwheel.identify.result.parts import LogSummary as LogSummary
    from fifthwheel.identify.result.parts import SensorError as SensorError
    from fifthwheel.identify.result.posterior import Posterior as Posterior
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__)
