"""Functional mock-up units (FMI 2.0 and 3.0, co-simulation) of an observer and of the linear truck.

variables    variables of an FMU and their table in C
observer     the observer as the model of an FMU
truck        the linear truck as the model of an FMU
description  the XML files
binaries     libraries for Linux and Windows
archive      the file
"""

from fifthwheel.results.export.fmu.archive import export_fmu
from fifthwheel.results.export.fmu.binaries import PLATFORMS

__all__ = ["PLATFORMS", "export_fmu"]
