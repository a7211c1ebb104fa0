"""Parameters and states of articulated heavy vehicles, from the sensors they have."""

import time

__version__ = "0.1.0"
imported_at = time.time()
"""Time at which the first module of the package was imported."""
