"""An identification in one stage, and one with the settings of the article."""

import pytest

from fifthwheel.apps.cheng_cebon_2011 import article
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
GUESS = TRUCK.replace({"tractor.front.cornering_stiffness": 4.0e5})
RUN, OTHER = simulate(TRUCK, count=2, seed=1, name="run"), simulate(TRUCK, count=1, seed=2, name="<other>")


@pytest.fixture(scope="session")
def result() -> Identification:
    return identify([RUN], GUESS, OneStage(tyres="linear"), validate=[OTHER])


@pytest.fixture(scope="session")
def published() -> Identification:
    return identify([RUN], GUESS, article(given={"tractor.front.cornering_stiffness": "exact"}))
