"""Every threshold of the messages, with its meaning; those of doubts are in `estimate.identify.doubts`."""

from fifthwheel.data.checks import Fault

# Signals

REPAIRED = (Fault.SPIKE, Fault.DROPOUT, Fault.ZERO_SPEED, Fault.UNUSED, Fault.OFFSET)
"""Faults, if they are warnings, that an identification repairs, tolerates or estimates."""

# Estimates

WIDE_SIGMA = 0.15
"""An estimate whose sigma is a larger fraction of its value is called uncertain, although it converged."""
NOTABLE_SIGMA = 0.05
"""From this relative sigma on, the largest term of a parameter's variance is worth a measurement."""
DOMINANT_FRACTION = 0.5
"""A term with a larger fraction of a variance dominates it; so do the two largest terms together."""
LARGE_FRACTION = 0.1
"""Each of them has a larger fraction."""
LISTED_FRACTION = 0.1
"""A term with a larger fraction of a variance is listed in the variance budget."""
NOTABLE_CORRELATION = 0.5
"""From this magnitude on, the largest correlation of an estimate is listed."""
AUTOCORRELATION_EFFECT = 1.5
"""A sigma that is so many times the value from sensor noise alone is dominated by autocorrelated residuals."""
USEFUL_REDUCTION = 0.9
"""A change is listed if it brings sigma below this fraction of its present value."""
SIGNIFICANT = 3.0
"""A delay, or a difference from the vehicle file, of so many sigmas is significant."""

# Sensor errors

UNUSUAL_ERROR = 2.5
"""A sensor error so many prior standard deviations from its prior mean is marked; beyond `UNUSUAL_SENSOR_ERROR` it is a
doubt."""
UNUSUAL_GAIN = 0.1
"""A steer gain so far from 1, and by twice its sigma, is unusual: the steering ratio can be measured."""
NEGLIGIBLE_DELAY = 0.02
"""s; a shorter delay has little effect on the estimates."""

# Predicted channels

POOR_FIT = 0.9
"""A channel with a smaller explained fraction, although its noise would allow more, is predicted poorly."""
NOISE_LIMIT = 1.25
"""A residual up to so many times the sensor noise is limited by noise."""
EXCITED_CHANNEL = 0.5
"""A larger explained fraction of any channel shows that the truck turns in this log."""
UNRELATED_CHANNEL = 0.05
"""A channel with a smaller explained fraction, in a log in which the truck turns, is unrelated to its motion."""
HIDING_NOISE = 3.0
"""Noise of so many times the predicted motion hides it: less than 10 % of the channel can be explained."""
REJECTED_SAMPLES = 0.05
"""A larger fraction of rejected samples in an identification calls for a caution."""

# Runs

MIN_SPEED = 5.0
"""m/s; the linear tyre model does not hold below. Settings of an identification replace it."""

# States

RELIABLE = 0.95
"""With a larger fraction of samples that have all inputs and measurements, the states are reliable."""
USABLE = 0.5
"""With a smaller fraction of such samples, the log should be cut or completed."""
REJECTED_INNOVATIONS = 0.02
"""A larger fraction of rejected samples in a state filter calls for a caution."""
LARGE_INNOVATION, SMALL_INNOVATION = 1.5, 0.6
"""Rms of normalised innovations above which the bands of a filter are too narrow, and below which they are too wide."""
LIFTED = 0.95
"""Load transfer ratio of an axle group from which one of its wheels has lifted."""

# Whiteness

MIN_SAMPLES = 30
"""With fewer samples there is no test."""
MAX_LAG = 2.0
"""s; the longest lag of an autocorrelation."""
MAX_LAGS = 300
"""The largest number of lags of an autocorrelation."""
RELEVANT_CORRELATION = 0.2
"""A smaller autocorrelation has no practical effect, however significant it is."""
SEGMENTS = 24
"""A log is divided into up to so many segments of `MIN_SAMPLES` samples or more."""
OUTLIER = 3.0
"""A residual of so many of its standard deviations is an outlier."""
NORMAL_OUTLIERS = 0.0027
"""Fraction of a normal distribution beyond `OUTLIER` standard deviations."""
MANY_OUTLIERS = 4.0
"""Outliers are mentioned when they are so many times as frequent as in a normal distribution."""
