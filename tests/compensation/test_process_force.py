"""Process force along a path: where it holds, and that it turns with what it is written in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.compensation.process_force import (
    DescribedForce,
    ForceRule,
    ForceTable,
    require_one_file,
)
from robotrue.compensation.process_force_file import read_force
from robotrue.core.arm_words import NO_WORD
from robotrue.core.poses import pose_from_xyz_abc
from robotrue.core.rotations import matrix_from_abc, matrix_from_rotation_vector
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError, ShapeError
from robotrue.program.cut_path import CutPath, cut_path
from robotrue.program.program import Motion, Program, Reason

LIN, PTP, VIA, END = Motion.LIN, Motion.PTP, Motion.ARC_VIA, Motion.ARC_END
Z = np.array([0.0, 0.0, 1.0])


def a_program(places, motions=None, *, rotation=None, frame=None, name="part.src") -> Program:
    """Targets at places (n, 3) mm, on lines 11, 12, ..., tool pointing down unless said."""
    n = len(places)
    down = np.diag([1.0, -1.0, -1.0]) if rotation is None else rotation
    return Program(
        name=name,
        dialect="krl",
        data=b"",
        position=np.asarray(places, dtype=float) * MM,
        rotation=np.broadcast_to(down, (n, 3, 3)),
        axes=np.full((n, 6), np.nan),
        motion=np.array([PTP] + [LIN] * (n - 1) if motions is None else motions, dtype=np.int64),
        reason=np.full(n, Reason.NONE),
        words=np.full((n, 2), NO_WORD),
        words_of="kuka",
        line=np.arange(11, 11 + n),
        frame=np.zeros(n, dtype=np.int64),
        tool=np.zeros(n, dtype=np.int64),
        T_base_frame=(np.eye(4) if frame is None else frame)[None],
        T_flange_tool=np.eye(4)[None],
    )


def rule(force, axes="base", lines=(), **more) -> ForceRule:
    return ForceRule(
        name=more.pop("name", "rule"),
        axes=axes,
        wrench=np.array([*force, 0.0, 0.0, 0.0][:6]),
        lines=np.array(lines, dtype=np.int64).reshape(-1, 2),
        **more,
    )


def wrench(force, program: Program, cutter=Z) -> np.ndarray:
    parts = force if isinstance(force, tuple) else (force,)
    return DescribedForce(parts=parts, cutter=cutter).wrench(cut_path(program, cutter=cutter))


SQUARE = [[0, 0, 0], [100, 0, 0], [100, 100, 0], [0, 100, 0], [0, 0, 0]]


class TestFeed:
    def test_arrival_at_corners(self) -> None:
        found = cut_path(a_program(SQUARE), cutter=Z).feed_direction
        assert np.isnan(found[0]).all()
        np.testing.assert_allclose(
            found[1:], [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], atol=1e-15
        )

    @pytest.mark.parametrize("motions", [[LIN] * 12, [LIN] + [VIA, END] * 5 + [LIN]])
    def test_a_circle_has_its_own_tangents(self, motions) -> None:
        angle = np.sort(np.random.default_rng(3).uniform(0.0, 250.0, 12)) * DEG
        places = 40.0 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        found = cut_path(a_program(places, motions), cutter=Z).feed_direction[1:-1]
        tangent = np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=1)[1:-1]
        wide = np.diff(angle)[:-1] + np.diff(angle)[1:] > 59.0 * DEG
        if motions[1] == VIA:
            wide[:] = False
        np.testing.assert_allclose(found[~wide], tangent[~wide], atol=1e-12)

    def test_length_of_arcs_is_that_of_the_arc(self) -> None:
        angle = np.array([0.0, 70.0, 250.0]) * DEG
        places = 40.0 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        found = cut_path(a_program(places, [PTP, VIA, END]), cutter=Z).along
        np.testing.assert_allclose(found, 0.04 * angle, atol=1e-12)

    def test_no_way_after_a_joint_move_takes_the_direction_of_leaving(self) -> None:
        found = cut_path(
            a_program([[0, 0, 0], [0, 0, 0], [0, 50, 0], [0, 50, 0]]), cutter=Z
        ).feed_direction
        np.testing.assert_allclose(found[1:], [[0, 1, 0]] * 3, atol=1e-15)

    def test_unused_points_are_not_on_the_way(self) -> None:
        program = a_program([[0, 0, 0], [500, 500, 500], [10, 0, 0]], [PTP, Motion.UNUSED, LIN])
        found = cut_path(program, cutter=Z)
        np.testing.assert_allclose(found.feed_direction[2], [1, 0, 0], atol=1e-15)
        assert np.isnan(found.along[1])
        assert found.along[2] == pytest.approx(0.01)

    def test_a_cutter_axis_has_a_length(self) -> None:
        with pytest.raises(ShapeError, match="length 0"):
            cut_path(a_program(SQUARE), cutter=np.zeros(3))

    def test_a_part_on_the_robot_is_refused(self) -> None:
        program = replace(a_program(SQUARE), held=np.array([False, False, True, False, False]))
        with pytest.raises(ConfigurationError, match=r"part\.src:13: the robot carries the part"):
            cut_path(program, cutter=Z)


class TestAxes:
    def test_base_axes(self) -> None:
        found = wrench(rule([1, 2, 3, 4, 5, 6]), a_program(SQUARE))
        assert not found[0].any()  # a joint move
        np.testing.assert_array_equal(found[1:], np.tile([1, 2, 3, 4, 5, 6], (4, 1)))

    def test_tool_axes(self) -> None:
        turn = matrix_from_abc(np.array([0.3, -0.4, 1.1]))
        frame = pose_from_xyz_abc(np.array([1.0, 2.0, 3.0]), np.array([0.7, 0.1, -0.2]))
        program = a_program(SQUARE, rotation=turn, frame=frame)
        found = wrench(rule([1, 2, 3, 4, 5, 6], "tool"), program)
        want = frame[:3, :3] @ turn
        np.testing.assert_allclose(found[1:, :3], np.tile(want @ [1, 2, 3], (4, 1)), atol=1e-14)
        np.testing.assert_allclose(found[1:, 3:], np.tile(want @ [4, 5, 6], (4, 1)), atol=1e-14)

    def test_path_axes_turn_with_the_feed(self) -> None:
        found = wrench(rule([10, 1, -5], "path"), a_program(SQUARE))
        np.testing.assert_allclose(
            found[1:, :3],
            [[10, 1, -5], [-1, 10, -5], [-10, -1, -5], [1, -10, -5]],
            atol=1e-13,
        )  # left of the feed seen from the spindle, which is above

    def test_in_a_plunge_only_the_axial_part_is_left(self) -> None:
        places = [[0, 0, 50], [0, 0, 0], [100, 0, 0]]
        found = wrench(rule([10, 1, -5, 7, 8, 9], "path"), a_program(places))
        np.testing.assert_allclose(found[1], [0, 0, -5, 0, 0, 9], atol=1e-13)
        np.testing.assert_allclose(found[2], [10, 1, -5, 7, 8, 9], atol=1e-13)

    @pytest.mark.parametrize("axes", ["tool", "path"])
    def test_rotating_the_job_rotates_the_force(self, axes) -> None:
        rng = np.random.default_rng(5)
        places = np.cumsum(rng.normal(size=(40, 3)) * [30, 30, 3], axis=0)
        turns = matrix_from_rotation_vector(rng.normal(size=(40, 3)))
        motions = np.where(rng.random(40) < 0.15, PTP, LIN)
        one = a_program(places, motions, rotation=turns)
        frame = pose_from_xyz_abc(rng.normal(size=3), rng.normal(size=3))
        force = rule(rng.normal(size=6), axes)
        first, second = wrench(force, one), wrench(force, replace(one, T_base_frame=frame[None]))
        turn = frame[:3, :3]
        np.testing.assert_allclose(second[:, :3], first[:, :3] @ turn.T, atol=1e-12)
        np.testing.assert_allclose(second[:, 3:], first[:, 3:] @ turn.T, atol=1e-12)
        assert np.abs(first).max() > 0.1

    def test_spinning_the_tool_turns_no_path_force(self) -> None:
        spun = np.diag([1.0, -1.0, -1.0]) @ matrix_from_abc(np.array([0.8, 0.0, 0.0]))
        force = rule([10, 1, -5], "path")
        np.testing.assert_allclose(
            wrench(force, a_program(SQUARE)), wrench(force, a_program(SQUARE, rotation=spun)),
            atol=1e-13,
        )  # fmt: skip

    def test_an_unknown_pose_carries_no_force_of_its_own_axes(self) -> None:
        program = a_program(SQUARE)
        lost = replace(program, T_base_frame=np.full((1, 4, 4), np.nan))
        for axes in ("tool", "path"):
            assert not wrench(rule([1, 2, 3], axes), lost).any()


class TestWhere:
    def test_lines_and_the_rule_for_all_others(self) -> None:
        found = wrench(
            (rule([1, 0, 0], lines=[[12, 12], [15, 15]]), rule([0, 2, 0])), a_program(SQUARE)
        )
        np.testing.assert_array_equal(found[:, :2], [[0, 0], [1, 0], [0, 2], [0, 2], [1, 0]])

    def test_kinds_of_move(self) -> None:
        program = a_program(SQUARE, [LIN, LIN, VIA, END, PTP])
        found = wrench(rule([1, 0, 0], motions=(VIA, END)), program)
        np.testing.assert_array_equal(found[:, 0], [0, 0, 1, 1, 0])

    def test_two_parts_for_one_target_are_refused(self) -> None:
        parts = (rule([1, 0, 0], lines=[[12, 13]], name="a"), rule([1, 0, 0], lines=[[13, 14]]))
        with pytest.raises(ConfigurationError, match="'a' and 'rule' both name line 13 of part"):
            wrench(parts, a_program(SQUARE))
        with pytest.raises(ConfigurationError, match="both name line 12"):
            wrench((rule([1, 0, 0], name="a"), rule([1, 0, 0])), a_program(SQUARE))

    def test_general_rules_for_different_moves_do_not_collide(self) -> None:
        program = a_program(SQUARE, [LIN, LIN, VIA, END, PTP])
        found = wrench(
            (rule([1, 0, 0], motions=(VIA, END)), rule([2, 0, 0], motions=(LIN,))), program
        )
        np.testing.assert_array_equal(found[:, 0], [2, 2, 1, 1, 0])

    def test_lines_without_a_target_are_refused(self) -> None:
        with pytest.raises(ConfigurationError, match="no cutting target in lines 80 to 90"):
            wrench(rule([1, 0, 0], lines=[[80, 90]]), a_program(SQUARE))

    def test_what_was_used_is_said(self) -> None:
        force = DescribedForce(
            parts=(rule([3, 4, 0], lines=[[12, 13]], name="side"), rule([0, 0, 2]))
        )
        _, uses = force.apply(cut_path(a_program(SQUARE), cutter=Z))
        assert [(u.name, u.targets, u.first_line, u.last_line, u.force) for u in uses] == [
            ("side", 2, 12, 13, (5.0, 5.0)),
            ("rule", 2, 14, 15, (2.0, 2.0)),
        ]

    def test_rapids_carry_no_force_and_feeds_choose(self) -> None:
        feed = np.array([np.inf, 0.05, np.inf, 0.01, 0.002])
        path = cut_path(a_program(SQUARE), cutter=Z, feed=feed)

        def found(*parts):
            return DescribedForce(parts=parts, cutter=Z).wrench(path)[:, 0]

        np.testing.assert_array_equal(found(rule([1, 0, 0])), [0, 1, 0, 1, 1])
        slow = rule([1, 0, 0], feeds=(0.0, 0.01), name="slow")
        fast = rule([2, 0, 0], feeds=(0.02, 0.06), name="fast")
        np.testing.assert_array_equal(found(slow, fast), [0, 2, 0, 1, 1])
        with pytest.raises(FormatError, match="a joint move or a rapid"):
            found(table("line", [13], [[1, 0, 0]]))
        unknown = cut_path(a_program(SQUARE), cutter=Z)
        with pytest.raises(ConfigurationError, match=r"'slow' .* line 12 of part\.src is not"):
            DescribedForce(parts=(slow,), cutter=Z).wrench(unknown)

    def test_a_model_of_the_process(self) -> None:
        class Drag:
            def wrench(self, path: CutPath) -> np.ndarray:
                out = np.zeros((len(path), 6))
                out[path.feeding, :3] = -50.0 * path.feed_direction[path.feeding]
                return out

        part = ForceRule(name="drag", axes="base", model=Drag(), lines=np.array([[12, 13]]))
        found = wrench((part,), a_program(SQUARE))
        np.testing.assert_allclose(
            found[:, :2], [[0, 0], [-50, 0], [0, -50], [0, 0], [0, 0]], atol=1e-12
        )

    def test_a_job_of_several_files(self) -> None:
        paths = [cut_path(a_program(SQUARE, name=name), cutter=Z) for name in ("a.src", "b.src")]
        require_one_file(DescribedForce(parts=(rule([1, 0, 0]),)), paths)
        named = rule([1, 0, 0], lines=[[12, 12]], program="b.src")
        require_one_file(DescribedForce(parts=(named,)), paths)
        assert not DescribedForce(parts=(named,)).wrench(paths[0]).any()
        assert DescribedForce(parts=(named,)).wrench(paths[1]).any()
        for bad, why in ((replace(named, program=""), "a.src, b.src have"),
                         (replace(named, program="c.src"), "is for c.src")):  # fmt: skip
            with pytest.raises(ConfigurationError, match=why):
                require_one_file(DescribedForce(parts=(bad,)), paths)


def table(key, at, forces, axes="base") -> ForceTable:
    return ForceTable(
        name="t", axes=axes, key=key, at=np.array(at, dtype=float),
        wrench=np.concatenate([np.array(forces, dtype=float), np.zeros((len(at), 3))], axis=1),
        source="f.csv", rows=np.arange(2, 2 + len(at)),
    )  # fmt: skip


class TestTables:
    def test_by_line_and_by_target(self) -> None:
        for key, at in (("line", [14, 12]), ("target", [4, 2])):
            found = wrench(table(key, at, [[0, 1, 0], [0, 2, 0]]), a_program(SQUARE))
            np.testing.assert_array_equal(found[:, 1], [0, 2, 0, 1, 0])

    def test_by_length_of_path(self) -> None:
        found = wrench(
            table("path_mm", np.array([0, 200, 350]) * MM, [[0, 0, 0], [20, 0, 0], [20, 0, 0]]),
            a_program(SQUARE),
        )
        np.testing.assert_allclose(found[:, 0], [0, 10, 20, 20, 0], atol=1e-12)

    def test_rules_hold_where_a_table_does_not(self) -> None:
        found = wrench((rule([5, 0, 0]), table("line", [13], [[7, 0, 0]])), a_program(SQUARE))
        np.testing.assert_array_equal(found[:, 0], [0, 5, 7, 5, 5])

    def test_what_does_not_fit_the_program(self) -> None:
        cases = [
            (table("line", [12, 99], [[1, 0, 0]] * 2), "f.csv:3: line 99 of part.src: there is no"),
            (table("target", [6], [[1, 0, 0]]), "f.csv:2: target 6"),
            (table("line", [11], [[1, 0, 0]]), "reached by a joint move"),
            (table("path_mm", [0.0, 4.1], [[1, 0, 0]] * 2), "goes to 4100.000, .* 400.000 mm"),
        ]
        for bad, why in cases:
            with pytest.raises(FormatError, match=why):
                wrench(bad, a_program(SQUARE))
        assert not wrench(table("line", [11], [[0, 0, 0]]), a_program(SQUARE)).any()

    def test_places_stand_once(self) -> None:
        with pytest.raises(FormatError, match=r"f\.csv:4: line 12 occurs again"):
            table("line", [12, 13, 12], [[1, 0, 0]] * 3)
        with pytest.raises(FormatError, match=r"f\.csv:3: path_mm 5 "):
            table("path_mm", [0.005, 0.005], [[1, 0, 0]] * 2)


class TestFile:
    def read(self, folder: Path, text: str, name: str = "f.toml") -> DescribedForce:
        (folder / name).write_text(text, encoding="utf-8")
        return read_force(folder / name)

    def test_a_description(self, tmp_path: Path) -> None:
        (tmp_path / "t.csv").write_text("line;fx_N;fy_N;fz_N;mx_Nm;my_Nm;mz_Nm\n15;1,5;0;0;0;0;2\n")
        force = self.read(
            tmp_path,
            """
[[force]]
axes = "path"
force_N = [-40, 120.5, -60]
lines = [[12, 13]]
moves = ["line"]
[[force]]
csv = "t.csv"
[[force]]
name = "rest"
force_N = [0, 0, -9]
moment_Nm = [0, 0, 1]
""",
        )
        found = DescribedForce(parts=force.parts, cutter=Z).wrench(
            cut_path(a_program(SQUARE), cutter=Z)
        )
        np.testing.assert_allclose(
            found[:, :3],
            [[0, 0, 0], [-40, 120.5, -60], [-120.5, -40, -60], [0, 0, -9], [1.5, 0, 0]],
            atol=1e-12,
        )
        np.testing.assert_allclose(found[:, 5], [0, 0, 0, 1, 2], atol=1e-12)
        assert [part.name for part in force.parts] == ["force 1", "t.csv", "rest"]

    def test_a_table_alone(self, tmp_path: Path) -> None:
        force = self.read(tmp_path, "path_mm,fx_N,fy_N,fz_N\n0,1,0,0\n300,1,0,0\n", "f.csv")
        found = force.wrench(cut_path(a_program(SQUARE), cutter=Z))
        np.testing.assert_array_equal(found[:, 0], [0, 1, 1, 1, 0])

    @pytest.mark.parametrize(
        ("text", "line", "message"),
        [
            ("", None, "no [[force]] table"),
            ("force = 3", 1, "no [[force]] table"),
            ("[forces]\n", 1, "unknown key forces"),
            ("[[force]]\nforce = [1,2,3]\n", 2, "unknown key force in"),
            ("[[force]]\naxes = 'base'\n", 1, "neither force_N nor milling nor csv"),
            ("[[force]]\nforce_N=[1,2,3]\ncsv='a'\n", 1, "force_N and csv in one"),
            ("[[force]]\nforce_N = [1, 2]\n", 2, "force_N is [1, 2], expected three numbers"),
            ("[[force]]\nforce_N = [1, 2, nan]\n", 2, "expected three numbers"),
            ("[[force]]\nforce_N = [1, 2, 1e9]\n", 2, "at most 100000"),
            ("[[force]]\nforce_N = [1, 2, true]\n", 2, "expected three numbers"),
            ("[[force]]\nforce_N = [1,2,3]\naxes = 'feed'\n", 3, "axes is 'feed'"),
            ("[[force]]\nforce_N = [1,2,3]\naxes = 7\n", 3, "axes is 7"),
            ("[[force]]\nforce_N = [1,2,3]\nlines = [12, 13]\n", 3, "lines is [12, 13]"),
            ("[[force]]\nforce_N = [1,2,3]\nlines = [[13, 12]]\n", 3, "lines is"),
            ("[[force]]\nforce_N = [1,2,3]\nlines = []\n", 3, "lines is []"),
            ("[[force]]\nforce_N = [1,2,3]\nmoves = ['ptp']\n", 3, "moves is ['ptp']"),
            ("[[force]]\nforce_N = [1,2,3]\nfeeds_mm_per_s = [9, 1]\n", 3, "feeds_mm_per_s is"),
            ("[[force]]\nforce_N = [1,2,3]\nprogram = 5\n", 3, "program is 5"),
            ("[[force]]\ncsv = 't.csv'\nlines = [[1,2]]\n", 3, "lines is given together with csv"),
            ("[[force]]\nmilling = 3\n", 2, "milling is no table"),
            ("[[force]]\nforce_N = [1,2,3]\n\n[[force]]\nmoment_Nm = [1]\n", 4, "neither"),
        ],
    )
    def test_bad_descriptions(self, tmp_path: Path, text: str, line, message: str) -> None:
        with pytest.raises(ConfigurationError) as caught:
            self.read(tmp_path, text)
        assert message in caught.value.message
        assert caught.value.source == str(tmp_path / "f.toml")
        assert caught.value.line == line
        assert caught.value.hint

    @pytest.mark.parametrize(
        ("text", "line", "message"),
        [
            ("line,fx_N,fy_N\n1,2,3\n", 1, "no column fz_N"),
            ("fx_N,fy_N,fz_N\n1,2,3\n", 1, "here is none"),
            ("line,target,fx_N,fy_N,fz_N\n1,1,2,3,4\n", 1, "are line and target"),
            ("line,fx_kN,fy_N,fz_N\n1,2,3,4\n", 1, "unknown column 'fx_kN'"),
            ("line,fx_N,fy_N,fz_N,mx_Nm\n1,2,3,4,5\n", 1, "no column my_Nm"),
            ("line,fx_N,fy_N,fz_N\n1.5,2,3,4\n", 2, "expected a whole number"),
            ("line,fx_N,fy_N,fz_N\n0,2,3,4\n", 2, "expected a whole number"),
            ("line,fx_N,fy_N,fz_N\n1,x,3,4\n", 2, "fx_N is x"),
            ("line,fx_N,fy_N,fz_N\n1,2,3,nan\n", 2, "fz_N is nan"),
            ("line,fx_N,fy_N,fz_N\n1,2,3,4\n1,2,3,4\n", 3, "line 1 occurs again"),
            ("path_mm,fx_N,fy_N,fz_N\n5,2,3,4\n4,2,3,4\n", 3, "path_mm 4 "),
            ("line,fx_N,fy_N,fz_N\n1,2e7,3,4\n", 2, "at most 100000"),
            ("", None, "empty"),
        ],
    )
    def test_bad_tables(self, tmp_path: Path, text: str, line, message: str) -> None:
        with pytest.raises(FormatError) as caught:
            self.read(tmp_path, text, "f.csv")
        assert message in caught.value.message
        assert caught.value.source == str(tmp_path / "f.csv")
        assert caught.value.line == line

    def test_not_toml(self, tmp_path: Path) -> None:
        (tmp_path / "f.toml").write_bytes(b"[[force]]\nname = '\xff'\n")
        with pytest.raises(ConfigurationError, match=r"f\.toml:2: .* not UTF-8"):
            read_force(tmp_path / "f.toml")
        with pytest.raises(ConfigurationError, match="not TOML"):
            self.read(tmp_path, "[[force]\n")
        with pytest.raises(ConfigurationError, match="not TOML"):
            self.read(tmp_path, "a = " + "[" * 5000)
