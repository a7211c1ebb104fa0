"""Tasks in processes and on a Dask cluster whose workers are killed; a run that is killed; an object store."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from fifthwheel.apps.cluster import AHEAD, ATTEMPTS, Lost, connected, run_all, run_on
from fifthwheel.apps.fleet import report, run
from fifthwheel.apps.fleet.dataset import TripDataset
from fifthwheel.base.errors import FifthwheelError
from tests.apps.fleet.make import FAST, make_fleet

pytestmark = pytest.mark.slow
dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")


def kill_once(folder, task):
    """End the worker at the first attempt of task 1, and at every attempt of task 2."""
    attempts = Path(folder) / f"{task}"
    attempts.write_text(attempts.read_text() + "x" if attempts.exists() else "x")
    if task == 2 or (task == 1 and attempts.read_text() == "x"):
        os.kill(os.getpid(), signal.SIGKILL)
    return task**2


@contextlib.contextmanager
def local_cluster():
    """The address of a Dask scheduler with two workers, each a process."""
    with distributed.LocalCluster(2, threads_per_worker=1, host="127.0.0.1", dashboard_address=":0") as cluster:
        yield cluster.scheduler_address


def square(_, task):
    return task**2


def test_tasks_wait_here_and_are_tried_again_when_their_worker_is_killed(tmp_path, monkeypatch) -> None:
    """However many tasks there are, the scheduler holds a few for each worker."""
    taken = 0

    def tasks():
        nonlocal taken
        for k in range(100):
            taken += 1
            yield k

    with dask.config.set({"distributed.scheduler.allowed-failures": 1}), local_cluster() as address:
        with connected(address) as client:
            for done, (task, result) in enumerate(run_on(client, square, None, tasks())):
                assert result == task**2
                assert taken - done <= 2 * AHEAD
            results = dict(run_on(client, kill_once, str(tmp_path), (0, 1, 3)))
        lost = dict(run_all(kill_once, str(tmp_path), (2,), scheduler=address))
    assert taken == 100
    assert results == {0: 0, 1: 1, 3: 9}
    assert isinstance(lost[2], Lost)
    assert len((tmp_path / "1").read_text()) > 1
    monkeypatch.setattr("fifthwheel.apps.cluster.TIMEOUT", 0.5)
    with pytest.raises(FifthwheelError, match="does not answer"), connected("tcp://127.0.0.1:9"):
        pass


def test_a_task_that_ends_its_process_costs_no_other(tmp_path) -> None:
    results = dict(run_all(kill_once, str(tmp_path), range(12), jobs=2))
    lost = results.pop(2)
    assert isinstance(lost, Lost)
    assert len((tmp_path / "2").read_text()) in (ATTEMPTS, ATTEMPTS + 1)
    assert results == {k: k**2 for k in range(12) if k != 2}


def test_a_script_without_a_guard_is_told(tmp_path) -> None:
    script = tmp_path / "script.py"
    script.write_text("from fifthwheel.apps.cluster import run_all\nlist(run_all(pow, 2, range(50), jobs=2))\n")
    process = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=100)
    assert "jobs: no process can be started; a script needs `if __name__ == '__main__':`" in process.stderr


def sleep(_, task):
    if task:
        time.sleep(60)
    return task


def test_processes_end_at_once_with_the_iteration() -> None:
    tasks = run_all(sleep, None, (0, 1, 2), jobs=2)
    assert next(tasks) == (0, 0)
    start = time.monotonic()
    tasks.close()
    assert time.monotonic() - start < 10


def test_a_killed_run_loses_only_running_trips(tmp_path) -> None:
    """kill -9 of the whole run; the next run continues, and its workers end with it."""
    manifest, out = make_fleet(tmp_path, trucks=2, trips=4), tmp_path / "out"
    code = (
        "from fifthwheel.apps.fleet import run\nfrom tests.apps.fleet.make import FAST\n"
        f"if __name__ == '__main__':\n    run({str(manifest)!r}, {str(out)!r}, settings=FAST, jobs=2)\n"
    )
    script = tmp_path / "script.py"
    script.write_text(code)
    paths = os.pathsep.join([str(Path(__file__).parents[3]), *sys.path])
    process = subprocess.Popen([sys.executable, str(script)], env=os.environ | {"PYTHONPATH": paths})
    deadline = time.monotonic() + 120
    while len(list(out.glob("trips/trip-*.parquet"))) < 3 and time.monotonic() < deadline:
        time.sleep(0.05)
    process.kill()
    process.wait()
    time.sleep(3)
    kept = len(TripDataset(str(out)).known()[0])
    time.sleep(1)
    assert kept == len(TripDataset(str(out)).known()[0]), "workers end with the run"
    assert 3 <= kept < 8
    result = run(manifest, out, settings=FAST, jobs=1)
    assert (result.unchanged, result.new, result.failed) == (kept, 8 - kept, 0)


@pytest.fixture
def store(monkeypatch):
    """A bucket of moto's local server."""
    server_module = pytest.importorskip("moto.server")
    s3fs = pytest.importorskip("s3fs")
    server = server_module.ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    server.start()
    host, port = server.get_host_and_port()
    for name, value in {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_DEFAULT_REGION": "us-east-1",
    }.items():
        monkeypatch.setenv(name, value)
    s3fs.S3FileSystem.clear_instance_cache()
    system = s3fs.S3FileSystem()
    system.mkdir("depot")
    yield system
    s3fs.S3FileSystem.clear_instance_cache()
    server.stop()


def test_manifest_logs_and_data_set_in_an_object_store(tmp_path, store) -> None:
    """The same tables as with local files; a missing log is an error of its trip."""
    manifest = make_fleet(tmp_path / "local", trucks=1, trips=2)
    with manifest.open("a", encoding="utf-8") as file:
        file.write("logs/none.parquet,truck 0,A,truck.toml,steel,2026-02-01\n")
    store.put(str(tmp_path / "local"), "depot/fleet", recursive=True)
    local = run(manifest, tmp_path / "out", settings=FAST, jobs=1)
    remote = run("s3://depot/fleet/manifest.csv", "s3://depot/out", settings=FAST, jobs=2)
    assert (remote.new, remote.failed) == (local.new, local.failed) == (2, 1)
    assert "no such file" in remote.errors[0][1]
    for name in ("trucks", "trailers"):
        here, there = (
            pq.read_table(source).to_pandas()
            for source in (tmp_path / "out" / f"{name}.parquet", store.open(f"depot/out/{name}.parquet"))
        )
        assert here.equals(there)
    assert run("s3://depot/fleet/manifest.csv", "s3://depot/out", settings=FAST, jobs=1).unchanged == 2
    assert [item.kind for item in report("s3://depot/out", tmp_path / "fleet.html")] == ["not processed"]
