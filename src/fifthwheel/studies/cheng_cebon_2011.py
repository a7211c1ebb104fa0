"""The former place of `fifthwheel.cheng_cebon_2011`."""

from fifthwheel._moved import moved

__getattr__ = moved(
    __name__,
    {
        "Reproduction": "fifthwheel.cheng_cebon_2011.reproduce.Reproduction",
        "reproduce": "fifthwheel.cheng_cebon_2011.reproduce.reproduce",
    },
)
