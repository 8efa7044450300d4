"""G-code, APT and CSV programs, from their bytes to bytes after which the tool lands on target."""

from __future__ import annotations

import cases
import numpy as np
import pytest

from robotrue.compensation import CompensationSettings, Status, compensate
from robotrue.compensation.difference import difference
from robotrue.core.poses import inverse
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM, UM
from robotrue.program.formats import list_unfollowed
from robotrue.program.lang import find_language
from robotrue.program.orientation import OrientationRule
from robotrue.program.program import FrameTable, Motion, Program
from robotrue.robot.forward import forward

JOINTS = np.array([5, -60, 70, 20, 50, 30]) * DEG + np.linspace(0, 0.3, 12)[:, None]
BEGINS = CompensationSettings(home=JOINTS[0])
MIRROR = np.diag([1.0, -1.0, -1.0])


def in_frame(frame: np.ndarray) -> np.ndarray:
    return inverse(frame) @ forward(cases.kr160(), JOINTS)


def spin_of(T: np.ndarray) -> float:
    """The spin the first pose has, by the rule."""
    axis = -T[:1, :3, 2]
    turn = OrientationRule(spin=0.0).rotations(axis)[0].T @ T[0, :3, :3]
    return float(np.arctan2(turn[1, 0], turn[0, 0]))


def table(frame: np.ndarray, spin: float) -> FrameTable:
    rule = OrientationRule(angles="rpy", spin=spin)
    named = {"G54": frame}
    return FrameTable(
        T_base_frame=frame, T_flange_tool=cases.TOOL, bases=named, tools={"T1": cases.TOOL},
        orientation=rule,
    )  # fmt: skip


def words(names: tuple[str, ...], values: np.ndarray, form: str, gap: str = " ") -> str:
    return gap.join(n + form % v for n, v in zip(names, values, strict=True))


def sinumerik(T: np.ndarray) -> str:
    rpy = abc_from_matrix(T[:, :3, :3])[:, ::-1] / DEG
    rows = [
        f"N{k} " + words(("X", "Y", "Z"), T[k, :3, 3] / MM, "%.4f")
        + " " + words(("A=", "B=", "C="), rpy[k], "%.4f")
        for k in range(len(T))
    ]  # fmt: skip
    return "\n".join(["G90 G71 G17", "T1", "G54", "TRAORI", "G1 F1000", *rows, "M30", ""])


def fanuc(T: np.ndarray) -> str:
    rows = [
        words(("X", "Y", "Z"), T[k, :3, 3] / MM, "%.4f", "")
        + words(("I", "J", "K"), -T[k, :3, 2], "%.6f", "")
        for k in range(len(T))
    ]  # fmt: skip
    return "\n".join(
        ["%", "G90 G21 G17", "T1", "G54", "G43.5 H1", "G1 F1000.", *rows, "M30", "%", ""]
    )


def heidenhain(T: np.ndarray) -> str:
    rows = [
        "LN " + words(("X", "Y", "Z"), T[k, :3, 3] / MM, "%+.4f")
        + " " + words(("TX", "TY", "TZ"), -T[k, :3, 2], "%+.6f")
        for k in range(len(T))
    ]  # fmt: skip
    lines = ["BEGIN PGM A MM", "TOOL CALL 1 Z", "M128", *rows, "END PGM A MM"]
    return "\n".join(f"{k} {line}" for k, line in enumerate(lines))


def apt(T: np.ndarray) -> str:
    rows = ["GOTO/" + ",".join(f"{v:.5f}" for v in [*row[:3, 3] / MM, *-row[:3, 2]]) for row in T]
    return "\n".join(["UNITS/MM", "MULTAX/ON", *rows, "FINI", ""])


def csv(T: np.ndarray) -> str:
    rows = [",".join(f"{v:.5f}" for v in [*row[:3, 3] / MM, *-row[:3, 2]]) for row in T]
    return "\n".join(["x_mm,y_mm,z_mm,i,j,k", *rows, ""])


MAKERS = {
    "sinumerik": sinumerik, "fanuc_gcode": fanuc, "heidenhain": heidenhain, "apt": apt,
    "toolpath_csv": csv,
}  # fmt: skip


def round_trip(name: str, data: bytes, frames: FrameTable) -> tuple[Program, Program, np.ndarray]:
    """The program, what became of it, and the errors (n, 3) m that are left."""
    program = find_language(name).read(data, name="part", frames=frames)
    assert not program.notes
    model = cases.rigid_model(robot=cases.kr160())
    result = compensate(model, program, settings=BEGINS)
    assert (result.status == Status.COMPENSATED).all()
    again = find_language(name).read(
        find_language(name).write(program, result.replacement), name="part", frames=frames
    )
    found = difference(program, again, model=model, home=BEGINS.home)
    assert np.linalg.norm(found.error_before, axis=1).min() > 0.2 * MM
    return program, again, found.error_after


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_the_tool_lands_on_target(name: str) -> None:
    T = in_frame(cases.FRAME)
    frames = table(cases.FRAME, spin_of(T))
    program, again, left = round_trip(name, MAKERS[name](T).encode(), frames)
    # Angles leave the last digit; a tool axis does not say by how much the correction spins it.
    assert np.abs(left).max() < (0.4e-6 if name == "sinumerik" else 6e-6)
    if name == "sinumerik":
        np.testing.assert_allclose(program.rotation, T[:, :3, :3], atol=2e-6)
    axis = frames.orientation.axes_of(program.rotation)
    np.testing.assert_allclose(axis, -T[:, :3, 2], atol=1e-5)
    assert len(again) == len(program)


def test_three_axes_keep_their_turn_and_land_all_the_same() -> None:
    first = forward(cases.kr160(), JOINTS)[0]
    frame = np.array(first)
    frame[:3, :3] = first[:3, :3] @ MIRROR
    steps = np.array([[10.0 * k, 5.0 * k, -2.0 * k] for k in range(8)])
    rows = [words(("X", "Y", "Z"), row, "%.4f") for row in steps]
    data = "\n".join(["%", "G90 G21", "T1", "G54", "G1 F100.", *rows, "M30", "%", ""]).encode()
    program, again, left = round_trip("fanuc_gcode", data, table(frame, 0.0))
    np.testing.assert_allclose(program.rotation, np.tile(MIRROR, (8, 1, 1)), atol=1e-12)
    assert np.abs(left).max() < 5e-6  # the turn of the correction is not written
    np.testing.assert_array_equal(again.rotation, program.rotation)


def test_arcs_of_a_plane_meet_their_corrected_ends() -> None:
    first = forward(cases.kr160(), JOINTS)[0]
    frame = np.array(first)
    frame[:3, :3] = first[:3, :3] @ MIRROR
    text = (
        "X0.0000 Y0.0000 Z0.0000 A180.0000 B0.0000 C0.0000\nG2 X50.0000 Y0.0000 I25.0000 J0.0000\n"
    )
    text += "G3 X90.0000 Y0.0000 R20.0000\nG1 X100.0000 Y10.0000"
    head = "%\nG90 G21 G17\nT1\nG54\nG43.4 H1\nG1 F100.\n"
    program, again, left = round_trip(
        "fanuc_gcode", (head + text + "\n%\n").encode(), table(frame, 0.0)
    )
    middle = program.motion == Motion.ARC_VIA
    assert np.abs(left[~middle]).max() < 0.4e-6
    assert np.linalg.norm(left[middle], axis=1).max() < 60e-6  # what lies out of the plane
    assert again.motion.tolist() == program.motion.tolist()


def test_what_is_not_written_is_told() -> None:
    T = in_frame(cases.FRAME)
    frames, model = table(cases.FRAME, spin_of(T)), cases.rigid_model(robot=cases.kr160())
    told = {}
    for name, make in MAKERS.items():
        program = find_language(name).read(make(T).encode(), name="part", frames=frames)
        new = compensate(model, program, settings=BEGINS).replacement
        told[name] = tuple(map(str, list_unfollowed(program, new)))
    assert told["sinumerik"] == ()  # three angles say all
    assert all("12 points print no word" in told[name][0] for name in told if name != "sinumerik")


def test_the_middle_of_an_arc_is_left_off_by_what_is_told() -> None:
    first = forward(cases.kr160(), JOINTS)[0]
    frame = np.array(first)
    frame[:3, :3] = first[:3, :3] @ MIRROR
    text = (
        "X0.00000 Y0.00000 Z0.00000 A180.00000 B0.00000 C0.00000\nG2 X50.00000 Y0.00000 I25.00000\n"
    )
    data = f"%\nG90 G21 G17\nT1\nG54\nG43.4 H1\nG1 F100.\n{text}%\n".encode()
    frames = table(frame, 0.0)
    program, _, left = round_trip("fanuc_gcode", data, frames)
    model = cases.rigid_model(robot=cases.kr160())
    (loss,) = list_unfollowed(program, compensate(model, program, settings=BEGINS).replacement)
    off = loss.worst
    middle = program.motion == Motion.ARC_VIA
    assert abs(np.linalg.norm(left[middle], axis=1).max() / UM - off) < 0.3
    assert off > 2.0
    assert str(loss).startswith("1 arcs stay in their plane")
