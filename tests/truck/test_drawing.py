"""A drawing to scale."""

import numpy as np
import pytest

from fifthwheel.base.plots import Area, Points
from fifthwheel.truck import get


def test_axles_couplings_and_cog_are_at_their_places():
    get("a_double").plot().to_plotly()
    get("a_double").plot().to_matplotlib()
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
