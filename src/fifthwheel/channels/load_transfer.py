"""Load transfer ratio of an axle group: the load of its right wheels less that of its left ones, divided by their sum.

No sensor measures it.
"""

from fifthwheel.channels.channel import Channel, Instant, SensorModel, Symbol

HORIZON = 0.2
"""s."""


def _predicted(now: Instant, i: int, name: str) -> Symbol:
    """The ratio after `HORIZON` at its present rate: the predictive load transfer ratio.

    C. Larish et al., A new predictive lateral load transfer ratio for rollover prevention systems, IEEE Transactions on
    Vehicular Technology 62, 2013.
    """
    ratio = now.load_transfer(name)
    return ratio + HORIZON * now.rate_of(ratio)


LOAD_TRANSFER = Channel(
    quantity="load_transfer",
    unit="1",
    of="part",
    model=SensorModel(value=lambda now, _, name: now.load_transfer(name), needs_roll=True),
)
PREDICTED_LOAD_TRANSFER = Channel(
    quantity="predicted_load_transfer",
    unit="1",
    of="part",
    model=SensorModel(value=_predicted, needs_roll=True),
)
