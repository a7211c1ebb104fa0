"""Compilation of a symbolic step to machine code that processes a record; independent of vehicles."""

from fifthwheel.base.native.directions import AdjointScan, DirectionScan, GradientScan
from fifthwheel.base.native.scan import Scan, compile_in_background, share_cores, threads
from fifthwheel.base.native.step import compiled

__all__ = [
    "AdjointScan",
    "DirectionScan",
    "GradientScan",
    "Scan",
    "compile_in_background",
    "compiled",
    "share_cores",
    "threads",
]
