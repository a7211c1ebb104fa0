"""The description of a vehicle: units, axles, suspensions, couplings and payload, with a path to every number."""

from typing import TYPE_CHECKING

from fifthwheel.base.lazy import lazy_names
from fifthwheel.truck.catalogue import get as get

if TYPE_CHECKING:
    from fifthwheel.truck import catalogue as catalogue
    from fifthwheel.truck.catalogue import names as names
    from fifthwheel.truck.loads import Laden as Laden
    from fifthwheel.truck.loads import laden as laden
    from fifthwheel.truck.quantities import unit_of as unit_of
    from fifthwheel.truck.roll_test import Measured as Measured
    from fifthwheel.truck.roll_test import RollTest as RollTest
    from fifthwheel.truck.roll_test import with_roll_test as with_roll_test
    from fifthwheel.truck.uncertainty import Change as Change
    from fifthwheel.truck.uncertainty import changes as changes
    from fifthwheel.truck.unit import Axle as Axle
    from fifthwheel.truck.unit import AxleGroup as AxleGroup
    from fifthwheel.truck.unit import Coupling as Coupling
    from fifthwheel.truck.unit import Payload as Payload
    from fifthwheel.truck.unit import SprungMass as SprungMass
    from fifthwheel.truck.unit import Unit as Unit
    from fifthwheel.truck.vehicle import Vehicle as Vehicle
    from fifthwheel.truck.weighing import with_axle_loads as with_axle_loads
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__)
