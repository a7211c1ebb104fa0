"""The description of a vehicle: units, axles, suspensions, couplings and payload, with a path to every number."""

from typing import TYPE_CHECKING

from fifthwheel._callable import make_callable
from fifthwheel._lazy import lazy_names
from fifthwheel.vehicle.catalogue import get as get

if TYPE_CHECKING:
    from fifthwheel.vehicle import catalogue as catalogue
    from fifthwheel.vehicle.catalogue import names as names
    from fifthwheel.vehicle.payload import Laden as Laden
    from fifthwheel.vehicle.payload import laden as laden
    from fifthwheel.vehicle.quantities import unit_of as unit_of
    from fifthwheel.vehicle.roll_test import Measured as Measured
    from fifthwheel.vehicle.roll_test import RollTest as RollTest
    from fifthwheel.vehicle.roll_test import with_roll_test as with_roll_test
    from fifthwheel.vehicle.uncertainty import Change as Change
    from fifthwheel.vehicle.uncertainty import changes as changes
    from fifthwheel.vehicle.unit import Axle as Axle
    from fifthwheel.vehicle.unit import AxleGroup as AxleGroup
    from fifthwheel.vehicle.unit import Coupling as Coupling
    from fifthwheel.vehicle.unit import Payload as Payload
    from fifthwheel.vehicle.unit import SprungMass as SprungMass
    from fifthwheel.vehicle.unit import Unit as Unit
    from fifthwheel.vehicle.vehicle import Vehicle as Vehicle
    from fifthwheel.vehicle.weighing import with_axle_loads as with_axle_loads
else:
    __getattr__, __dir__, __all__ = lazy_names(__name__, "catalogue")

make_callable(__name__, get)
