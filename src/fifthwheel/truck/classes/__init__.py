"""Vehicle classes: values and standard deviations for the numbers that a vehicle file does not have."""

from fifthwheel.truck.classes.completion import complete
from fifthwheel.truck.classes.table import CLASSES, VehicleClass

__all__ = ["CLASSES", "VehicleClass", "complete"]
