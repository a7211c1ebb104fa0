"""Parameters and states of articulated heavy vehicles, from the sensors they have."""

__version__ = "0.1.0"
