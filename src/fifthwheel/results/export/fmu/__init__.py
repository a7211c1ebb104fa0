"""Functional mock-up units (FMI 2.0 and 3.0, co-simulation) of an observer and of the linear truck.

models   the observer and the linear truck as models of an FMU, their variables in C
archive  the file: description, sources and libraries
"""

from fifthwheel.results.export.fmu.archive import PLATFORMS, export_fmu

__all__ = ["PLATFORMS", "export_fmu"]
