"""The nonlinear truck: a multibody model on MuJoCo, independent of `dynamics`, with its driver and sensors."""

from fifthwheel.model.plant.powertrain import DrivenTruck as DrivenTruck
from fifthwheel.model.plant.properties import MagicFormula as MagicFormula
from fifthwheel.model.plant.properties import Properties as Properties
from fifthwheel.model.plant.sensors import Sensor as Sensor
from fifthwheel.model.plant.sensors import article_sensors as article_sensors
from fifthwheel.model.plant.sensors import bus_sensors as bus_sensors
from fifthwheel.model.plant.sensors import measure as measure
from fifthwheel.model.plant.sensors import read_sensors as read_sensors
from fifthwheel.model.plant.truck import Plant as Plant
from fifthwheel.model.plant.truck import PlantRun as PlantRun
