"""The model that one stage fits to the logs."""

from collections.abc import Sequence

from fifthwheel import dynamics
from fifthwheel.dynamics import ChainModel
from fifthwheel.identify.settings import OneStage
from fifthwheel.vehicle import Vehicle


def fit_model(vehicle: Vehicle, outputs: Sequence[str], settings: OneStage) -> ChainModel:
    """The extended yaw-roll model with every parameter free; with tyres that saturate, it brakes.

    Args:
        vehicle: gives the structure.
        outputs: measured signals.
        settings: law of the tyres, and whether the bank of the road is a state.
    """
    tyres = settings.tyre_law
    return dynamics.model(
        vehicle,
        outputs,
        roll=True,
        bank=settings.nuisances,
        free=tuple(dynamics.all_parameters(vehicle, outputs, extended=True, tyres=tyres)),
        extended=True,
        tyres=tyres,
        braking=tyres == "saturating",
    )
