"""The law of tyres that saturate, and the tyre of the nonlinear truck."""

import casadi as ca
import numpy as np
import svg

from fifthwheel import truck as vehicle
from fifthwheel.model.dynamics.tyres import Contact, saturating, saturation_parameters
from fifthwheel.model.plant.properties import MagicFormula
from fifthwheel.truck.quantities import FRICTION

GROUP, TYRES = "semitrailer", 6
LOADS = (0.5, 1.0, 1.5)
"""Load over the static one."""
ROADS = ((1.0, "dry road"), (0.35, "snow"))
"""Factor of the friction of the tyre."""
WIDTH, HEIGHT, LEFT, BOTTOM, ACROSS, UP = 660, 400, 70, 350, 46.0, 260.0


def draw() -> str:
    """The figure."""
    truck, tyre = vehicle.get("cheng_cebon_2011"), MagicFormula()
    static = truck.axle_loads()[GROUP]
    stiffness = TYRES * float(tyre.cornering_stiffness(static / TYRES))
    given = truck.parameters() | saturation_parameters(truck) | {f"{GROUP}.cornering_stiffness": stiffness}
    slips = np.radians(np.linspace(0, 10, 41))
    shapes = [
        svg.path([(LEFT, 40), (LEFT, BOTTOM), (LEFT + 10.5 * ACROSS, BOTTOM)], "thin"),
        svg.label(LEFT + 3.8 * ACROSS, BOTTOM + 38, "slip angle, deg"),
        svg.label(12, 28, "side force / static load"),
    ]
    names: list[tuple[float, str]] = []
    for degree in range(0, 11, 2):
        shapes.append(svg.label(LEFT + degree * ACROSS - 4, BOTTOM + 18, str(degree), "small"))
    for force in (0.2, 0.4, 0.6, 0.8, 1.0):
        shapes.append(svg.label(LEFT - 30, BOTTOM - force * UP + 4, f"{force:g}", "small"))
    for factor, road in ROADS:
        for n in LOADS:
            p = given | {FRICTION: 0.74 * factor}
            change = ca.SX((n - 1) * static)
            contacts = [Contact(ca.SX(a), load_change=change) for a in slips]
            law = [a * float(ca.evalf(saturating(p, GROUP, c))) / static for a, c in zip(slips, contacts, strict=True)]
            load = n * static / TYRES
            tyres = [TYRES * float(tyre.side_force(np.tan(a), load, friction=factor)) / static for a in slips]
            shapes += [_curve(slips, law, "line"), _curve(slips, tyres, "measured")]
            names.append((law[-1], f"{road}, {n:g} × load"))
    last = HEIGHT
    for force, name in sorted(names):
        x, y = _point(10.05, force)
        last = min(y + 4, last - 14)  # below each other
        shapes.append(svg.label(x, last, name, "small"))
    shapes.append(
        svg.label(LEFT + 20, 58, "line: the law with its default shape; dashes: Magic Formula of the tyre", "small")
    )
    return svg.picture(WIDTH, HEIGHT, "Side force over slip angle", shapes)


def _curve(slips: np.ndarray, forces: list[float], kind: str) -> str:
    return svg.path([_point(float(np.degrees(a)), f) for a, f in zip(slips, forces, strict=True)], kind)


def _point(degrees: float, force: float) -> tuple[float, float]:
    return round(LEFT + degrees * ACROSS, 1), round(BOTTOM - force * UP, 1)
