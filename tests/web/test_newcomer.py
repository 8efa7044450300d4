"""Two walks of a newcomer with the mouse; no page then breaks a serious rule of axe-core."""

from __future__ import annotations

import importlib.resources
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import httpx
import numpy as np
import pytest
import shop
from newcomer import Newcomer
from serving import Watched, serving, watching
from web_shop import Served

from robotrue.core.arrays import Array
from robotrue.core.poses import apply, pose, pose_from_xyz_abc
from robotrue.core.units import DEG, MM
from robotrue.robot.configuration import controller_axes
from robotrue.robot.forward import forward
from robotrue.robot.inverse_numeric import solve

POSES: Final = 40
TOLERANCE_MM: Final = "0.5"
T_BASE_PART: Final = pose_from_xyz_abc(np.array([1.1, -0.2, 0.6]), np.array([0.05, 0.0, 0.0]))
ROUGH: Final = "1105, -195, 602, 3, 0, 0"
FEATURES: Final = {
    f"corner {k}": (x, y, z)
    for k, (x, y, z) in enumerate(
        [(0, 0, 0), (300, 0, 0), (300, 250, 0), (0, 250, 0), (150, 0, 80), (150, 250, 80)], 1
    )
}
PROGRAM: Final = """&ACCESS RVP
DEF pocket()
$BASE={X 1105,Y -195,Z 602,A 3,B 0,C 0}
$TOOL={X 60,Y 40,Z 250,A 0,B 0,C 0}
PTP {A1 0,A2 -80,A3 80,A4 0,A5 40,A6 0}
LIN {X 50.0,Y 50.0,Z 60.0,A 0,B 120,C 0}
LIN {X 250.0,Y 50.0,Z 60.0,A 0,B 120,C 0}
LIN {X 250.0,Y 200.0,Z 60.0,A 0,B 120,C 0}
LIN {X 50.0,Y 200.0,Z 60.0,A 0,B 120,C 0}
END
"""


@pytest.fixture(scope="module")
def sample(kernels: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with serving(tmp_path_factory.mktemp("sample") / "shop") as served:
        yield served


@pytest.fixture(scope="module")
def own(kernels: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    with serving(tmp_path_factory.mktemp("own") / "shop") as served:
        yield served


def test_sample_project_to_go_and_certificate(browser: Any, sample: Served) -> None:
    with watching(browser, sample) as watched:
        me, page = Newcomer(watched=watched), watched.page
        with me.step("open, add the practice cell"):
            page.goto("/")
            me.click("add-sample")
            page.locator("[data-stage=measure].done").wait_for()
        with me.step("calibrate on 80 poses"):
            me.click("next-step")
            assert watched.find("pick-set").first.is_checked()  # the set for the calibration
            me.click("calibrate")
            page.wait_for_url("**/calibration?model=*")
            me.wait("calibration-tiles")
        with me.step("compensate the program"):
            me.click("next-step")
            me.click(watched.find("programs").locator("tbody tr").first)
            me.click("compensate")
            me.wait("report-form")
            me.wait("verdict")
        with me.step("choose a tolerance"):
            me.click(watched.find("tolerance-offer").filter(has_text=TOLERANCE_MM))
            page.wait_for_url("**tolerance_mm=*")
            assert me.wait("verdict").locator("b").first.inner_text() == "GO"
        with me.step("certificate on the held-out poses"):
            me.click("nav-calibration")
            me.pick("report-set", "50 poses to check it")
            me.click(watched.find("report-head").locator("summary"))
            me.write(page.locator("[data-key=customer]"), "Shop 4")
            me.write(page.locator("[data-key=load_kg]"), "50")
            me.click("report-make")
            with page.expect_download() as coming:
                me.click(me.wait("report-pdf"))
            assert coming.value.suggested_filename.endswith(".pdf")
        page.goto(watched.find("report-html").first.get_attribute("href"))
        assert {"Shop 4", "50 kg"} <= set(page.locator("dd").all_inner_texts())
        sys.stdout.write(me.table("sample project to GO and certificate"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Files:
    """What a newcomer brings: axes typed from the pendant, points, features, a program."""

    axes: Path
    points: Path
    features: Path
    program: Path


def write_own_files(folder: Path) -> Files:
    """Simulated; the axes have the three decimals that the pendant shows."""
    axes = np.round(controller_axes(shop.nominal(), shop.postures(POSES, 3)) / DEG, 3)
    joints = shop.nominal().controller.to_model(axes * DEG)
    points = shop.points(joints, noise_seed=3) / MM
    remark = "# robotrue SIMULATED: virtual arm and tracker"
    heads = ("Name;A1;A2;A3;A4;A5;A6", "Name;X;Y;Z")
    tables = (axes, points)
    files = [folder / name for name in ("axes simulated.csv", "points simulated.csv")]
    for path, head, table in zip(files, heads, tables, strict=True):
        rows = [f"P{k};" + ";".join(f"{v:.4f}" for v in row) for k, row in enumerate(table, 1)]
        path.write_text("\n".join((remark, head, *rows)) + "\n")
    features = folder / "features simulated.csv"
    rows = [",".join(map(str, (name, *point))) for name, point in FEATURES.items()]
    features.write_text("\n".join((remark, "name,px_mm,py_mm,pz_mm", *rows)) + "\n")
    program = folder / "pocket.src"
    program.write_text(PROGRAM)
    return Files(axes=files[0], points=files[1], features=features, program=program)


def read_pendant(point_mm: list[float], asked_deg: list[float]) -> str:
    """The axes that a pendant shows where the real tip meets a point, near those asked for."""
    robot = shop.nominal()
    q = robot.controller.to_model(np.array([asked_deg]) * DEG)
    wanted: Array = apply(T_BASE_PART, np.array([point_mm]) * MM)
    turned, aim = forward(robot, q)[:, :3, :3], wanted
    for _ in range(4):
        q = solve(robot, pose(turned, aim), q).joints
        aim = aim + wanted - shop.points(q)
    return ", ".join(
        f"A{k} {value:.3f}" for k, value in enumerate(controller_axes(robot, q)[0] / DEG, 1)
    )


def test_own_pendant_file_to_a_compensated_registered_part(
    browser: Any, own: Served, tmp_path: Path
) -> None:
    files = write_own_files(tmp_path)
    with watching(browser, own) as watched:
        me, page = Newcomer(watched=watched), watched.page
        with me.step("cell by its form"):
            page.goto("/")
            me.click("next-step")
            me.pick("cell-robot", "KUKA KR160 R1570")
            for key, value in {"tool_x_mm": 60, "tool_y_mm": 40, "tool_z_mm": 250, "mass_kg": 50,
                               "centre_x_mm": 20, "centre_z_mm": 120}.items():  # fmt: skip
                me.write(f"cell-{key}", str(value))
            me.click("cell-keep")
            page.wait_for_url("**/cell?cell=*")
        with me.step("import axes and points"):
            me.click("nav-measurements")
            me.drop(files.points, files.axes)
            me.pick("join-by", "name")
            me.pick("join-joint_column", "joint list")
            me.pick("join-point_column", re.compile("^Name$"))
            me.click("look-again")
            me.wait("preview-ready")
            me.click("take-in")
            me.wait("rows")
        with me.step("calibrate"):
            me.click("calibrate-with")
            me.click("calibrate")
            page.wait_for_url("**/calibration?model=*")
            me.wait("calibration-tiles")
        with me.step("register the part, typed readings"):
            me.click("nav-registration")
            me.drop(files.features, mark="features-file")
            me.write("begin-frame", ROUGH)
            me.write("begin-tolerance", TOLERANCE_MM)
            me.click("begin")
            page.wait_for_url("**/registration?id=*")
            session = page.url.partition("id=")[2]
            for _ in FEATURES:
                me.wait("next")
                at = f"{own.address}/api/touching/{session}"
                seen = httpx.get(at, timeout=60.0, trust_env=False).json()
                point = seen["features"][seen["next"]["feature"]]["point_mm"]
                me.write("reading", read_pendant(point, seen["next"]["joints_deg"]))
                me.click("take")
                page.wait_for_function(
                    "v => document.querySelector('[data-testid=touch]')?.dataset.version > v",
                    arg=seen["version"],
                )
            me.click("finish")
            me.wait("frames")
        with me.step("compensate the program in that part"):
            me.click("use-for-program")
            me.drop(files.program)
            me.click("compensate")
            me.wait("report-form")
        with me.step("choose a tolerance, download"):
            me.click(watched.find("tolerance-offer").filter(has_text=TOLERANCE_MM))
            page.wait_for_url("**tolerance_mm=*")
            verdict = me.wait("verdict").locator("b").first.inner_text()
            with page.expect_download() as coming:
                me.click(watched.find("download").first)
            coming.value.save_as(tmp_path / "after.src")
        sys.stdout.write(me.table("own pendant file to a compensated registered part"))
    assert verdict == "GO"
    assert (tmp_path / "after.src").read_bytes() != files.program.read_bytes()


WIDTHS: Final = (1440, 1180, 820, 390)
TABLET: Final = 820
AUDITED: Final = (1440, 390)
"""Widths at which all rules are checked; dark, contrast alone."""
OVERFLOW: Final = """() => ['html', '#sheet'].map((name) => document.querySelector(name))
  .filter((each) => each && each.scrollWidth > each.clientWidth).map((each) => each.id || 'html')"""
ALONE: Final = """() => [...document.querySelectorAll('.tiles')].filter((each) => {
  const rows = [...each.children].map((tile) => tile.offsetTop);
  return rows.length > 1 && rows.filter((row) => row === rows.at(-1)).length === 1;
}).length"""
"""Groups of tiles whose last row is one tile."""
SERIOUS: Final = """async (rules) => {
  const found = await axe.run(document, rules ? {runOnly: rules} : {});
  return found.violations.filter((each) => ['serious', 'critical'].includes(each.impact))
    .map((each) => each.id + ': ' + each.nodes.map((node) => node.target[0]).join(' | '));
}"""


def addresses_of(served: Served) -> list[str]:
    """Every page of a workspace, and one of each of its items."""
    places = {
        "cell": ("/cell?cell={}", "/cell?cell={}&edit=1"),
        "measurement": ("/measurements?id={}",),
        "model": ("/calibration?model={}",),
        "program": (f"/programs?id={{}}&tolerance_mm={TOLERANCE_MM}", "/programs?id={}"),
        "registration": ("/registration?registration={}",),
    }
    pages = [
        "/", "/cell", "/cell?new=1", "/plan", "/measurements", "/calibration", "/registration",
        "/programs", "/drift", "/drilling", "/live", "/tools", "/tools/compensate", "/history",
        "/nowhere",
    ]  # fmt: skip
    with httpx.Client(base_url=served.address, timeout=60.0, trust_env=False) as client:
        items = {
            noun: client.get(f"/api/items/{noun}").json()["items"] for noun in (*places, "document")
        }
    for noun, forms in places.items():
        ids = [each["id"] for each in items[noun][: len(forms)]]
        pages += [form.format(id) for form, id in zip(forms, ids * 2, strict=False)]
    sessions = [each["id"] for each in items["document"] if each["kind"] == "touching"]
    return pages + [f"/registration?id={id}" for id in sessions[:1]]


def settle(page: Any) -> None:
    """Waits until the parts that come later and the components are there."""
    page.wait_for_function("!document.querySelector('[data-part]:has(.progress.idle)')")
    page.wait_for_function(
        "[...document.querySelectorAll('[data-component]')].every((each) => each.__vue_app__)"
    )


def audit(watched: Watched, address: str, axe: str) -> list[str]:
    """What is too wide, and what breaks a rule of axe-core seriously, on one page."""
    page, faults = watched.page, []
    page.set_viewport_size({"width": WIDTHS[0], "height": 1000})
    page.goto(address)
    settle(page)
    page.evaluate(axe)
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 1000})
        faults += [f"{address} at {width}: {name} too wide" for name in page.evaluate(OVERFLOW)]
        if width == TABLET and (alone := page.evaluate(ALONE)):
            faults.append(f"{address} at {width}: {alone} tiles alone in a row")
        for theme, rules in (("light", None), ("dark", ["color-contrast"])):
            if width in AUDITED:
                page.evaluate("theme => document.documentElement.dataset.theme = theme", theme)
                found = page.evaluate(SERIOUS, rules)
                faults += [f"{address} at {width}, {theme}: {each}" for each in found]
    return faults


def test_no_page_breaks_a_rule_seriously_or_overflows(
    browser: Any, sample: Served, own: Served
) -> None:
    """After the walks: every page of the practice project, and those of a registration."""
    package = pytest.importorskip("axe_playwright_python", reason="brings axe-core")
    axe = importlib.resources.files(package).joinpath("axe.min.js").read_text(encoding="utf-8")
    settings = {"bypass_csp": True, "color_scheme": "light", "reduced_motion": "reduce"}
    registered = [each for each in addresses_of(own) if each.startswith("/registration?")]
    faults = []
    for served, addresses in ((sample, addresses_of(sample)), (own, registered)):
        with watching(browser, served, **settings) as watched:
            watched.provoked = ("status of 404",)  # the page that does not exist
            for address in addresses:
                faults += audit(watched, address, axe)
    assert faults == []
