"""Shares of axle groups in the braking force, which a vehicle file does not have."""

from collections.abc import Mapping

from fifthwheel.base.errors import VehicleError


def require_shares(brakes: Mapping[str, float]) -> None:
    """Raise VehicleError unless all shares are 0 or more, and one is above 0; no brakes at all are permitted."""
    if brakes and not (min(brakes.values()) >= 0 and 0 < sum(brakes.values()) < 1e6):
        raise VehicleError(f"brakes: expected fractions of 0 or more, one above 0, got {dict(brakes)}; correct them")
