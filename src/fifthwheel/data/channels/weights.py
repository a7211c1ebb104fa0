"""Weights that scales on board measure, as forces: a column in kg converts to them. The masses follow from them."""

from fifthwheel.data.channels.channel import Channel, NamePattern, SignalLimits

AXLE_LOAD = Channel(
    quantity="axle_load",
    unit="N",
    of="part",
    patterns=(NamePattern(pattern="axle_(weight|load)|achslast|powered_vehicle_weight"),),
    proposed="signal",
    limit=SignalLimits(magnitude=5e5, jump=1e5, may_be_constant=True),
    scale=0.02,
)
"""Of an axle group; without a part, of all axles of the unit. TRL report RR103: of three commercial systems none is
always within 2 %."""
WEIGHT = Channel(
    quantity="weight",
    unit="N",
    patterns=(NamePattern(pattern="trailer_weight|anhaenger_?gewicht"),),
    proposed="signal",
    limit=SignalLimits(magnitude=1e6, jump=1e5, may_be_constant=True),
    scale=0.02,
)
"""Of a unit with its load, on axles and coupling."""
GROSS_WEIGHT = Channel(
    quantity="gross_weight",
    unit="N",
    of="vehicle",
    patterns=(NamePattern(pattern="gross_(combination_)?(vehicle_)?weight|gesamt_?gewicht"),),
    proposed="signal",
    limit=SignalLimits(magnitude=5e6, jump=1e6, may_be_constant=True),
    scale=0.05,
)
"""Of the whole vehicle. Many control units compute it from driving; that is within 5 % (Vahidi et al. 2005)."""
WEIGHTS = (AXLE_LOAD, WEIGHT, GROSS_WEIGHT)
"""Those from which masses follow."""
