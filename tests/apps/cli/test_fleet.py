"""`fifthwheel fleet`: a run, the page, and what is refused."""

import pytest

from tests.apps.cli.test_cli import run  # noqa: F401 - a fixture
from tests.apps.fleet.make import FIXED, make_fleet

OPTIONS = [word for name in FIXED for word in ("--set", f"{name}=exact")]


def test_a_run_and_its_page(run, tmp_path):  # noqa: F811
    manifest, out, page = make_fleet(tmp_path / "fleet", trucks=1, trips=2), tmp_path / "out", tmp_path / "fleet.html"
    first = run("fleet", "run", manifest, "--out", out, "--jobs", "1", *OPTIONS)
    assert (first.code, first.err) == (0, "")
    assert first.out.startswith("2 trips: 2 new\n")
    again = run("fleet", "run", manifest, "--out", out, "--jobs", "1", *OPTIONS, "--json").json()
    assert (again["new"], again["unchanged"]) == (0, 2)
    written = run("fleet", "report", out, "--out", page)
    assert written.out == f"Written: {page}; nothing needs attention\n"
    assert "nothing needs attention" in page.read_text()
    assert run("fleet", "report", out, "--out", page).code == 2, "a file is replaced only with --force"
    assert run("fleet", "report", out, "--out", page, "--force", "--json").json()["attention"] == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("run", "none.csv"), "none.csv"),
        (("run", "https://example.org/manifest.csv"), "expected a local path or one of s3://"),
        (("report", "nowhere"), "give the data set"),
        (("run", "none.csv", "--height-limit", "3 kg"), "kg"),
        (("run", "none.csv", "--false-alarms", "2"), "false_alarms: expected"),
    ],
)
def test_what_is_refused(run, arguments, message):  # noqa: F811
    outcome = run("fleet", *arguments)
    assert outcome.code == 2
    assert message in outcome.err
