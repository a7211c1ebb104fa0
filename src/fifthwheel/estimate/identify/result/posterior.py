"""The posterior of an identification in SI: a joint normal distribution, of positive parameters by their logarithm."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np

from fifthwheel.base.arguments import expect_known, expect_names, expect_number
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.lazy import require
from fifthwheel.base.names import split_log
from fifthwheel.base.types import Array, ComparedByContents
from fifthwheel.data.channels import is_sensor_error
from fifthwheel.estimate.observe.uncertainty import Uncertainty, displaced, positive_parameters

if TYPE_CHECKING:
    import pandas as pd


def normal_quantile(level: float) -> float:
    """Half the width of the central interval of N(0, 1) with a probability; a FifthwheelError outside of 0 to 1."""
    if not 0 < level < 1:
        raise FifthwheelError(f"level: expected a probability between 0 and 1, got {level}; write 0.95 for 95 %")
    return NormalDist().inv_cdf((1 + level) / 2)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Posterior(ComparedByContents):
    """The joint posterior of the parameters of a vehicle, of its tyres, and of the errors of its sensors.

    It is the Laplace approximation: normal about the maximum of the posterior density, with a covariance that allows
    for model error. The estimator works with the logarithms of positive parameters, and so do `interval` and `sample`:
    no sample of them is negative, and their mean here is their median there. Only the payload height has a normal
    prior in metres; with a large sigma, its logarithm is an approximation. Bounds of the estimator are not applied.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> settings = fw.OneStage(given={"*": "exact", "tractor.front.cornering_stiffness": "free"}, tyres="linear")
        >>> posterior = fw.identify([fw.simulate(truck, count=1)], truck, settings).posterior
        >>> front = posterior.among(["tractor.front.cornering_stiffness"])
        >>> front.sample(1000, seed=0).shape
        (1000, 1)
        >>> front.to_pandas().columns.tolist()
        ['mean', 'sigma', 'lower', 'upper', 'unit']
    """

    uncertainty: Uncertainty
    """Names and covariance."""
    mean: Array
    """(k,) the estimates, SI."""
    units: tuple[str, ...]
    """(k,) SI units."""

    @property
    def names(self) -> tuple[str, ...]:
        """(k,) paths of parameters, and sensor errors; those of one log are "<name>@<log>"."""
        return self.uncertainty.names

    @property
    def covariance(self) -> Array:
        """(k, k), SI."""
        return self.uncertainty.covariance

    @property
    def sigma(self) -> Array:
        """Standard deviations (k,), SI."""
        return np.sqrt(np.diag(self.covariance))

    def correlation(self) -> Array:
        """Correlation matrix (k, k)."""
        return np.asarray(self.covariance / np.outer(self.sigma, self.sigma))

    def among(self, names: Sequence[str]) -> "Posterior":
        """The marginal posterior of some of the names; a SignalError for a name that it does not have."""
        expect_names("names", names)
        expect_known("names", names, self.names)
        kept = [i for i, name in enumerate(self.names) if name in names]
        units = tuple(self.units[i] for i in kept)
        return Posterior(uncertainty=self.uncertainty.among(names), mean=self.mean[kept], units=units)

    def interval(self, level: float = 0.95) -> Array:
        """Lower and upper ends (k, 2) of the central credible interval of each, SI.

        Raises:
            FifthwheelError: the level is not between 0 and 1.
        """
        half_width = normal_quantile(level) * self.sigma
        return self._displaced(np.array([-half_width, half_width])).T

    def sample(self, n: int, seed: int | np.random.Generator | None = None) -> Array:
        """Random draws (n, k), SI; the same for the same seed. A SignalError for another n than 0, 1, 2, ..."""
        expect_number("n", n, ge=0, whole=True)
        S = self.uncertainty.columns()
        return self._displaced(np.random.default_rng(seed).normal(size=(n, S.shape[1])) @ S.T)

    def to_pandas(self, level: float = 0.95) -> "pd.DataFrame":
        """Mean, sigma and interval in SI, and unit, by name.

        Raises:
            FifthwheelError: pandas is not installed, or the level is not between 0 and 1.
        """
        pandas = require("pandas", "pandas")
        lower, upper = self.interval(level).T
        columns = {"mean": self.mean, "sigma": self.sigma, "lower": lower, "upper": upper, "unit": self.units}
        frame: pd.DataFrame = pandas.DataFrame(columns, index=pandas.Index(self.names, name="parameter"))
        return frame

    def to_xarray(self) -> Any:
        """A Dataset of xarray with `mean` (parameter), `unit` (parameter) and `covariance` (parameter, parameter_2).

        Raises:
            FifthwheelError: xarray is not installed.
        """
        names, rows = list(self.names), "parameter"
        return require("xarray", "xarray").Dataset(
            {
                "mean": (rows, self.mean),
                "unit": (rows, list(self.units)),
                "covariance": ((rows, "parameter_2"), self.covariance),
            },
            {rows: names, "parameter_2": names},
        )

    def _displaced(self, deviations: Array) -> Array:
        """The mean plus deviations (..., k), SI."""
        values = zip(self.names, self.mean.tolist(), strict=True)
        of_model = {name: v for name, v in values if split_log(name)[1] is None and not is_sensor_error(name)}
        return displaced(self.names, self.mean, deviations, positive_parameters(of_model))

    def __repr__(self) -> str:
        return f"Posterior({len(self.names)} names: {', '.join(self.names[:3])}{', ...' * (len(self.names) > 3)})"
