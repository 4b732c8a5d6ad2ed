"""The page in a real browser: Debian's chromium, driven by playwright. A machine without them skips this file."""

import shutil
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from tests.conftest import ROOT

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
pytestmark = [pytest.mark.slow, pytest.mark.skipif(CHROMIUM is None, reason="there is no chromium on this machine")]
LOG = ROOT / "docs" / "example" / "measurements.csv"
DRIFT = """
[[effects]]
name = "drift"
kind = "sensor"
description = "The room sensor drifts, in thirty days by this much"
unit = "K"
scale = 1.0
lower = -20.0
upper = 20.0
outputs = ["room"]
operation = "drift"
"""


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as driver:
        made = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield made
        made.close()


@contextmanager
def page_of(browser, folder, *words):
    """A page of the command's own server, which Ctrl-C ends; no other machine is asked for anything meanwhile."""
    command = [sys.executable, "-m", "diagnosis.cli", "app", str(folder), "--no-browser", *words]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT)
    context = browser.new_context(timezone_id="America/New_York", viewport={"width": 1200, "height": 900})
    try:
        page, hosts = context.new_page(), set()
        address = server.stdout.readline().strip()
        page.set_default_timeout(400_000)  # beside other tests all takes long
        page.on("request", lambda one: hosts.add(one.url.split("/")[2]))
        yield page, address
        assert hosts == {address.split("/")[2]}
        assert hosts.pop().startswith("127.0.0.1:")
    finally:
        context.close()
        server.send_signal(2)
        assert server.wait(20) == 0


def fits(page, width):
    """Whether nothing stands beyond the window's right edge at a width [px]."""
    page.set_viewport_size({"width": width, "height": 900})
    page.wait_for_timeout(300)
    return page.evaluate("document.documentElement.scrollWidth") <= width


def test_from_a_log_to_a_recording(browser, tmp_path):
    (tmp_path / "bad.csv").write_text("a,b\n1,2\n3,4\n")
    (tmp_path / "log.csv").write_bytes(b"".join(LOG.read_bytes().splitlines(keepends=True)[:241]))
    with page_of(browser, tmp_path / "room") as (page, address):
        assert page.goto(address.partition("?")[0]).status == 403
        assert page.goto(f"{address}x").status == 403
        page.goto(address)
        page.locator(".filepond--drop-label").wait_for()
        page.set_input_files("input[type=file]", tmp_path / "bad.csv")
        page.get_by_text("expected a column of time stamps, as 2022-10-30 02:15").wait_for()
        page.set_input_files("input[type=file]", tmp_path / "log.csv")
        page.get_by_text("240 rows, usually 3600 s apart").wait_for()
        assert page.get_by_label("Clock of the stamps").input_value() == "America/New_York"  # the browser's
        page.get_by_label("in", exact=True).nth(1).select_option("percent")
        page.get_by_text("3.72e+06 to 8.08e+06 ppm").wait_for()
        page.get_by_label("in", exact=True).nth(1).select_option("ppm")
        page.get_by_role("button", name="Make the recording").click()
        page.get_by_text("place is missing").wait_for()  # what the import refuses stands on the page
        page.get_by_label("Latitude").fill("36.1")
        page.get_by_label("Longitude").fill("-79.95")
        page.get_by_label("Longitude").press("Tab")
        page.get_by_role("button", name="Make the recording").click()
        page.get_by_text("240 steps of 3600 s").wait_for()
        assert fits(page, 390) and fits(page, 1200)


def test_a_drifting_sensor_is_named_and_the_report_is_one_file(browser, house, house_recorded, tmp_path):
    """After a calibration that is stopped."""
    system = house()
    described = system.path.with_name("house-app.toml")
    described.write_text(system.path.read_text() + DRIFT)
    with xr.open_dataset(house_recorded(tmp_path, hours=120, seed=5, before=240)) as recorded:
        table = recorded.to_dataframe()
    log = pd.DataFrame({"time": table.index.round("s"), "room_degC": table["room"].to_numpy()})
    log["room_degC"] += 12.0 / 30 * np.arange(len(log)) / 24
    for name, key in {"outside": "To", "sun": "S", "heater": "P", "persons": "N"}.items():
        log[name] = table[key].to_numpy()
    log.to_csv(tmp_path / "log.csv", index=False)
    with page_of(browser, tmp_path / "room", "--system", str(described)) as (page, address):
        page.goto(address)
        page.locator(".filepond--drop-label").wait_for()
        page.set_input_files("input[type=file]", tmp_path / "log.csv")
        page.get_by_text("120 rows").wait_for()
        chosen = [  # the columns that were guessed come first
            ("irradiance (S)", "kW/m2", "instants"),
            ("persons (N)", "persons", "means"),
            ("room temperature (room)", "degC", "instants"),
            ("room temperature (To)", "degC", "instants"),
            ("power (P)", "kW", "means"),
        ]
        for k, (label, unit, reading) in enumerate(chosen):
            page.get_by_label("is", exact=True).nth(k).select_option(label)
            page.get_by_label("in", exact=True).nth(k).get_by_text(unit, exact=True).wait_for(state="attached")
            page.get_by_label("in", exact=True).nth(k).select_option(unit)
            page.get_by_label("readings are", exact=True).nth(k).select_option(reading)
        page.get_by_role("button", name="Make the recording").click()
        page.get_by_text("120 steps of 3600 s").wait_for()
        page.get_by_role("button", name="Parameters").click()
        page.get_by_role("button", name="Stop").wait_for()
        page.get_by_text("fitting").wait_for()
        begin = time.monotonic()
        page.get_by_role("button", name="Stop").click()
        page.get_by_text("Stopped; what was simulated is kept").wait_for()
        assert time.monotonic() - begin < 10.0  # of a busy machine; the process itself is timed in test_project.py
        assert not (tmp_path / "room" / "calibration" / "calibration.html").exists()
        page.reload()
        page.get_by_text("120 steps of 3600 s").wait_for()  # the folder is the state
        page.get_by_role("button", name="Diagnosis").click()
        page.get_by_text("Diagnosis: done in").wait_for(timeout=600_000)
        page.get_by_text("Cause: The room sensor drifts").wait_for()
        answer = page.get_by_text("Cause: The room sensor drifts").text_content()
        assert "(drift)" in answer and "probability" in answer and "of the gap in room" in answer
        with page.expect_download() as download:
            page.get_by_text("Download the report").click()
        download.value.save_as(tmp_path / "report.html")
        shown = browser.new_page()
        outside = []
        shown.on("request", lambda one: outside.append(one.url) if one.url.startswith("http") else None)
        shown.goto((tmp_path / "report.html").as_uri())
        assert shown.get_by_role("heading", name="Measured minus model").is_visible() and not outside
        shown.close()
        copied = page.locator("pre").nth(1).text_content()
        compile(copied, "copied", "exec")
        assert "answer = diagnosis.diagnose(" in copied
