"""The truck for the drawings of the page: lengths in m, on each unit with x forward from its own origin."""

from typing import Any

from fifthwheel.plots.palette import CYCLE
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.drawing import FLOOR, FRAME, OVERHANG, TRACK, WHEEL_RADIUS, WHEEL_WIDTH


def geometry(vehicle: Vehicle) -> dict[str, Any]:
    """Units from front to rear, for JSON."""
    units = []
    for k, unit in enumerate(vehicle.units):
        ahead = vehicle.couplings[k - 1].trailing_position if k else None
        behind = vehicle.couplings[k].leading_position if k < len(vehicle.couplings) else None
        ends = [axle.position for axle in unit.axles] + [x for x in (ahead, behind) if x is not None]
        payload = unit.payload
        units.append(
            {
                "name": unit.name,
                "colour": CYCLE[k % 3],
                "rear": min(ends) - OVERHANG,
                "front": max(ends) + OVERHANG,
                "width": payload.width if payload else TRACK + WHEEL_WIDTH,
                "cog": unit.cog,
                "ahead": ahead,
                "behind": behind,
                "axles": [
                    {"x": axle.position, "steer": f"steer.{unit.name}.{axle.name}" if axle.steerable else ""}
                    for axle in unit.axles
                ],
                "roll_axis": unit.roll_axis_height,
                "frame": FRAME,
                "floor": payload.floor_height if payload else max(FLOOR, 2 * unit.sprung.cog_height - FRAME),
                "load": payload.height if payload else 0.0,
            }
        )
    return {
        "name": vehicle.name,
        "units": units,
        "track": TRACK,
        "wheel": {"radius": WHEEL_RADIUS, "width": WHEEL_WIDTH},
    }
