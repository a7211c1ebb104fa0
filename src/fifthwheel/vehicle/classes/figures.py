"""Figures of vehicle classes with their spread and their source.

The value is near the middle of published sets, and sigma is their spread; where only one set has the figure, or where
the sets chose it, sigma is wider. The sets:

    article    C. Cheng, D. Cebon (2011), Vehicle System Dynamics 49: the vehicles `cheng_cebon_2011` and
               `cheng_cebon_2011_vehicle` of the catalogue, 4x2 tractor and three-axle semitrailer
    Auburn     GAVLab, Auburn University, five-axle TruckSim set: `auburn_6x4` and `auburn_6x4_unladen`
    Kraz       Project Chrono, Kraz 64431 (6x4) and three-axle semitrailer; BSD-3-Clause, see plant/LICENSE.chrono
    GOPS       iDLab, Tsinghua University, GOPS, Semitruck7DoF: 4x2 tractor and semitrailer; Apache-2.0
"""

from typing import NamedTuple


class Figure(NamedTuple):
    """A number of a class with its standard deviation and its source."""

    value: float
    sigma: float
    source: str

    @property
    def relative(self) -> float:
        """Standard deviation as a fraction of the value."""
        return self.sigma / self.value if self.value else 0.0


class AxleFigures(NamedTuple):
    """Figures of one axle."""

    unsprung_mass: Figure  # kg
    roll_stiffness: Figure  # of the suspension, N m/rad
    tyre_roll_stiffness: Figure  # N m/rad
    cornering_coefficient: Figure  # cornering stiffness by static load, 1/rad
    nominal_load: float  # static load in the published sets, N


DAMPING_TIME = Figure(
    0.045, 0.02, "roll damping by roll stiffness: article 0.038 to 0.044 s, Auburn 0.043 to 0.05 s; Kraz up to 0.16 s"
)
"""s."""
RELAXATION_LENGTH = Figure(0.45, 0.1, "truck tyres at 30 to 50 kN: 0.4 to 0.6 m")
"""m."""
TYRES = {
    "single": Figure(1900e3, 250e3, "article 1900 kN m/rad and axle, chosen"),
    "twin": Figure(3500e3, 550e3, "Auburn and drive axle of the article 3500 kN m/rad and axle, chosen"),
}
"""Roll stiffness of the tyres of an axle, N m/rad."""
LOAD_EXPONENT = 0.25
"""Standard deviation of the exponent to which the cornering coefficient changes with the load, chosen: the cornering
stiffness of a tyre rises less than in proportion to its load."""

STEER_AXLE = AxleFigures(
    unsprung_mass=Figure(680, 120, "Auburn 570 kg, article 1900 kg for two axles, Kraz about 990 kg"),
    roll_stiffness=Figure(340e3, 60e3, "article 380, Kraz 331, Auburn 300 kN m/rad"),
    tyre_roll_stiffness=Figure(1900e3, 300e3, "article and Auburn 1900 kN m/rad, both chosen; 2 k y^2"),
    cornering_coefficient=Figure(7.0, 1.4, "article 6.8 and 7.0, Auburn 7.5 times the load of the axle"),
    nominal_load=65e3,
)
DRIVE_AXLE = AxleFigures(
    unsprung_mass=Figure(1150, 180, "article 1900 kg for two axles, Auburn 785 kg, Kraz about 1100 kg"),
    roll_stiffness=Figure(700e3, 180e3, "article 800, Kraz 378 kN m/rad and axle of a tandem"),
    tyre_roll_stiffness=Figure(3500e3, 550e3, "article and Auburn 3500 kN m/rad and axle, both chosen; twin tyres"),
    cornering_coefficient=Figure(7.0, 2.3, "Auburn 3.6 and 4.8, article 7.2 and 11 times the load of the axle"),
    nominal_load=105e3,
)
TANDEM_AXLE = AxleFigures(
    unsprung_mass=Figure(900, 150, "Auburn 785 kg, Kraz about 1100 kg"),
    roll_stiffness=Figure(420e3, 110e3, "Kraz 378, Auburn 400 kN m/rad and axle"),
    tyre_roll_stiffness=DRIVE_AXLE.tyre_roll_stiffness,
    cornering_coefficient=Figure(6.0, 2.0, "Auburn 3.6 and 4.8, article 7.2 and 11 times the load of the axle"),
    nominal_load=65e3,
)
TRAILER_AXLE = AxleFigures(
    unsprung_mass=Figure(720, 80, "article 700 and 750, Auburn 665 kg and axle"),
    roll_stiffness=Figure(800e3, 180e3, "article 900, Kraz 755, Auburn 700 kN m/rad and axle"),
    tyre_roll_stiffness=Figure(2500e3, 700e3, "article 1900, Auburn 3500 (twin tyres) kN m/rad and axle, both chosen"),
    cornering_coefficient=Figure(5.7, 1.7, "Auburn 2.0 and 5.1, article 5.7 and 8.1 times the load of the axle"),
    nominal_load=70e3,
)
