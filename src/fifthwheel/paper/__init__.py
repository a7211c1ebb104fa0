"""The article, reproduced: every published number beside ours, and its Figures 4 to 9."""

from fifthwheel.paper.reproduce import Reproduction, reproduce

__all__ = ["Reproduction", "reproduce"]
