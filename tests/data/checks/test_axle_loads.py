import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.checks.axle_loads import static_loads
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.record import Record


def weighing_run(seed=0, **more):
    random = np.random.default_rng(seed)
    time = np.arange(0, 60, 0.1)
    moving = time > 20
    signals = {
        "speed": np.where(moving, 20.0, 0.0),
        "yaw_rate.tractor": np.where(time > 40, 0.05, 0.0),
        "axle_load.tractor.drive": 1e5 + 300 * random.normal(size=time.size) + np.where(moving, 2000, 0),
    }
    return Record(time=time, signals=signals | more)


def test_samples_at_rest_are_preferred():
    at_rest = static_loads(weighing_run())["tractor.drive"]
    assert at_rest.value == pytest.approx(1e5, abs=100)
    assert at_rest.scatter == pytest.approx(300, rel=0.3)
    assert at_rest.samples == 201
    driving = static_loads(weighing_run().cut(25, 60))["tractor.drive"]
    assert driving.value == pytest.approx(1.02e5, abs=100)
    assert driving.samples == 151  # without the turn


def test_missing_loads_and_too_few_samples_are_refused():
    with pytest.raises(SignalError, match="no axle load; map the columns with axle loads"):
        static_loads(Record(time=[0, 1], signals={"speed": [0, 0]}))
    sparse = np.full(600, np.nan)
    sparse[3] = 1e4
    with pytest.raises(SignalError, match=r"axle_load.semitrailer: 1 samples"):
        static_loads(weighing_run(**{"axle_load.semitrailer": sparse}))


def test_loads_in_kilograms_and_from_the_pressure_of_an_air_spring(tmp_path):
    (tmp_path / "a.csv").write_text("t,front,p\n0,7000,1.0\n1,7000,4.0\n2,7000,8.0\n")
    spring = {"column": "p", "unit": "kg", "points": [[1.0, 3000], [5.0, 9000], [7.0, 11500]]}
    source = {"axle_load.tractor.front": {"column": "front", "unit": "kg"}, "axle_load.tractor.drive": spring}
    record = read_log(tmp_path / "a.csv", SignalMap.model_validate({"signals": source}))
    assert record.signals["axle_load.tractor.front"] == pytest.approx(7000 * 9.80665)
    assert record.signals["axle_load.tractor.drive"] / 9.80665 == pytest.approx([3000, 7500, 12750])
