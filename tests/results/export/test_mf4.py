"""States as MDF, read back by asammdf and by the reader of logs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.data.channels import si_unit
from fifthwheel.data.logs.readers import open_log
from fifthwheel.results.export.mf4 import write_mf4
from tests.data.logs.readers.reading import read


@pytest.mark.slow
def test_states_are_read_back(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    truck = fw.vehicle("cheng_cebon_2011")
    record = fw.simulate(truck, count=1, seed=1)
    states = fw.Observer(truck, record.signals).batch(record)
    other = replace(states, name="other", time=states.time + 100)
    write_mf4([states, other], tmp_path / "a.mf4")
    with asammdf.MDF(tmp_path / "a.mf4") as mdf:
        assert [group.channel_group.acq_name for group in mdf.groups] == [states.name, "other"]
        for name, values in states.values.items():
            for stored, expected in ((name, values), (f"{name}.sigma", states.sigma[name])):
                signal = mdf.get(stored, group=0)
                np.testing.assert_array_equal(signal.samples, expected)
                np.testing.assert_array_equal(signal.timestamps, states.time)
                assert signal.unit == si_unit(name)
        assert mdf.get("status", group=0).samples.tolist() == [fw.Status(s).name.encode() for s in states.status]
        np.testing.assert_array_equal(mdf.get("nis", group=1).samples, states.nis)
    with open_log(tmp_path / "a.mf4") as log:
        np.testing.assert_array_equal(read(log)["status@other"][1], states.status)
