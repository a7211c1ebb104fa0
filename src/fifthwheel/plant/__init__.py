"""The nonlinear truck: a multibody model on MuJoCo, independent of `dynamics`, with its driver and sensors."""

from fifthwheel.plant.magic_formula import MagicFormula
from fifthwheel.plant.powertrain import DrivenTruck
from fifthwheel.plant.properties import Properties
from fifthwheel.plant.sensors import Sensor, article_sensors, bus_sensors, measure, read_sensors
from fifthwheel.plant.truck import Plant, PlantRun

__all__ = [
    "DrivenTruck",
    "MagicFormula",
    "Plant",
    "PlantRun",
    "Properties",
    "Sensor",
    "article_sensors",
    "bus_sensors",
    "measure",
    "read_sensors",
]
