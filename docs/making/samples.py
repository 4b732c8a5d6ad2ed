"""Make the sample reports of ``docs/samples``: a page for each verdict, a forecast, and a picture of an answer.

    python docs/making/samples.py [NAME ...]

``effect`` is a week of the default room with equipment, which takes two minutes of processor time; ``forecast`` is that
of the README. The other two are of the gallery's house and take half a minute. Every random number comes from the seeds
below. The picture needs chromium.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import matplotlib

matplotlib.use("agg")
import numpy as np
from PIL import Image, ImageDraw, ImageFont

import datagen
import diagnosis

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "gallery"))
from house import Heat, build_fmu, measure

OUT = Path(__file__).resolve().parents[1] / "samples"
ROOM, HOURS, PLUG = 99, 168, 400.0
"""Seed and length [h] of the default room, and the heat of its equipment [W]."""
GUESTS, GUESTS_HEAT = 7, 900.0
"""Seed of the evenings on which the house has guests, and their heat [W]."""
CONTEXT = AHEAD = 168.0
"""Of the forecast: length of what is fitted, and of what is simulated [h]."""
EXAMPLE = OUT.parent / "example"
MARGIN = 32
"""Of the picture, for the numbers [pixels]."""
PARTS = (".head", ".answer p:nth-of-type(2)", ".answer p:nth-of-type(3)", ".answer p:nth-of-type(4)", ".zooms")
"""Parts of a report that are numbered in the picture: headline, where, which, how far, and measured minus model."""


def guests(moments: np.ndarray) -> np.ndarray:
    """Heat of guests [W] at times [s of the year]: from 19 to 23 h, on two of five evenings."""
    hour, day = moments / 3600 % 24, (moments // 86400).astype(int)
    come = np.random.default_rng(GUESTS).random(day.max() + 1) < 0.4
    return GUESTS_HEAT * (come[day] & (hour >= 19) & (hour < 23))


def effect(folder: Path) -> Path:
    """Equipment that a candidate describes, in the default room."""
    room = folder / "odd.nc"
    datagen.simulate("MixedAirCO2", parameters={"effect.plug.Q": PLUG}, hours=HOURS, seed=ROOM, out=room)
    diagnosis.diagnose("MixedAirCO2", room, out=folder / "answer")
    return folder / "answer"


def house(folder: Path, heat: Heat | float) -> Path:
    """A diagnosis of the gallery's house, which has that heat more than its model."""
    system = build_fmu(folder)
    measure(system, folder / "house.nc", heat=heat)
    diagnosis.diagnose(system, folder / "house.nc", out=folder / "answer")
    return folder / "answer"


def forecast(folder: Path) -> Path:
    """A week of the example's room, whose occupants were not counted, forecast from the week before."""
    diagnosis.import_recording(EXAMPLE / "mapping.toml", EXAMPLE / "measurements.csv", out=folder / "recording.nc")
    diagnosis.forecast("MixedAirCO2", folder / "recording.nc", context=CONTEXT, ahead=AHEAD, out=folder / "answer")
    return folder / "answer"


def annotated(page: Path, picture: Path) -> None:
    """The upper part of a report with a number at each of its parts."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": 1000, "height": 800})
        tab.goto(page.resolve().as_uri())
        tab.locator(".zooms .bk-Canvas").first.wait_for()
        places = [tab.locator(one).first.bounding_box() for one in PARTS]
        shown = tab.screenshot(clip={"x": 0, "y": 0, "width": 1000, "height": places[-1]["y"] + 300})
        browser.close()
    with Image.open(io.BytesIO(shown)) as opened:
        drawn = Image.new("RGB", (opened.width + MARGIN, opened.height), "white")
        drawn.paste(opened, (MARGIN, 0))
    pen, font = ImageDraw.Draw(drawn), ImageFont.load_default(18)
    for number, place in enumerate(places, 1):
        x, y = MARGIN - 14, place["y"] + min(place["height"], 40) / 2
        pen.ellipse((x - 14, y - 14, x + 14, y + 14), fill="#d9480f")
        pen.text((x, y), str(number), fill="white", font=font, anchor="mm")
    drawn.quantize(128, dither=Image.Dither.NONE).save(picture, "PNG", optimize=True)


SAMPLES: dict[str, Callable[[Path], Path]] = {
    "none_of_these": lambda folder: house(folder, guests),
    "no_gap": lambda folder: house(folder, 0.0),
    "forecast": forecast,
    "effect": effect,
}


def main() -> None:
    """Make the samples that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", default=list(SAMPLES), help=f"of {', '.join(SAMPLES)}")
    names = parser.parse_args().names
    if unknown := [name for name in names if name not in SAMPLES]:
        parser.error(f"there is no sample {', '.join(unknown)}; expected some of {', '.join(SAMPLES)}")
    OUT.mkdir(exist_ok=True)
    for name in names:
        began = time.process_time()
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            answer = SAMPLES[name](Path())
            kind = "forecast" if name == "forecast" else "report"
            if kind == "report":
                verdict = diagnosis.read_report(answer).verdict
                if verdict != name:
                    raise SystemExit(f"{name}: the verdict is {verdict}; nothing is written: choose another recording")
            shutil.copy(answer / f"{kind}.html", OUT / f"{name}.html")
            if name == "effect":  # which a notebook reads
                report = (answer / "report.json").read_text(encoding="utf-8").replace(f"{OUT.parents[1]}/", "")
                (OUT / "effect.json").write_text(report, encoding="utf-8")  # without where this checkout lies
                annotated(OUT / "effect.html", OUT / "effect.png")
        print(f"{name}: {time.process_time() - began:.0f} s of processor time, {OUT / f'{name}.html'}")  # noqa: T201


if __name__ == "__main__":
    main()
