"""A drawing to scale."""

import numpy as np
import pytest

from fifthwheel.base.plots import Area, Line, Points
from fifthwheel.truck import get


def test_axles_couplings_and_cog_are_at_their_places():
    truck = get("cheng_cebon_2011")
    (coupling,) = truck.couplings
    trailer_origin = coupling.leading_position - coupling.trailing_position
    side, top = truck.plot().panels
    assert side.equal
    assert top.equal
    wheels = [item for item in side.items if isinstance(item, Area) and len(item.x) > 4]
    expected = [axle.position for axle in truck.units[0].axles]
    expected += [trailer_origin + axle.position for axle in truck.units[1].axles]
    assert [(item.x.min() + item.x.max()) / 2 for item in wheels] == pytest.approx(expected)
    assert all(item.y.min() == pytest.approx(0, abs=1e-12) for item in wheels)
    (joint,) = [item for item in side.items if isinstance(item, Points) and item.name == "coupling"]
    assert (joint.x[0], joint.y[0]) == (coupling.leading_position, coupling.height)
    heights = [item.y[0] for item in side.items if isinstance(item, Points) and item.name.startswith("CoG")]
    assert heights == pytest.approx([value for path, value in truck.derived().items() if path.endswith("cog_height")])
    (payload,) = [item for item in side.items if isinstance(item, Area) and item.name == "payload"]
    assert np.ptp(payload.y) == pytest.approx(truck.parameters()["semitrailer.payload.height"])


def test_a_dolly_has_a_drawbar():
    """Its frame is above its axles, and does not reach the eye; every unit has its own colour."""
    truck = get("a_double")
    truck.plot().to_plotly()
    truck.plot().to_matplotlib()
    (side, top), eye = truck.plot().panels, truck.couplings[0].leading_position + truck.couplings[1].leading_position
    frames = {item.name: item for panel in (side,) for item in panel.items if isinstance(item, Area) and item.name}
    assert frames["dolly"].x.max() < eye - 2
    assert len({frames[unit.name].colour for unit in truck.units}) == 4
    drawbar = [item for item in (*side.items, *top.items) if isinstance(item, Line) and eye in np.round(item.x, 9)]
    assert len(drawbar) == 3
