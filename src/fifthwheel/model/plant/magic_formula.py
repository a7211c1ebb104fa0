"""The tyre model: lateral and longitudinal force by the Magic Formula with load dependence, and relaxation lengths.

PAC2002 as in H. B. Pacejka, "Tyre and Vehicle Dynamics" (2006), chapter 4, without shifts, camber and turn slip: the
shifts of the left and the right tyre cancel, and the camber of a beam axle is small. Combined slip uses the cosine
weighting functions without their shifts. The functions take floats, arrays and CasADi symbols.
"""

from dataclasses import dataclass
from typing import Any

import casadi as ca


@dataclass(frozen=True, kw_only=True)
class MagicFormula:
    """Coefficients of one tyre, named as in PAC2002.

    The defaults are those of a 315/80 R 22.5 from CityBus_Pac02Tire.tir of Project Chrono, copyright (c) 2016 Project
    Chrono Development Team, BSD-3-Clause; the notice is in LICENSE.chrono beside this file.
    """

    FNOMIN: float = 35000.0  # N
    R0: float = 0.548  # m, unloaded
    VERTICAL_STIFFNESS: float = 1e6  # N/m
    BREFF: float = 3.5
    DREFF: float = 0.5
    FREFF: float = -0.005
    PCY1: float = 1.5874
    PDY1: float = 0.73957
    PDY2: float = -0.075004
    PEY1: float = 0.37562
    PEY2: float = -0.069325
    PKY1: float = -10.289
    PKY2: float = 3.3343
    PTY1: float = 1.2
    PTY2: float = 2.5
    RBY1: float = 13.271
    RBY2: float = 5.2405
    RCY1: float = 1.01
    PCX1: float = 1.7204
    PDX1: float = 0.77751
    PDX2: float = -0.24431
    PEX1: float = 0.46659
    PEX2: float = 0.393
    PEX3: float = 0.076024
    PKX1: float = 14.848
    PKX2: float = -9.8161
    PKX3: float = 0.15818
    PTX1: float = 1.5
    PTX2: float = 1.4
    PTX3: float = 1.0
    RBX1: float = 11.13
    RBX2: float = -12.494
    RCX1: float = 0.97505
    QDZ1: float = 0.085549
    QDZ2: float = -0.025298
    QBZ1: float = 5.8978
    QBZ2: float = -0.1535
    QBZ3: float = -2.0052
    QCZ1: float = 1.4982

    def cornering_stiffness(self, load: Any) -> Any:
        """Slope of side force over slip angle at zero slip, N/rad, at a vertical load, N.

        K_ya of PAC2002 with the opposite sign, so positive. sin(2 atan(x)) is written as 2 x / (1 + x^2).
        """
        x = load / (self.PKY2 * self.FNOMIN)
        return -self.PKY1 * self.FNOMIN * 2 * x / (1 + x * x)

    def rolling_radius(self, load: Any) -> Any:
        """Effective rolling radius, m, at a vertical load, N."""
        x = load / self.FNOMIN
        deflection = self.FNOMIN / self.VERTICAL_STIFFNESS
        return self.R0 - deflection * (self.DREFF * ca.atan(self.BREFF * x) + self.FREFF * x)

    def relaxation_length(self, load: Any) -> Any:
        """Relaxation length of the side force (sigma_alpha), m, at a vertical load, N."""
        x = load / (self.PTY2 * self.FNOMIN)
        return self.PTY1 * self.R0 * 2 * x / (1 + x * x)

    def longitudinal_relaxation_length(self, load: Any) -> Any:
        """Relaxation length of the longitudinal force (sigma_kappa), m, at a vertical load, N."""
        df = load / self.FNOMIN - 1
        return load / self.FNOMIN * (self.PTX1 + self.PTX2 * df) * ca.exp(-self.PTX3 * df) * self.R0

    def side_force(
        self, slip: Any, load: Any, *, longitudinal: Any = 0.0, stiffness: Any = 1.0, friction: Any = 1.0
    ) -> Any:
        """Side force, N, at the tangent of the slip angle, positive for a positive one, and a vertical load above 0, N,
        with a longitudinal slip kappa and factors on cornering stiffness and friction.
        """
        df = load / self.FNOMIN - 1
        D = (self.PDY1 + self.PDY2 * df) * friction * load
        E = self.PEY1 + self.PEY2 * df
        B = stiffness * self.cornering_stiffness(load) / (self.PCY1 * D)
        x = B * slip
        pure = D * ca.sin(self.PCY1 * ca.atan(x - E * (x - ca.atan(x))))
        weight = self.RBY1 * ca.cos(ca.atan(self.RBY2 * slip)) * longitudinal
        return pure * ca.cos(self.RCY1 * ca.atan(weight))

    def longitudinal_force(self, slip: Any, load: Any, *, lateral: Any = 0.0, friction: Any = 1.0) -> Any:
        """Longitudinal force, N, at the longitudinal slip kappa, positive when driving, and a vertical load above 0, N,
        with the tangent of the slip angle and a factor on the friction.
        """
        df = load / self.FNOMIN - 1
        D = (self.PDX1 + self.PDX2 * df) * friction * load
        E = self.PEX1 + self.PEX2 * df + self.PEX3 * df * df
        K = load * (self.PKX1 + self.PKX2 * df) * ca.exp(self.PKX3 * df)
        x = K / (self.PCX1 * D) * slip
        pure = D * ca.sin(self.PCX1 * ca.atan(x - E * (x - ca.atan(x))))
        weight = self.RBX1 * ca.cos(ca.atan(self.RBX2 * slip)) * lateral
        return pure * ca.cos(self.RCX1 * ca.atan(weight))

    def pneumatic_trail(self, slip: Any, load: Any) -> Any:
        """Distance of the side force behind the middle of the contact patch, m; slip as for `side_force`."""
        df = load / self.FNOMIN - 1
        D = load / self.FNOMIN * self.R0 * (self.QDZ1 + self.QDZ2 * df)
        return D * ca.cos(self.QCZ1 * ca.atan((self.QBZ1 + self.QBZ2 * df + self.QBZ3 * df * df) * slip))
