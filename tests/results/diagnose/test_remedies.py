"""A remedy in words."""

import pytest

from fifthwheel.estimate.identify.design import Remedy
from fifthwheel.results.diagnose.information_summary import describe_remedy


@pytest.mark.parametrize(
    ("known", "text"),
    [
        (("semitrailer.cog",), "if semitrailer.cog is measured and fixed (given)"),
        (("mass_scale",), "if all masses are known exactly (state it in the vehicle file)"),
        (
            ("semitrailer.payload.mass",),
            "if the payload mass of the semitrailer is known exactly (state it in the vehicle file)",
        ),
        (
            ("tractor.coupling", "mass_scale"),
            "if the position of the coupling on the tractor and all masses are known exactly (state it in the vehicle "
            "file)",
        ),
        (
            ("tractor.axle_positions", "steer.tractor.front.gain"),
            "if the axle positions of the tractor are known exactly (state it in the vehicle file) and the gain of "
            "steer.tractor.front is calibrated",
        ),
        (("time_base",), 'if the rate of the time base is checked (given={"time_base": "exact"})'),
        (("steer.tractor.front.play",), "if the play of steer.tractor.front is measured"),
    ],
)
def test_what_is_known_is_said_in_words(known, text):
    assert describe_remedy(Remedy(known=known)) == text
