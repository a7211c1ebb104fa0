"""The profile of a posterior density along one unknown, beside its normal approximation."""

from dataclasses import dataclass

import numpy as np

from fifthwheel.base.formatting import shown
from fifthwheel.base.plots import Axis, Guide, Item, Line, Panel, Plot
from fifthwheel.base.plots.items import BLUE, GREY
from fifthwheel.base.types import Array
from fifthwheel.estimate.identify.result.posterior import normal_quantile


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """The density of the posterior at n values of one unknown, maximised over all others.

    Where the density is normal, its logarithm is the parabola `normal`. Another shape shows that sigma alone does not
    describe what the logs say (W. Q. Meeker and L. A. Escobar, Teaching about approximate confidence regions based on
    maximum likelihood estimation, The American Statistician 1995).

    Example:
        >>> import numpy as np
        >>> import fifthwheel as fw
        >>> s = np.linspace(-3, 3, 7)
        >>> log = -(s**2) / 2
        >>> profile = fw.Profile(
        ...     name="road.friction", unit="1", values=0.7 + 0.1 * s, log_density=log, normal=log, best=0.7
        ... )
        >>> profile.interval(0.95).round(2)
        array([0.5, 0.9])
    """

    name: str
    unit: str
    """SI unit of the values; empty for a change of several numbers."""
    values: Array
    """(n,) increasing, SI."""
    log_density: Array
    """(n,) logarithm of the density less that at the maximum; -inf where the vehicle is unstable."""
    normal: Array
    """(n,) the same of the normal approximation, in the coordinates of the estimator."""
    best: float
    """Value at the maximum, SI."""

    def interval(self, level: float = 0.95) -> Array:
        """Lower and upper end (2,) of the interval by the likelihood ratio, SI; infinite where the profile does not
        reach it.

        Raises:
            FifthwheelError: the level is not between 0 and 1.
        """
        quantile, root = normal_quantile(level), np.sqrt(np.maximum(-2 * self.log_density, 0.0))  # about linear
        ends = []
        for sign, side in ((-1, self.values < self.best), (1, self.values > self.best)):
            rows = np.flatnonzero(side & np.isfinite(root))[::sign]
            reached, values = np.append(0.0, root[rows]), np.append(self.best, self.values[rows])
            ends.append(np.interp(quantile, reached, values, right=sign * np.inf))
        return np.array(ends)

    def plot(self) -> Plot:
        """Both densities relative to their maximum, over the values."""
        unit = shown(self.unit)
        values, best = self.values * unit.factor, self.best * unit.factor
        items: list[Item] = [
            Line(values, np.exp(self.normal), name="normal approximation", colour=GREY, dash="dash"),
            Line(values, np.exp(self.log_density), name="profile", colour=BLUE),
            Guide(x=best, text="maximum"),
        ]
        x = Axis(label=self.name, unit=unit.name)
        return Plot(title=f"Posterior of {self.name}", panels=[Panel(items=items, x=x, y=Axis(label="density"))])
