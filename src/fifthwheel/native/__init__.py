"""Compilation of a symbolic step to machine code that processes a record; independent of vehicles."""

from fifthwheel.native.adjoint import AdjointScan
from fifthwheel.native.directions import DirectionScan
from fifthwheel.native.scan import Scan, compile_in_background
from fifthwheel.native.step import compiled

__all__ = ["AdjointScan", "DirectionScan", "Scan", "compile_in_background", "compiled"]
