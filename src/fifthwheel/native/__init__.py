"""From a symbolic step to machine code that scans a record; knows CasADi functions and nothing of vehicles."""

from fifthwheel.native.scan import Scan, compile_soon

__all__ = ["Scan", "compile_soon"]
