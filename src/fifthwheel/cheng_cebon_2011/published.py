"""Every number that the article publishes as a result.

C. Cheng, D. Cebon, "Parameter and state estimation for articulated heavy vehicles", Vehicle System Dynamics 49 (2011)
399-418. Cornering stiffness is positive here, as everywhere in this package.
"""

from dataclasses import dataclass

FRONT = "tractor.front.cornering_stiffness"
DRIVE = "tractor.drive.cornering_stiffness"
TRAILER = "semitrailer.cornering_stiffness"
YAW_INERTIA = "semitrailer.yaw_inertia"
PAYLOAD_HEIGHT = "semitrailer.payload.height"
COG_HEIGHT = "semitrailer.cog_height"
ROLL_INERTIA = "semitrailer.roll_inertia"


@dataclass(frozen=True)
class Published:
    """One published number."""

    case: str
    """The experiment of the article: "simulation", "point payload" or "test vehicle"."""
    place: str
    """Section of the article."""
    quantity: str
    """Parameter or derived quantity."""
    value: float
    """SI."""
    reference: float | None = None
    """The article's reference value, SI."""
    error: float | None = None
    """The error that the article states, as a fraction of its reference."""


RESULTS = (
    Published("simulation", "3.2", FRONT, 4.77e5),
    Published("simulation", "3.2", DRIVE, 8.98e5),
    Published("simulation", "3.2", TRAILER, 1.30e6),
    Published("simulation", "3.2", YAW_INERTIA, 4.24e5, 4.24e5 / 1.025, 0.025),
    Published("simulation", "3.3", PAYLOAD_HEIGHT, 1.237, 1.23, 0.006),
    Published("simulation", "3.3", COG_HEIGHT, 1.602, 1.60, 0.001),
    Published("simulation", "3.3", ROLL_INERTIA, 4.35e4, 4.35e4 / 1.004, 0.004),
    Published("point payload", "3.3", PAYLOAD_HEIGHT, 1.084, 1.23, -0.119),
    Published("point payload", "3.3", COG_HEIGHT, 1.553, 1.60, -0.029),
    Published("point payload", "3.3", ROLL_INERTIA, 3.99e4, 33308, 0.20),
    Published("test vehicle", "4.2", DRIVE, 1.12e6),
    Published("test vehicle", "4.2", TRAILER, 1.66e6),
    Published("test vehicle", "4.2", YAW_INERTIA, 3.59e5, 3.80e5, -0.06),
    Published("test vehicle", "4.3", PAYLOAD_HEIGHT, 1.257, 1.145, 0.098),
    Published("test vehicle", "4.3", COG_HEIGHT, 1.609),
    Published("test vehicle", "4.3", ROLL_INERTIA, 4.40e4),
)
