"""The tyre law, fitted to tyres that others have published: their parameters, and how far the law is from them.

    python benchmarks/tyres.py FILE...

A file is a `.tir` of PAC2002 or MF-Tyre 5, of which the lateral coefficients are used without shifts and camber, or a
`.csv` of side forces in N, with loads in N in its first row and slip angles in degrees in its first column. The law is
`dynamics.tyres` for one tyre at a static load of 35 kN, or at the nominal load of a `.tir` if that is lower; its load
and its slip angle vary together over 0.2 to 1.9 times the static load and up to 12 degrees, as far as the file is
valid. Peak: the largest force up to 30 degrees at the static load, over that load.
"""

import re
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline
from scipy.optimize import least_squares

from fifthwheel.model.dynamics.tyres import NOMINAL_LOAD
from fifthwheel.model.plant.properties import MagicFormula
from trust_runs import table

Array = NDArray[np.float64]
SIDES = np.linspace(0.2, 1.9, 18)
"""Loads over the static load."""
SLIPS = np.radians(np.linspace(0.25, 12, 48))
STEEPEST = np.radians(np.linspace(0.25, 30, 120))
"""For the peak."""
HEADS = ("tyre", "static load, kN", "loads, kN", "C / N, 1/rad", "s", "peak", "shape c", "s_mu", "rms of peak force")


class Tyre:
    """Side forces of a file, N, (slip angles, loads), and where they are valid."""

    def __init__(self, path: Path) -> None:
        if path.suffix == ".csv":
            numbers = np.loadtxt(path, delimiter=",")
            loads, slips = numbers[0, 1:], np.radians(np.append(0.0, numbers[1:, 0]))
            forces = np.vstack([np.zeros_like(loads), numbers[1:, 1:]])
            spline = RectBivariateSpline(slips, loads, forces, kx=3, ky=2)
            self.force = lambda slip, load: np.asarray(spline(slip, load))
            self.loads, self.steepest, self.static_load = (loads.min(), loads.max()), slips.max(), NOMINAL_LOAD
            return
        found = re.findall(r"^(\w+)\s*=\s*([-+\d.eE]+)", path.read_text(encoding="latin-1"), re.MULTILINE)
        given = {name: float(value) for name, value in found}
        names = ("FNOMIN", "PCY1", "PDY1", "PDY2", "PEY1", "PEY2", "PKY1", "PKY2")
        sign = np.sign(given["PDY1"])
        magic = MagicFormula(**{n: given[n] * (sign if n.startswith("PDY") else 1) for n in names})
        self.force = lambda slip, load: np.array(
            [[float(magic.side_force(a, n)) for n in load] for a in np.tan(slip)]  # of CasADi: one number at a time
        )
        self.loads, self.steepest = (given["FZMIN"], given["FZMAX"]), given["ALPMAX"]
        self.static_load = min(given["FNOMIN"], NOMINAL_LOAD)

    def row(self) -> list[str]:
        """The cells of the table but the first."""
        N = self.static_load
        loads = N * SIDES[(self.loads[0] <= N * SIDES) & (self.loads[1] >= N * SIDES)]
        slips = SLIPS[self.steepest >= SLIPS]
        measured = self.force(slips, loads)
        peak = self.force(STEEPEST[self.steepest >= STEEPEST], np.array([N])).max() / N

        def misfit(x: Array) -> Array:
            return ((side_force(x, slips, loads, N) - measured) / measured.max()).ravel()

        best = least_squares(misfit, [6.0, 0.2, 0.8, 0.1])
        C, s, asymptote, s_mu = best.x
        at_35 = asymptote / (1 + s_mu * (1 - N / NOMINAL_LOAD))  # c mu_0, the asymptote at 35 kN
        valid = f"{loads.min() / 1e3:.0f} to {loads.max() / 1e3:.0f}"
        values = (f"{C:.2f}", f"{s:.2f}", f"{peak:.2f}", f"{asymptote / peak:.2f}", f"{s_mu * asymptote / at_35:.2f}")
        return [f"{N / 1e3:.1f}", valid, *values, f"{100 * np.sqrt(np.mean(best.fun**2)):.1f} %"]


def side_force(x: Array, slip: Array, load: Array, static_load: float) -> Array:
    """The law of one tyre, N: stiffness over the static load, s, c mu_0 at the static load, s_mu."""
    C, s, asymptote, s_mu = x
    n, q = load / static_load, static_load / NOMINAL_LOAD
    k, mu = 1 - s * q**2 * (n - 1), asymptote * (1 - s_mu * q * (n - 1))
    angle = slip[:, None]
    return np.asarray(C * static_load * angle * n * k / np.sqrt(1 + (C * angle * k / mu) ** 2))


if __name__ == "__main__":
    paths = [Path(name) for name in sys.argv[1:]]
    print("\n".join(table(HEADS, [[path.stem, *Tyre(path).row()] for path in paths])))
