"""The nonlinear truck: a multibody model on MuJoCo, independent of `dynamics`, with its driver and sensors."""

from fifthwheel.plant.magic_formula import MagicFormula as MagicFormula
from fifthwheel.plant.powertrain import DrivenTruck as DrivenTruck
from fifthwheel.plant.properties import Properties as Properties
from fifthwheel.plant.sensors import Sensor as Sensor
from fifthwheel.plant.sensors import article_sensors as article_sensors
from fifthwheel.plant.sensors import bus_sensors as bus_sensors
from fifthwheel.plant.sensors import measure as measure
from fifthwheel.plant.sensors import read_sensors as read_sensors
from fifthwheel.plant.truck import Plant as Plant
from fifthwheel.plant.truck import PlantRun as PlantRun
