"""The description of a vehicle: units, axles, suspensions, couplings and payload, with a path to every number."""

from fifthwheel._callable import make_callable
from fifthwheel.vehicle import catalogue
from fifthwheel.vehicle.catalogue import get, names
from fifthwheel.vehicle.payload import Laden, laden, laden_cog_height, laden_roll_inertia
from fifthwheel.vehicle.quantities import unit_of
from fifthwheel.vehicle.roll_test import Measured, RollTest, with_roll_test
from fifthwheel.vehicle.uncertainty import Change, changes
from fifthwheel.vehicle.unit import Axle, AxleGroup, Coupling, Payload, SprungMass, Unit
from fifthwheel.vehicle.vehicle import Vehicle
from fifthwheel.vehicle.weighing import with_axle_loads

__all__ = [
    "Axle",
    "AxleGroup",
    "Change",
    "Coupling",
    "Laden",
    "Measured",
    "Payload",
    "RollTest",
    "SprungMass",
    "Unit",
    "Vehicle",
    "catalogue",
    "changes",
    "get",
    "laden",
    "laden_cog_height",
    "laden_roll_inertia",
    "names",
    "unit_of",
    "with_axle_loads",
    "with_roll_test",
]

make_callable(__name__, get)
