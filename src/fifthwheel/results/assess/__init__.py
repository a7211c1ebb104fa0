"""What a truck does: performance-based measures with sigma.

A family of measures is a function of a `Truck`, one module each. `propagation` evaluates the families at the truck and
around it, and gives each measure its sigma.
"""

from fifthwheel.results.assess.assessment import Assessment, MeasureResult, Threshold, assess
from fifthwheel.results.assess.measures import MEASURES, Limit, Measure
from fifthwheel.results.assess.truck import Body

__all__ = ["MEASURES", "Assessment", "Body", "Limit", "Measure", "MeasureResult", "Threshold", "assess"]
