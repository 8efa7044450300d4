"""Draws the pages of the workbench: docs/_static/contact_*.jpg at four widths, workbench_*.png.

    python docs/make_contact_sheets.py [--keep FOLDER] [--axe axe.min.js] [--widths 390,820]

Serves a new workspace with the sample project, does its jobs (calibration, plan, compensation,
drift check, certificate), and takes each page with Chromium, each width in another language and
theme. It says which pages are wider than their window, which texts are cut off, and, with the
script of axe-core (https://github.com/dequelabs/axe-core), which rules of WCAG A and AA they break.
"""

from __future__ import annotations

import argparse
import contextlib
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
from PIL import Image, ImageDraw
from playwright.sync_api import Page, sync_playwright

OUT: Final = Path(__file__).resolve().parent / "_static"
CHROMIUM: Final = "/usr/bin/chromium"
FLAGS: Final = (
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",
    "--disable-accelerated-2d-canvas",
    "--no-sandbox",
)
WIDTHS: Final = (1440, 1180, 820, 390)
HEIGHTS: Final = {1440: 1500, 1180: 1300, 820: 1700, 390: 1300}
LOOKS: Final = {
    1440: ("en", "light"), 1180: ("zh", "dark"), 820: ("zh", "light"), 390: ("en", "dark"),
}  # fmt: skip
"""Language and theme of the sheet of each width."""
THUMB: Final = {1440: 455, 1180: 360, 820: 260, 390: 170}
"""Pixels a picture is wide on a sheet."""
SHEET: Final = 1900
TALLEST: Final = 2.2
"""Longest part of a page that is shown, in widths (in heights of the window on a phone)."""
COMPOSITES: Final = {
    1440: ("workbench_cell.png", (1,), (1200, 958)),
    820: ("workbench_chinese.png", (1, 8, 12), (520, 960)),
    390: ("workbench_dark.png", (0, 7, 12, 13), (390, 1000)),
}
"""By width: picture of the guides, numbers of the pages side by side in it, size of each."""
SETTLED_MS: Final = 700
WAIT: Final = 600.0
"""s that a job may take."""
DRAWN: Final = """() => [...document.querySelectorAll('[data-component=scene]')].every(
  (e) => ['ready', 'fault'].includes(e.querySelector('[data-state]')?.dataset.state))"""
PARTS: Final = "() => !document.querySelector('[data-part] .progress.idle')"
MOUNTED: Final = """() => [...document.querySelectorAll('[data-component]')]
  .every((e) => e.__vue_app__)"""
CUT: Final = """() => [...document.querySelectorAll('body *')].filter((e) => {
  const style = getComputedStyle(e);
  if (!['hidden', 'clip'].includes(style.overflowX)) return false;
  if (style.textOverflow === 'ellipsis') return false;
  if (e.closest('[data-testid=scene]')) return false;
  return e.clientWidth > 4 && e.scrollWidth > e.clientWidth + 1 && e.innerText?.trim();
}).map((e) => e.tagName + '.' + e.className + ': ' + e.innerText.trim().slice(0, 40))"""


def main() -> None:
    """Takes all pages, writes the sheets, says what is wrong on stderr."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", type=Path, help="folder for the single pictures")
    parser.add_argument("--axe", type=Path, help="axe.min.js")
    parser.add_argument("--widths", default=",".join(map(str, WIDTHS)))
    parser.add_argument("--only", default="", help="part of the address of the pages to take")
    asked = parser.parse_args()
    script = asked.axe.read_text(encoding="utf-8") if asked.axe else ""
    with tempfile.TemporaryDirectory() as scratch, _serving(Path(scratch) / "shop") as address:
        pages = [each for each in fill(address) if asked.only in each]
        folder = asked.keep or Path(scratch)
        folder.mkdir(exist_ok=True)
        for width in map(int, asked.widths.split(",")):
            taken = _take(address, pages, width, folder, script)
            if not asked.only:
                draw_sheet(taken, width)
                if width in COMPOSITES:
                    draw_composite(taken, *COMPOSITES[width])


def fill(address: str) -> list[str]:
    """Fills a workspace by the HTTP interface; returns the addresses of its pages."""
    client = httpx.Client(base_url=address, timeout=WAIT)

    def do(kind: str, **parameters: object) -> Any:
        answer = client.post("/api/jobs", json={"kind": kind, "parameters": parameters})
        answer.raise_for_status()
        job, until = answer.json(), time.monotonic() + WAIT
        while not job["over"] and time.monotonic() < until:
            time.sleep(0.3)
            job = client.get(f"/api/jobs/{job['id']}").json()
        if job["state"] != "done":
            sys.stderr.write(f"{kind}: {job['state']} {job['error']}\n")
        return job["result"] or {}

    cell = client.post("/api/sample-project").json()["id"]
    sets = {
        each["name"]: each["id"] for each in client.get("/api/items/measurement").json()["items"]
    }
    (program,) = client.get("/api/items/program").json()["items"]
    held_out, training = (next(v for k, v in sets.items() if k.startswith(n)) for n in ("50", "80"))
    model = do("calibrate", cell=cell, measurements=[training])["model"]["id"]
    after = do("compensate", model=model, program=program["id"])["program"]["id"]
    plan = do("plan", cell=cell, model=model, poses=12, candidates=120)["document"]["id"]
    do("drift_plan", model=model, poses=7)
    check = do("drift", model=model, measurements=[held_out])["check"]["id"]
    do("report", model=model, measurements=[held_out])
    return [
        "/", "/cell", "/cell?new=1", f"/cell?cell={cell}&edit=1", "/plan", f"/plan?id={plan}",
        "/measurements", f"/measurements?id={held_out}", "/calibration", "/registration",
        "/programs", f"/programs?id={program['id']}&tolerance_mm=0.3",
        f"/programs?id={after}&tolerance_mm=0.3", "/drift", f"/drift?id={check}", "/drilling",
        "/live", "/tools", "/tools/calibrate", "/history", "/nowhere",
    ]  # fmt: skip


def _take(address: str, pages: list[str], width: int, folder: Path, axe: str) -> list[Path]:
    """The pictures of all pages at one width, in its language and theme."""
    language, theme = LOOKS[width]
    size = {"width": width, "height": HEIGHTS[width]}
    taken = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        context = browser.new_context(base_url=address, viewport=size, bypass_csp=True)
        chosen = f"language={language}&theme={theme}"
        context.add_cookies([{"name": "robotrue_view", "value": chosen, "url": address}])
        page = context.new_page()
        for number, place in enumerate(pages):
            page.goto(place)
            _settle(page)
            for fault in _find_faults(page, width, axe):
                sys.stderr.write(f"{width} {language} {theme} {place[:40]}: {fault}\n")
            name = re.sub(r"\W+", "_", place.partition("?")[0]).strip("_") or "overview"
            taken.append(folder / f"{width}_{language}_{theme}_{number:02d}_{name}.png")
            page.screenshot(path=taken[-1], full_page=True)
        browser.close()
    return taken


def _settle(page: Page) -> None:
    """Waits until parts that come later, and the 3-D view, are there."""
    page.wait_for_load_state("load")
    for arrived in (PARTS, MOUNTED, DRAWN):
        page.wait_for_function(arrived, timeout=60_000)
    page.wait_for_timeout(SETTLED_MS)


def _find_faults(page: Page, width: int, axe: str) -> Iterator[str]:
    for name in ("html", "#sheet"):
        over = page.evaluate(
            "(name) => { const e = document.querySelector(name);"
            " return e ? e.scrollWidth - e.clientWidth : 0 }",
            name,
        )
        if over > 0:
            yield f"{name} is {over} px too wide for {width}"
    for text in page.evaluate(CUT)[:5]:
        yield f"cut off: {text}"
    if axe:
        page.evaluate(axe)
        asked = "{runOnly: ['wcag2a', 'wcag2aa', 'wcag21aa']}"
        for broken in page.evaluate(f"axe.run(document, {asked})")["violations"]:
            places = [node["target"][0] for node in broken["nodes"]]
            yield f"{broken['impact']} {broken['id']}: {len(places)} x {places[:3]}"


def draw_sheet(pictures: list[Path], width: int) -> None:
    """Writes the sheet of one width."""
    thumb, gap = THUMB[width], 14
    per_row = (SHEET - gap) // (thumb + gap)
    tall = int(thumb * TALLEST if width <= 820 else thumb * 1.05)
    rows = -(-len(pictures) // per_row)
    sheet = Image.new("RGB", (SHEET, gap + rows * (tall + gap + 16)), "#808890")
    pen = ImageDraw.Draw(sheet)
    for k, path in enumerate(pictures):
        with Image.open(path) as picture:
            small = picture.convert("RGB")
        small = small.resize((thumb, max(1, round(small.height * thumb / small.width))))
        small = small.crop((0, 0, thumb, min(tall, small.height)))
        row, column = divmod(k, per_row)
        corner = (gap + column * (thumb + gap), gap + row * (tall + gap + 16))
        pen.text(corner, path.stem.partition("_")[2], fill="white")
        sheet.paste(small, (corner[0], corner[1] + 14))
    sheet.save(OUT / f"contact_{width}.jpg", quality=62, optimize=True)


def draw_composite(
    pictures: list[Path], name: str, numbers: tuple[int, ...], size: tuple[int, int]
) -> None:
    """Writes the upper parts of some pages side by side, each of ``size`` pixels."""
    (wide, tall), gap = size, 10 if len(numbers) > 1 else 0
    whole = (gap + len(numbers) * (wide + gap), tall + 2 * gap)
    composite = Image.new("RGB", whole, "#808890")
    for k, number in enumerate(numbers):
        with Image.open(pictures[number]) as picture:
            small = picture.convert("RGB")
        small = small.resize((wide, round(small.height * wide / small.width)))
        composite.paste(small.crop((0, 0, wide, tall)), (gap + k * (wide + gap), gap))
    composite.save(OUT / name, optimize=True)


@contextlib.contextmanager
def _serving(folder: Path) -> Iterator[str]:
    """Serves a new workspace on a free port."""
    start = "from robotrue.cli.main import run; run()"
    command = [sys.executable, "-c", start, "serve", str(folder), "--port", "0"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)  # noqa: S603
    try:
        for line in process.stderr or ():
            if found := re.search(r"at (https?://\S+)/", line):
                yield found[1]
                return
        raise SystemExit("the server did not come up.")
    finally:
        process.terminate()
        process.wait(15.0)


if __name__ == "__main__":
    main()
