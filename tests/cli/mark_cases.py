"""Every command on the same small data, once simulated and once measured: files and words."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import shop
import touched
from test_probe_plan import CORNERS, DOWN, FRAME, posed
from test_program import apt, raster

from robotrue.core.provenance import Provenance, mark_line
from robotrue.core.rotations import matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.drilling.campaign_csv import write_campaign
from robotrue.dynamics.formats.dynamics_csv import sensor_csv, write_windows
from robotrue.measurement.formats.canonical import write_canonical
from robotrue.measurement.formats.part_points import write_points
from robotrue.measurement.measurement_set import MeasurementSet
from robotrue.measurement.probing_set import ProbingSet
from robotrue.robot.presets import preset
from robotrue.simulation.drilling_machine import drilling_machine, random_campaign
from robotrue.simulation.online_scenario import WRIST_ATTITUDES, online_scenario
from robotrue.store.model_file import read_model, write_model

sys.path.insert(0, str(Path(__file__).parents[1] / "dynamics"))
sys.path.insert(0, str(Path(__file__).parents[1] / "online"))
import pass_cases
from jog_cases import jog
from window_cases import planted, stated_arm

FOOT: Final = "[foot]\nradius_mm = 60\nangles_deg = [90, 210, 330]\n"
CUT: Final = """kind = "flat"
mode = "slot"
diameter_mm = 16
teeth = 2
helix_deg = 30
depth_mm = 1
width_mm = 16
feed_per_tooth_mm = 0.05
spindle_rpm = 3600
tangential_N_per_mm2 = 800
radial_N_per_mm2 = 170
axial_N_per_mm2 = 220
"""


@dataclass(frozen=True)
class Lab:
    """A folder of files whose names begin alike; the data say whether they are simulated."""

    folder: Path
    prefix: str
    origin: Provenance

    def __call__(self, name: str) -> Path:
        return self.folder / f"{self.prefix}{name}"

    @property
    def mark(self) -> str:
        return mark_line(self.origin)


@dataclass(frozen=True)
class Case:
    """One command.

    Attributes:
        words: Of the command line after the command, of a lab.
        report: Page it writes with ``--report``.
        made: Reports it writes anyway.
        files: Exports that permit a mark.
    """

    words: Callable[[Lab], tuple[object, ...]]
    report: str = ""
    made: tuple[str, ...] = ()
    files: tuple[str, ...] = ()

    @property
    def pages(self) -> tuple[str, ...]:
        """All pages."""
        return (*self.made, *((self.report,) if self.report else ()))


def fill(lab: Lab) -> None:
    """Writes the data of a lab as the writers of the product do."""
    lab.folder.mkdir(parents=True)
    lab("cell.toml").write_text(shop.CELL, encoding="utf-8")
    lab("part.src").write_bytes(shop.PROGRAM.encode("latin-1"))
    for name, count, seed in (("cal", 40, 1), ("test", 20, 3), ("few", 5, 5), ("seven", 7, 7)):
        joints = shop.postures(count, seed)
        position = shop.points(joints, noise_seed=seed + 1)
        rows = MeasurementSet(
            joints=joints,
            position=position,
            covariance=np.tile(1.5e-5**2 * np.eye(3), (count, 1, 1)),
            provenance=lab.origin,
        )
        write_canonical(lab(f"{name}.csv"), rows)
    shop.write_csv(lab("q.csv"), shop.postures(3, 9), None)
    _touches(lab)
    lab("top.apt").write_text(apt(raster()[:20]))
    _drilling(lab)
    _dynamics(lab)
    _streams(lab)
    _circles(lab)
    lab("steps.csv").write_text(lab.mark + "slot,step_mm\n1,0.68\n2,0.71\n3,0.73\n4,0.69\n")


def wire_lengths() -> str:
    """Lengths of wires from three eyelets to the reflector, 40 poses."""
    eyelets = np.array([[2.2, 1.4, 0.1], [2.0, -1.5, 0.2], [-0.5, 0.2, 2.6]])
    joints = shop.postures(40, 9)
    end = np.arange(len(joints)) % len(eyelets)
    length = np.linalg.norm(shop.points(joints, noise_seed=9) - eyelets[end], axis=1) / MM
    head = "j1_deg,j2_deg,j3_deg,j4_deg,j5_deg,j6_deg,length_mm,sigma_mm,anchor,ax_mm,ay_mm,az_mm\n"
    rows = zip(joints / DEG, length, end, strict=True)
    return head + "".join(
        ",".join(map(str, (*q, each, 0.02, "ABC"[k], *(eyelets[k] / MM + 5.0)))) + "\n"
        for q, each, k in rows
    )


def _circles(lab: Lab) -> None:
    """Points of a hole and of a turned reflector, and of a dry run."""
    turn = np.arange(12) * np.pi / 6.0
    circle = [f"{10.0 * np.cos(t):.9f},{10.0 * np.sin(t):.9f}" for t in turn]
    head = lab.mark + "x_mm,y_mm,z_mm\n"
    lab("wall.csv").write_text(head + "".join(f"{xy},{z}\n" for z in (0, -4) for xy in circle))
    lab("lengths.csv").write_text(lab.mark + wire_lengths())
    lab("turned.csv").write_text(head + "".join(f"{xy},250\n" for xy in circle))
    for name in ("dry_points.csv", "dry_before.csv"):
        lab(name).write_text(lab.mark + "point,x_mm,y_mm,z_mm\n1,0,0,0\n2,5,0,0\n3,9,0,0\n")


def _touches(lab: Lab) -> None:
    points, joints = touched.by_joints(12)
    names = tuple(f"K{k}" for k in range(12))
    write_points(
        lab("points.csv"),
        ProbingSet(names=names, point=points, joints=joints, provenance=lab.origin),
    )
    on, normals = touched.on_block(9)
    write_points(
        lab("blank.csv"),
        ProbingSet(
            names=tuple(f"B{k}" for k in range(9)), point=on, normal=normals,
            position=touched.in_base(on), provenance=lab.origin,
        ),
    )  # fmt: skip
    touched.block(lab("block.stl"))
    more, at = touched.by_joints(1, seed=9)
    for name, rows in (("pin.csv", 1), ("same.csv", 2)):
        write_points(
            lab(name),
            ProbingSet(
                names=("pin", "pin2")[:rows],
                point=np.repeat(more, rows, axis=0),
                joints=np.repeat(at, rows, axis=0),
                provenance=lab.origin,
            ),
        )
    write_points(
        lab("few_points.csv"),
        ProbingSet(names=names[:4], point=points[:4], joints=joints[:4], provenance=lab.origin),
    )
    leans = np.array([[0.3 * np.cos(k), 0.3 * np.sin(k), 0.5 * k] for k in range(12)])
    turns = matrix_from_rotation_vector(leans) @ DOWN[:3, :3]
    write_points(
        lab("one_place.csv"),
        ProbingSet(
            names=tuple(f"P{k}" for k in range(12)), point=np.zeros((12, 3)),
            joints=np.concatenate([posed(np.zeros((1, 3)), turn) for turn in turns]),
            provenance=lab.origin,
        ),
    )  # fmt: skip
    rows = [f"T{k},{x:g},{y:g},{z:g},0,0,1" for k, (x, y, z) in enumerate(CORNERS)]
    lab("features.csv").write_text("\n".join(["name,px_mm,py_mm,pz_mm,ax,ay,az", *rows]) + "\n")
    inner = np.add(CORNERS, [10.0, 10.0, -5.0])
    lines = ["name,px_mm,py_mm,pz_mm," + ",".join(f"j{i}_deg" for i in range(1, 7))]
    for p, q in zip(inner, posed(inner * MM, DOWN) / DEG, strict=True):
        lines.append("top," + ",".join(f"{v:.9f}" for v in (*p, *q)))
    lab("top.csv").write_text("\n".join(lines) + "\n")


def _drilling(lab: Lab) -> None:
    lab("foot.toml").write_text(FOOT)
    machine, random = drilling_machine(2), np.random.default_rng(2)
    for name, count in (("campaign.csv", 20), ("known.csv", 12)):
        campaign = random_campaign(machine, count, random, held_out=name == "known.csv")
        write_campaign(lab(name), replace(campaign, provenance=lab.origin))
    zero = "".join(f"0.1{k},0.2{k},0.3{k}\n" for k in range(5))
    lab("zero.csv").write_text(f"{lab.mark}raw1_mm,raw2_mm,raw3_mm\n{zero}")
    head = "left_a_deg,left_b_deg,d1_mm,d2_mm,d3_mm,force_N,z_mm\n"
    lab("records.csv").write_text(lab.mark + head + "0.01,-0.02,0.1,-0.05,0.02,500,0\n")


def _dynamics(lab: Lab) -> None:
    lab("cut.toml").write_text(CUT)
    f = np.arange(4.0, 200.0, 0.25)
    g = 1.0 / (2e6 * (1.0 - (f / 30.0) ** 2 + 0.06j * f / 30.0))
    _table(lab, "frf.csv", "f_Hz,Gyy_re_m_per_N,Gyy_im_m_per_N", [f, g.real, g.imag])
    t = np.arange(2000) / 2000.0
    push = np.where(t < 0.5, 50.0 * np.sin(4.0 * np.pi * t) ** 2, 0.0)
    _table(lab, "force.csv", "t_s,fx_N,fy_N,fz_N", [t, 0.0 * t, push, 0.0 * t])
    feed, edge = np.array([0.03, 0.05, 0.08, 0.12]), np.array([-30.0, 28.0, 2.2]) * 2.0 / np.pi
    slopes = zip((-85.0, 400.0, 140.0), edge, strict=True)
    forces = [slope * feed + push for slope, push in slopes]
    _table(lab, "slots.csv", "feed_per_tooth_mm,fx_mean_N,fy_mean_N,fz_mean_N", [feed, *forces])
    stiffness = ", ".join(f"{k:.0f}" for k in stated_arm().stiffness)
    lab("arm.toml").write_text(
        f'schema = 1\n[robot]\npreset = "irb6660"\nstiffness_Nm_per_rad = [{stiffness}]\n'
        "[tool]\nxyz_mm = [320, 0, 160]\n"
    )
    windows = replace(planted(passes=(0, 1), each=12), provenance=lab.origin)
    write_windows(lab("windows.csv"), windows)
    moved = pass_cases.joint_time()
    rows = np.column_stack([moved, pass_cases.joints_at(moved) / DEG]).T
    _table(lab, "pass_joints.csv", "t_s," + ",".join(f"j{k}_deg" for k in range(1, 7)), [*rows])
    rows = np.column_stack([pass_cases.force_time(), pass_cases.reading()]).T
    _table(lab, "pass_force.csv", "t_s,fx_N,fy_N,fz_N", [*rows])
    pass_cases.write_response(lab("spring.csv"))
    at_rest = online_scenario(0, "KR160").at_rest(WRIST_ATTITUDES, 0)
    lab("poses.csv").write_bytes(sensor_csv(WRIST_ATTITUDES, at_rest, lab.origin))


def _streams(lab: Lab) -> None:
    time = np.arange(250) * 4e-3
    joints = np.array([-20.0, -95.0, 105.0, 5.0, 70.0, -8.0]) + np.sin(time)[:, None]
    axes = ",".join(f"a{k}_deg" for k in range(1, 7))
    _table(lab, "joints.csv", f"t_s,{axes}", [time, *joints.T])
    time = np.arange(1000) * 1e-3
    force = np.array([-30.0, 60.0, 20.0]) + np.random.default_rng(1).standard_normal((1000, 3))
    _table(lab, "forces.csv", "t_s,fx_N,fy_N,fz_N", [time, *force.T])
    seen = jog(2)
    _table(lab, "jog.csv", f"t_s,{axes}", [seen.joint_time + 1.0, *(seen.joints / DEG).T])
    names = "t_s,fx_N,fy_N,fz_N,tx_Nm,ty_Nm,tz_Nm"
    _table(lab, "jog_force.csv", names, [seen.force_time + 1.0, *seen.wrench.T])


def _table(lab: Lab, name: str, head: str, columns: list[np.ndarray]) -> None:
    rows = (",".join(f"{v:.9g}" for v in row) for row in zip(*columns, strict=True))
    lab(name).write_text(lab.mark + "\n".join([head, *rows]) + "\n")


def _as_ur(lab: Lab) -> Path:
    """The calibrated errors on an arm of another maker."""
    stored = read_model(lab("m.rtm"))
    robot = preset("UR10").with_tool(stored.cell.robot.T_flange_tool)
    model, cell = replace(stored.model, robot=robot), replace(stored.cell, robot=robot)
    write_model(lab("ur.rtm"), model, cell)
    return lab("ur.rtm")


def _workspace(lab: Lab, *words: object) -> tuple[object, ...]:
    return (*words, "-w", lab.folder / "space")


CASES: Final[Mapping[str, Case]] = {
    "calibrate": Case(
        lambda f: (f("cell.toml"), f("cal.csv"), "-o", f("m.rtm"), "--method", "elastic"),
        report="cal.html",
    ),
    "transfer": Case(
        lambda f: (f("cell.toml"), "--source", f"old={f('m.rtm')}", "-o", f("t.rtm")),
        report="t.html",
    ),
    "calibrate-lengths": Case(
        lambda f: (f("cell.toml"), f("lengths.csv"), "-o", f("l.rtm"), "--method", "nominal")
    ),
    "validate": Case(
        lambda f: (f("m.rtm"), f("test.csv")), report="v.html"
    ),
    "predict": Case(lambda f: (f("m.rtm"), f("q.csv"), "-o", f("p.csv")), files=("p.csv",)),
    "similarity": Case(
        lambda f: (f("cell.toml"), f("cal.csv"), "-o", f("sim.csv"), "--divide", 2,
                   "--apart-mm", 900, "--curves", f("curves.csv")),
        report="sim.html",
        files=("sim.csv", "curves.csv"),
    ),
    "map": Case(
        lambda f: (f("m.rtm"), "-o", f("map.html"), "--region", "cylinder", "--angle-deg=-10,10",
                   "--radius-mm", "1000,1200", "--height-mm", "800,1000", "--grid", "2,2,2",
                   "--sectors", 1),
        made=("map.html",),
    ),
    "inspect": Case(lambda f: (f("m.rtm"),)),
    "drift": Case(lambda f: (f("m.rtm"), f("seven.csv"))),
    "drift-plan": Case(lambda f: (f("m.rtm"), "-o", f("check.csv"))),
    "plan": Case(
        lambda f: (f("cell.toml"), "-o", f("plan.csv"), "-n", 6, "--candidates", 60, "--model",
                   f("m.rtm")),
        report="plan.html",
    ),
    "probe-plan": Case(
        lambda f: (f("m.rtm"), "--part", f("features.csv"), "--machined", f("top.csv"), "--frame",
                   FRAME, "-n", 5, "-o", f("touch.csv")),
        report="touch.html",
    ),
    "register": Case(
        lambda f: (f("m.rtm"), f("points.csv"), "-o", f("placed.toml"), "--fit", "frame"),
        files=("placed.toml",),
    ),
    "blank-check": Case(
        lambda f: (f("placed.toml"), f("blank.csv"), "--mesh", f("block.stl"), "-o",
                   f("shifted.toml")),
        files=("shifted.toml",),
    ),
    "datum-check": Case(
        lambda f: (f("placed.toml"), f("pin.csv"), "--tolerance-mm", 5),
    ),
    "tool-point": Case(
        lambda f: (f("m.rtm"), f("pin.csv"), "--table", f("points.csv"), "-o", f("tooled.toml")),
    ),
    "tool-axis": Case(
        lambda f: (f("m.rtm"), f("same.csv"), "--normal", "0,0,1"),
    ),
    "mastering": Case(lambda f: (f("cell.toml"), f("one_place.csv"), "--tool-sigma-mm", 1)),
    "mastering-plan": Case(
        lambda f: (f("m.rtm"), "--point-mm", "1000,-200,500", "-n", 8, "-o", f("postures.csv"))
    ),
    "register-rounds": Case(
        lambda f: (f("placed.toml"), f("few_points.csv"), "-o", f("rounds.toml")),
        files=("rounds.toml",),
    ),
    "program": Case(
        lambda f: (f("placed.toml"), f("top.apt"), "-o", f("job.src"), "--model", f("m.rtm")),
        report="job.html",
        files=("job.src.identity.json",),
    ),
    "compensate": Case(
        lambda f: (f("m.rtm"), f("part.src"), "-o", f("after.src"), "--allow-steps"),
        files=("after.src.identity.json",),
    ),
    "wrap": Case(
        lambda f: (f("m.rtm"), "-o", f("rt_fix.src"), "--box-mm", "1100,1200,0,100,800,900",
                   "--attitude-deg", "0,160,0", "--turn-deg", "2,2,2", "--tolerance-mm", 0.1,
                   "--start", "0,-80,80,0,40,0"),
    ),
    "diff": Case(
        lambda f: (f("part.src"), f("after.src"), "--model", f("m.rtm"), "-o", f("diff.csv")),
        files=("diff.csv",),
    ),
    "export urdf": Case(
        lambda f: (f("m.rtm"), "-o", f("arm.urdf"), "--lossy", "gear,compliance"),
        files=("arm.urdf", "arm.compliance.json"),
    ),
    "export dh": Case(lambda f: (f("m.rtm"), "-o", f("dh.csv")), files=("dh.csv",)),
    "export controller": Case(
        lambda f: (f("m.rtm"), "-o", f("sheet.txt"), "--lossy", "geometry,gear,compliance"),
        files=("sheet.txt",),
    ),
    "export ur": Case(
        lambda f: (_as_ur(f), "-o", f("arm.yaml"), "--lossy", "gear,compliance"),
        files=("arm.yaml",),
    ),
    "export points": Case(lambda f: (f("cal.csv"), "-o", f("list.txt")), files=("list.txt",)),
    "report calibration": Case(
        lambda f: (f("m.rtm"), f("test.csv"), "-o", f("cert.html")), made=("cert.html",)
    ),
    "report program": Case(
        lambda f: (f("part.src"), f("after.src"), "--model", f("m.rtm"), "--tolerance-mm", 0.5,
                   "-o", f("go.html")),
        made=("go.html",),
    ),
    "report registration": Case(
        lambda f: (f("placed.toml"), "-o", f("reg.html")), made=("reg.html",)
    ),
    "dry-run-plan": Case(
        lambda f: (f("part.src"), "--model", f("m.rtm"), "--points", 3, "-o", f("dry.csv")),
        files=("dry.csv",),
    ),
    "dry-run": Case(lambda f: (f("dry_points.csv"), f("dry_before.csv"))),
    "hole": Case(lambda f: (f("wall.csv"), "--diameter-mm", 20)),
    "spindle-axis": Case(lambda f: (f("turned.csv"),)),
    "slot-test": Case(lambda f: (f("steps.csv"),)),
    "drill fit": Case(
        lambda f: (f("foot.toml"), f("campaign.csv"), "-o", f("d.rtm"), "--kind", "patent")
    ),
    "drill zero": Case(
        lambda f: (f("foot.toml"), f("zero.csv"), "-o", f("foot2.toml"))
    ),
    "drill evaluate": Case(lambda f: (f("d.rtm"), f("known.csv"))),
    "drill adjust": Case(
        lambda f: (f("d.rtm"), "--reading", "0.1,-0.05,0.02", "--force", 500, "--z", 0)
    ),
    "drill refine": Case(
        lambda f: (f("d.rtm"), f("records.csv"), "-o", f("d2.rtm"), "--truth", "gauge")
    ),
    "drill report": Case(
        lambda f: (f("d2.rtm"), f("known.csv"), "-o", f("drill.html")), made=("drill.html",)
    ),
    "dynamics frf": Case(
        lambda f: (f("frf.csv"), "-o", f("frf_out.csv")), files=("frf_out.csv",)
    ),
    "dynamics predict": Case(
        lambda f: ("--frf", f("frf.csv"), "--force", f("force.csv"), "-o", f("error.csv")),
        files=("error.csv",),
    ),
    "dynamics force": Case(lambda f: (f("cut.toml"), "--slots", f("slots.csv"))),
    "dynamics windows": Case(
        lambda f: (f("pass_force.csv"), "--joints", f("pass_joints.csv"), "--cell", f("arm.toml"),
                   "--frf", f("spring.csv"), "--between", "lines", "--spindle-rpm", "3000",
                   "--sensor-axes=-y,x,z", "-o", f("cut.csv")),
        files=("cut.csv",),
    ),
    "dynamics fit": Case(
        lambda f: (f("windows.csv"), "--cell", f("arm.toml"), "-o", f("dev.rtm"))
    ),
    "dynamics validate": Case(
        lambda f: (f("windows.csv"), "--model", f("dev.rtm"), "-o", f("dev.csv")),
        files=("dev.csv",),
    ),
    "dynamics sensor": Case(lambda f: (f("poses.csv"), "-o", f("tool.rtm"))),
    "sense run": Case(
        lambda f: (f("cell.toml"), "--robot", f"replay://{f('joints.csv')}", "--force",
                   f"replay://{f('forces.csv')}", "--record", f("record"), "--out",
                   f"csv:{f('live.csv')}"),
        files=("live.csv",),
    ),
    "sense align": Case(lambda f: (f("jog.csv"), f("jog_force.csv"), "-o", f("clock.json"))),
    "record info": Case(lambda f: (f("record"),)),
    "record export": Case(
        lambda f: (f("record"), "-o", f("est.csv"), "--stream", "estimates"), files=("est.csv",)
    ),
    "workspace add": Case(
        lambda f: _workspace(f, "measurement", f("cal.csv"), "--cell", "cell", "--name", "set")
    ),
    "workspace list": Case(lambda f: _workspace(f, "measurement")),
    "workspace show": Case(lambda f: _workspace(f, (f.folder / "set").read_text())),
    "workspace delete": Case(lambda f: _workspace(f, (f.folder / "set").read_text())),
    "workspace undo": Case(lambda f: _workspace(f, (f.folder / "set").read_text())),
    "jobs list": Case(lambda f: _workspace(f)),
    "jobs show": Case(lambda f: _workspace(f, (f.folder / "job").read_text())),
}  # fmt: skip
"""In the order of the work: what one writes, others read."""

WITHOUT_RESULT: Final[Mapping[str, str]] = {
    "demo": "always simulated, or measured with --data; marked by DemoResult, tested below",
    "reproduce": "always simulated; tests/cli/test_reproduce.py looks at its tables",
    "serve": "a server; its pages are tested in tests/web",
    "warm-up": "compiles kernels",
    "doctor": "checks the installation; tests/cli/test_doctor.py",
    "drill plan": "a sheet to fill in, made of the foot alone",
    "drill run": "answers a machine; tests/cli/test_drill_run.py looks at journal and answers",
    "simulate rsi": "always simulated; tests/cli/test_simulate.py",
    "simulate egm": "always simulated; tests/cli/test_simulate.py",
    "simulate rtde": "always simulated; tests/cli/test_simulate.py",
    "simulate rdt": "always simulated; tests/cli/test_simulate.py",
    "simulate drill": "always simulated; tests/cli/test_simulate_drill.py",
    "workspace init": "makes an empty workspace",
    "workspace history": "who did what to which item and when; no numbers",
    "workspace empty-bin": "names what is removed",
    "workspace export": "counts rows and files; the items in the file keep their provenance",
    "workspace import": "counts rows and files; the items in the file keep their provenance",
    "workspace verify": "compares hashes",
    "jobs submit": "the job waits and has no result",
    "jobs cancel": "the job ends without a result",
    "jobs run": "counts attempts",
}
"""Commands that print no result of data, and why."""
