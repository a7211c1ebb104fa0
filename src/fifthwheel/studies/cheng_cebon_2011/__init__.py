"""The article reproduced: every published number beside the estimates of this package, and its Figures 4 to 9."""

from fifthwheel.studies.cheng_cebon_2011.reproduce import Reproduction, reproduce

__all__ = ["Reproduction", "reproduce"]
