"""The whole way in a browser: from a dropped log to a report and a comparison, with all that may go wrong."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlencode, urljoin

import pytest

from fifthwheel.apps.app.workspace import Workspace
from fifthwheel.data.logs import write_record
from fifthwheel.estimate.identify import Identification
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, catalogue, get
from tests.apps.app.served import served, tab
from tests.results.report.conftest import result

__all__ = ["result"]

pytestmark = pytest.mark.slow

EXAMPLES = Path(__file__).parents[3] / "examples"
TRUCK = get("cheng_cebon_2011")
FRONT = "tractor.front.cornering_stiffness"
LONG = 180_000
"""ms for a computation."""


def prepared(folder, count=2):
    """A workspace with a log and a vehicle."""
    workspace = Workspace(folder)
    write_record(simulate(TRUCK, count=count, seed=1), workspace.folder / "logs" / "run.csv")
    workspace.write({"vehicle.toml": TRUCK.to_toml()}, "a truck")
    return workspace


@pytest.fixture(scope="module")
def started(browser, tmp_path_factory):
    """A prepared workspace, and a tab of it: all that many tests need."""
    workspace = prepared(tmp_path_factory.mktemp("prepared") / "w")
    with served(workspace.folder) as address, tab(browser, address) as page:
        yield workspace.folder, page


@pytest.fixture
def folder(emptied):
    """The prepared workspace, without the files of other tests."""
    shutil.rmtree(emptied / "runs")
    (emptied / "runs").mkdir()
    for file in (emptied / "logs").iterdir():
        if file.name != "run.csv":
            file.unlink()
    (emptied / "vehicle.toml").write_text(TRUCK.to_toml())
    return emptied


def go(page, name):
    page.get_by_role("link", name=re.compile(rf"^\d {name}$")).click()
    page.get_by_role("heading", name=name, level=1).wait_for()


def report(page):
    """The report in its frame, when it is shown; the frame has its whole height."""
    frame = page.frame_locator("iframe.fw-report")
    frame.locator("#verdict .headline").wait_for(timeout=LONG)
    page.wait_for_function("parseFloat(document.querySelector('.fw-report').style.height) > 2000", timeout=LONG)
    return frame


def test_from_the_example_log_to_a_comparison(browser, tmp_path, capsys):
    folder = tmp_path / "w"
    with served(folder) as address, tab(browser, address) as page:
        page.set_input_files("input[type=file]", str(EXAMPLES / "lane_changes.csv"))
        page.get_by_text(re.compile(r"\d+ channels")).first.wait_for(timeout=LONG)
        go(page, "Signals")
        page.get_by_text("The prediction explains").first.wait_for(timeout=LONG)

        go(page, "Truck")
        with page.expect_file_chooser() as chooser:
            page.get_by_role("button", name="Import").click()
        chooser.value.set_files(str(EXAMPLES / "truck.toml"))
        page.get_by_role("img", name="example_truck").wait_for()
        page.get_by_text("The vehicle file is example_truck now.").wait_for()

        go(page, "Check")
        page.get_by_text("5 of 5 parameters are identifiable").wait_for(timeout=LONG)
        assert page.get_by_role("table", name="Predicted sigma").get_by_role("row").count() == 6

        go(page, "Identify")
        page.get_by_role("button", name="Identify", exact=True).click()
        assert "All 6 parameters are identified" in report(page).locator(".headline").inner_text()
        page.get_by_role("button", name="Use the identified truck").click()
        page.get_by_text("vehicle.toml is the identified truck of run-1 now.").wait_for()
        page.get_by_text("Logs, what is known, and settings").click()
        page.get_by_text("Settings", exact=True).click()
        page.get_by_label("Number", exact=True).fill("Front tyres, corn")
        page.get_by_role("option", name=f"Front tyres, cornering stiffness ({FRONT})").click()
        page.get_by_label("What you know").fill("exact")
        page.get_by_role("button", name="Add", exact=True).click()
        known = page.get_by_role("list", name="What is known")
        known.get_by_text("Front tyres, cornering stiffness: exact.").wait_for()
        page.get_by_role("button", name="Add", exact=True).click()
        page.get_by_text("Number: pick one, or type a name").first.wait_for()
        page.get_by_label("Number", exact=True).fill("roll_damping")
        page.get_by_label("Number", exact=True).press("Enter")
        page.get_by_label("What you know").fill("+- 40 %")
        page.get_by_role("button", name="Add", exact=True).click()
        known.get_by_text("Roll damping: ± 40 %").wait_for()
        page.get_by_label("Name of the result").fill("../fixed front")
        page.get_by_role("button", name="Identify", exact=True).click()
        page.get_by_text("name: expected letters").first.wait_for()
        page.get_by_label("Name of the result").fill("fixed front")
        page.get_by_role("button", name="Identify", exact=True).click()
        page.get_by_text("fixed front: done").wait_for(timeout=LONG)

        go(page, "Compare")
        table = page.get_by_role("table", name="Estimates of all results")
        table.get_by_text("fixed", exact=False).first.wait_for(timeout=LONG)
        assert table.get_by_text("kN/rad, fixed").count() == 1
        with page.expect_download() as download:
            page.get_by_role("link", name="Save as CSV").click()
        assert download.value.path().read_text().startswith("parameter,run,value,sigma")
        found_by_name(page, page.get_by_role("img", name="Measured and predicted, lane_changes.csv"))
        page.locator(".q-chip__icon--remove").last.click()
        page.get_by_text("Choose a second result.").wait_for()
        assert table.count() == 0

    logged = capsys.readouterr().out
    assert "name: expected letters" in logged
    assert "Traceback" not in logged
    found = Identification.load(folder / "runs" / "run-1")
    assert Vehicle.load(folder / "vehicle.toml").parameters() == found.vehicle.parameters()
    fixed = Identification.load(folder / "runs" / "fixed front")[FRONT]
    assert (fixed.verdict, fixed.value) == ("fixed", found[FRONT].value)


def test_from_a_log_to_a_report_on_a_telephone(page, folder):
    (folder / "workspace.toml").write_text('[identify]\ntyres = "linear"\n')
    page.set_viewport_size({"width": 390, "height": 1000})
    page.goto("/")
    page.get_by_text(re.compile(r"\d+ channels")).first.wait_for(timeout=LONG)
    go(page, "Check")
    table = page.get_by_role("table", name="Predicted sigma")
    table.wait_for(timeout=LONG)
    assert table.evaluate("table => table.scrollWidth <= table.parentElement.clientWidth")
    go(page, "Identify")
    page.get_by_role("button", name="Identify", exact=True).click()
    headline = report(page).locator(".headline").inner_text()
    assert "parameters are identified" in headline or "parameters converged" in headline, headline
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    shutil.copytree(folder / "runs" / "run-1", folder / "runs" / "again")
    for name, shown in SHOWN.items():
        page.goto(f"/{name}")
        page.locator(shown).first.wait_for(timeout=LONG)
        page.wait_for_timeout(1000)
        assert page.evaluate("document.documentElement.scrollHeight") <= 1500, name
        assert page.evaluate(SMALL) == [], name
        page.emulate_media(media="print")
        assert page.evaluate(FOLDED) == 0, name
        page.emulate_media(media="screen")
        assert page.evaluate(FOLDED) > 0 or name in ("truck", "identify"), name


SHOWN = {
    "": "[role=img] .plot-container",
    "signals": ".fw-finding",
    "truck": "[role=img] .plot-container",
    "check": ".fw-table table",
    "identify": ".fw-report",
    "explore": ".fw-table table",
    "compare": ".fw-table table",
    "history": ".fw-table table",
}
"""What a page begins with."""
SMALL = """[...document.querySelectorAll('.fw-page :is(button, a, [role=checkbox], input), header :is(a, button)')]
  .filter(e => e.offsetParent && !e.closest('.modebar'))
  .map(e => [(e.closest('.q-field, .q-checkbox') || e).getBoundingClientRect().height, e.outerHTML])
  .filter(([height]) => height < 40)"""
FOLDED = """[...document.querySelectorAll('.fw-folded')]
  .filter(e => getComputedStyle(e).visibility == 'hidden' || e.clientHeight == 0).length"""


def test_the_questions_describe_a_truck_and_are_kept(page, folder):
    """Also by keyboard only: an answer counts when its field is left."""
    (folder / "vehicle.toml").unlink()
    page.set_viewport_size({"width": 390, "height": 1000})
    page.goto("/truck")
    for label, text in (
        ("Front axle to the first axle behind it", "3.7 kg"),
        ("Kingpin to the middle of the trailer's axles", "7.7 m +- 2 cm"),
        ("Slip of the laden truck", "6850 10500 22500"),
        ("Slip of the tractor alone", "5200 2000"),
    ):
        field = page.get_by_label(label)
        field.fill(text)
        field.press("Tab")
    page.get_by_text("wheelbase: ").first.wait_for()  # kg is no length
    first = page.get_by_role("region", name="Questions").get_by_role("alert").first
    first.filter(has_text="Correct or remove the answer to: Front axle").wait_for()  # after that of the field
    field = page.get_by_label("Front axle to the first axle behind it")
    field.fill("3,7 m")
    field.press("Tab")
    for label, name in (("Class of the tractor", "tractor_4x2"), ("Class of the semitrailer", "semitrailer_3")):
        page.get_by_label(label).click()
        page.get_by_role("option", name=name, exact=True).click()
    page.get_by_role("region", name="Described truck").locator(".modebar").wait_for(state="attached")
    field = page.get_by_label("Mass of the load")
    for text, usable in (("15.5 t?", False), ("", True)):
        field.fill(text)
        field.press("Tab")
        refusal = page.get_by_text("Correct or remove the answer to: Mass of the load")
        refusal.wait_for(state="detached" if usable else "visible")
        page.get_by_role("button", name="Use this truck", disabled=not usable).wait_for()
    page.reload()
    assert page.get_by_label("Slip of the tractor alone").input_value() == "5200 2000"
    page.get_by_role("button", name="Use this truck").click()
    page.get_by_text("assumed numbers").click()
    page.get_by_role("table", name="Assumed numbers").wait_for(timeout=LONG)
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    assert Vehicle.load(folder / "vehicle.toml").wheelbase == pytest.approx(3.7)
    page.get_by_role("button", name="Undo: describe the truck").wait_for()
    page.locator("input[type=file]").set_input_files(str(EXAMPLES / "truck.toml"))
    page.get_by_text("The answers to the questions are cleared").wait_for()
    page.get_by_text("Describe a tractor and its semitrailer").click()
    page.get_by_text("Still needed: ").wait_for()
    assert page.get_by_role("region", name="Described truck").get_by_role("img").count() == 0


def test_the_load_of_each_unit_is_typed(page, folder):
    (folder / "vehicle.toml").write_text(catalogue.text("b_double"))
    page.goto("/truck")
    page.get_by_text("Loads", exact=True).click()
    for label, answer in (("Lead trailer payload, mass", "5,2 t"), ("Trailer payload, height", "1.5 m +- 10 cm")):
        page.get_by_label(label, exact=True).fill(answer)
        page.get_by_label(label, exact=True).press("Tab")
        page.get_by_role("button", name=f"Undo: {label}").wait_for()
        page.get_by_text("Loads", exact=True).click()
    page.get_by_label("Trailer payload, width", exact=True).fill("2 kg")
    page.get_by_label("Trailer payload, width", exact=True).press("Tab")
    page.get_by_text("Trailer payload, width: ").wait_for()
    truck = Vehicle.load(folder / "vehicle.toml")
    assert [round(unit.mass) for unit in truck.units[1:]] == [19900 - 13000 + 5200, 33450]
    assert truck.parameters()["semitrailer.payload.height"] == 1.5
    assert truck.stated["semitrailer.payload.height"] == pytest.approx(0.1)


def test_a_result_is_replaced_only_after_a_question_renamed_and_deleted(page, folder, result):
    result.identification.save(folder / "runs" / "mine")
    (folder / "runs" / "mine" / "report.html").write_text("<h1 id=verdict>report</h1>")
    before = (folder / "runs" / "mine" / "identification.json").read_bytes()
    page.goto("/identify")
    for answer in ("Keep", "Replace"):
        page.get_by_label("Name of the result").fill("mine")
        page.get_by_role("button", name="Identify", exact=True).click()
        page.get_by_text("There is a result mine already. Replace it?").wait_for()
        page.get_by_role("button", name=answer, exact=True).click()
        if answer == "Keep":
            page.wait_for_timeout(1000)
            assert page.get_by_role("progressbar").count() == 0
    refusal = page.get_by_text("not written by an earlier").first
    refusal.wait_for(timeout=LONG)
    assert "another folder with “Name of the result”, or replace it with “Delete”" in refusal.inner_text()
    assert (folder / "runs" / "mine" / "identification.json").read_bytes() == before

    file = folder / "runs" / "mine" / "identification.json"
    note = {"text": "new tyres", "author": "A", "date": "2026-11-26"}
    file.write_text(json.dumps(json.loads(file.read_text()) | {"note": note}))
    head = "<title>truck, mine: fifthwheel</title><h1>truck<span class="
    (folder / "runs" / "mine" / "report.html").write_text(f'{head}"result">, mine</span></h1>--tyres linear')
    page.goto("/identify")
    page.get_by_text("mine: new tyres (A, 2026-11-26)").first.wait_for()
    page.get_by_role("button", name="Rename mine").click()
    page.get_by_label("New name of mine").fill("bend")
    page.get_by_role("button", name="Rename", exact=True).click()
    page.get_by_text("bend: new tyres (A, 2026-11-26)").first.wait_for()
    report = page.frame_locator(".fw-report")
    report.get_by_role("heading", name="truck, bend").wait_for()
    report.get_by_text("--tyres linear").wait_for()  # a report stays as it was written
    page.get_by_role("button", name="Delete bend").click()
    page.get_by_text("Delete the result bend with all its files?").wait_for()
    page.get_by_role("button", name="Delete", exact=True).click()
    page.get_by_role("button", name="Rename bend").wait_for(state="detached")
    assert not list((folder / "runs").iterdir())


@contextmanager
def killed_server(folder):
    """The address of a workbench, and a function that kills its process as kill -9 does."""
    command = [sys.executable, "-m", "fifthwheel", "app", str(folder), "--port", "0", "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield process.stdout.readline().strip(), lambda: os.kill(process.pid, signal.SIGKILL)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def test_a_reload_keeps_an_identification_cancel_ends_it_and_a_killed_server_loses_nothing(browser, tmp_path):
    prepared(tmp_path / "w", count=40)
    started = re.compile("fit|residual", re.IGNORECASE)
    with killed_server(tmp_path / "w") as (address, kill):
        context = browser.new_context()
        page = context.new_page()
        page.goto(f"{address}identify")
        page.get_by_label("Name of the result").fill("long")
        page.get_by_role("button", name="Identify", exact=True).click()
        page.get_by_text(started).first.wait_for(timeout=LONG)
        page.reload()
        page.get_by_role("progressbar").wait_for()
        page.get_by_role("button", name="Cancel").click()
        page.get_by_text("Cancelled; no result was changed.").wait_for()
        assert page.get_by_label("Name of the result").input_value() == "long"
        page.get_by_role("button", name="Identify", exact=True).wait_for()
        assert page.get_by_text("interrupted before its end").count() == 0
        assert not (tmp_path / "w" / "runs" / "long").exists()

        page.get_by_text("Settings", exact=True).click()
        page.get_by_label("Refuse implausible signals").click()
        page.get_by_text("Refuse implausible signals: no.").wait_for()
        page.get_by_role("button", name="Identify", exact=True).click()
        page.get_by_text(started).first.wait_for(timeout=LONG)
        kill()
        context.close()
    write_record(simulate(TRUCK, count=1, seed=1), tmp_path / "w" / "logs" / "run.csv")
    with served(tmp_path / "w") as address, tab(browser, f"{address}identify") as page:
        page.get_by_text("Refuse implausible signals: no.").wait_for()
        assert page.get_by_label("Name of the result").input_value() == "run-1"
        page.get_by_role("button", name="Identify", exact=True).click()
        report(page)
    assert (tmp_path / "w" / "runs" / "run-1" / "run.json").exists()


FIND = "Find a signal"


def found_by_name(page, plot):
    """The plot shows the signals whose names contain the text of the field."""
    plot.get_by_text("Tractor, yaw rate").first.wait_for(timeout=LONG)
    page.get_by_label(FIND).fill("trailer")
    plot.get_by_text("Tractor, yaw rate").first.wait_for(state="detached")
    plot.get_by_text("Trailer, yaw rate").first.wait_for()
    page.get_by_label(FIND).fill("none")
    page.get_by_text("No signal has this name.").wait_for()
    page.get_by_label(FIND).fill("")


def test_a_slider_by_keys_changes_the_prediction(page, folder):
    name, path = "Trailer tyres, cornering stiffness", "semitrailer.cornering_stiffness"
    page.goto("/explore")
    table = page.get_by_role("table", name="Fit of each signal")
    table.wait_for(timeout=LONG)
    before = table.inner_text()
    slider = page.get_by_role("slider", name=name, exact=True)
    slider.focus()
    for _ in range(10):
        page.keyboard.press("ArrowRight")
    page.get_by_text(re.compile(f"^{name}$")).wait_for()
    end = time.monotonic() + 60
    while table.inner_text() == before:
        assert time.monotonic() < end
        page.wait_for_timeout(100)
    page.wait_for_timeout(100)  # all ten steps have arrived
    page.reload()
    slider.wait_for()
    assert slider.input_value() == "10"
    page.get_by_role("button", name="Write to vehicle.toml").click()
    page.get_by_text("1 number written to vehicle.toml").wait_for()
    assert slider.input_value() == "0"
    changed = Vehicle.load(folder / "vehicle.toml").parameters()[path]
    assert changed == pytest.approx(TRUCK.parameters()[path] * 2**0.25, rel=1e-3)
    found_by_name(page, page.get_by_role("img", name=re.compile("Measured and predicted,? signals")))


def test_names_are_no_markup_and_no_file_outside_is_given(page, folder, tmp_path, result):
    evil = "<img src=x onerror=document.title='owned'>"
    (folder / "vehicle.toml").write_text(TRUCK.model_copy(update={"name": evil}).to_toml())
    for name in ("a", f"b {evil}".replace("/", "")):
        result.identification.save(folder / "runs" / name)
        (folder / "runs" / name / "report.html").write_text("<h1 id=verdict>report</h1>")
    (tmp_path / "secret").write_text("secret")
    (folder / "runs" / "a" / "states.parquet").symlink_to(tmp_path / "secret")
    log = tmp_path / f"{evil}.csv"
    rows = (f"{k / 10},{k % 7},{k % 3}" for k in range(200))
    log.write_text("\n".join([f"time [s],{evil} [{evil}],<script>document.title='owned'</script>", *rows]))

    def harmless():
        page.wait_for_timeout(500)
        assert page.title().endswith("- fifthwheel")
        assert page.locator("img[src=x]").count() == 0
        assert page.locator("#main script").count() == 0

    for name in ("truck", "check", "identify", "explore", "compare", "history"):
        page.goto(f"/{name}", wait_until="networkidle")
        harmless()
    page.goto("/")
    page.set_input_files("input[type=file]", str(log))
    page.get_by_text(evil).first.wait_for()
    page.get_by_text(re.compile(r"\d+ channels")).nth(1).wait_for(timeout=LONG)
    harmless()
    page.goto(f"/signals?{urlencode({'log': log.name})}")
    page.get_by_text(evil).first.wait_for()
    harmless()
    cookies = "; ".join(f"{c['name']}={c['value']}" for c in page.context.cookies())
    elsewhere = ("..%2F..%2Fsecret/x", "a/..%2F..%2Fvehicle.toml", "a/states.parquet", "a/run.json", "c/vehicle.toml")
    for outside in elsewhere:
        request = urllib.request.Request(urljoin(page.url, f"/runs/{outside}"), headers={"Cookie": cookies})
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(request, timeout=10)
