import numpy as np
import pytest

from fifthwheel.errors import SignalError
from fifthwheel.logs import Record, SignalMap, read
from fifthwheel.logs.weigh import static_loads


def weighing(seed=0, **more):
    random = np.random.default_rng(seed)
    time = np.arange(0, 60, 0.1)
    moving = time > 20
    signals = {
        "speed": np.where(moving, 20.0, 0.0),
        "yaw_rate.tractor": np.where(time > 40, 0.05, 0.0),
        "axle_load.tractor.drive": 1e5 + 300 * random.normal(size=time.size) + np.where(moving, 2000, 0),
    }
    return Record(time=time, signals=signals | more)


def test_loads_at_rest_count_where_there_are_some():
    found = static_loads(weighing())["tractor.drive"]
    assert found.value == pytest.approx(1e5, abs=100)
    assert found.scatter == pytest.approx(300, rel=0.3)
    assert found.samples == 201
    driving = static_loads(weighing().cut(25, 60))["tractor.drive"]
    assert driving.value == pytest.approx(1.02e5, abs=100)
    assert driving.samples == 151  # straight on only


def test_no_loads_and_too_few():
    with pytest.raises(SignalError, match="no axle load; map the columns"):
        static_loads(Record(time=[0, 1], signals={"speed": [0, 0]}))
    hardly = np.full(600, np.nan)
    hardly[3] = 1e4
    with pytest.raises(SignalError, match=r"axle_load.semitrailer: 1 samples"):
        static_loads(weighing(**{"axle_load.semitrailer": hardly}))


def test_kilograms_and_the_pressure_of_an_air_spring(tmp_path):
    (tmp_path / "a.csv").write_text("t,front,p\n0,7000,1.0\n1,7000,4.0\n2,7000,8.0\n")
    record = read(
        tmp_path / "a.csv",
        SignalMap.parse("""
            [signals]
            "axle_load.tractor.front" = {column = "front", unit = "kg"}
            [signals."axle_load.tractor.drive"]
            column = "p"
            unit = "kg"
            points = [[1.0, 3000], [5.0, 9000], [7.0, 11500]]
        """),
    )
    assert record.signals["axle_load.tractor.front"] == pytest.approx(7000 * 9.80665)
    assert record.signals["axle_load.tractor.drive"] / 9.80665 == pytest.approx([3000, 7500, 12750])
