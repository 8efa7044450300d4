"""The free rotation about the tool axis: what may change, what must not, and what it wins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cases import TableModel, kr160, with_errors

from robotrue.calibration.terms.term import rigid_tables
from robotrue.compensation.compensate import compensate
from robotrue.compensation.process_force import DescribedForce, ForceRule
from robotrue.compensation.redundancy import (
    FreeSpinSettings,
    across,
    bending,
    choose_spins,
    stiffness,
)
from robotrue.compensation.redundancy_path import dense_run, runs_of
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.status import Status
from robotrue.core.arm_words import NO_WORD
from robotrue.core.poses import pose, pose_from_xyz_abc
from robotrue.core.rotations import matrix_from_rotation_vector, rotation_vector_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.program.cut_path import cut_path
from robotrue.program.program import Motion, Program, Reason
from robotrue.robot.configuration import configuration_words
from robotrue.robot.inverse import branches_of, inverse_path, require_opw
from robotrue.robot.model import parameter_slice
from robotrue.robot.spin import Grid, SpinSettings, best_way
from robotrue.robot.statics import Load, deflect_arm

LIN, PTP, VIA, END = Motion.LIN, Motion.PTP, Motion.ARC_VIA, Motion.ARC_END
Z = np.array([0.0, 0.0, 1.0])
SIDEWAYS = pose_from_xyz_abc(np.array([120.0, 0.0, 200.0]) * MM, np.array([0.0, 90.0, 0.0]) * DEG)
ROBOT = kr160(SIDEWAYS)
MODEL = TableModel(tables=rigid_tables(with_errors(ROBOT, 3)))
HOME = ROBOT.limits.mean(axis=1)
STANDS = CompensationSettings(home=HOME)
FREE = FreeSpinSettings(spin=SpinSettings(cutter=Z))
FRAME = pose(np.eye(3), np.array([1.0, 0.0, 0.5]))


def circle(n: int = 80, *, motions=None, **more) -> Program:
    """Once round a circle of 250 mm, the tool down; as written A5 and A6 come to their limits."""
    angle = np.linspace(0.0, 2.0 * np.pi, n)
    values = {
        "name": "c.src",
        "dialect": "krl",
        "data": b"",
        "position": 0.25 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1),
        "rotation": np.tile(np.diag([-1.0, 1.0, -1.0]), (n, 1, 1)),
        "axes": np.full((n, 6), np.nan),
        "motion": np.array([PTP] + [LIN] * (n - 1) if motions is None else motions),
        "reason": np.full(n, Reason.NONE),
        "words": np.full((n, 2), NO_WORD),
        "words_of": "kuka",
        "line": np.arange(1, n + 1),
        "frame": np.zeros(n, dtype=np.int64),
        "tool": np.zeros(n, dtype=np.int64),
        "T_base_frame": FRAME[None],
        "T_flange_tool": SIDEWAYS[None],
    }
    return Program(**(values | more))


def pushed(program: Program, force=(-40.0, 120.0, -60.0)) -> CompensationSettings:
    rule = ForceRule(name="cut", axes="path", wrench=np.array([*force, 0.0, 0.0, 0.0]))
    found = DescribedForce(parts=(rule,), cutter=Z).wrench(cut_path(program, cutter=Z))
    return CompensationSettings(wrench=found, home=HOME)


@pytest.fixture(scope="module")
def spun():
    program = circle()
    return program, choose_spins(MODEL, program, FREE, settings=pushed(program))


class TestCost:
    def test_bending_is_what_statics_say(self) -> None:
        rng = np.random.default_rng(1)
        compliance = np.array(with_errors(ROBOT, 3).error("compliance"))
        errors = np.zeros_like(ROBOT.errors)
        errors[parameter_slice(6, "compliance")] = compliance
        soft = ROBOT.with_errors(errors)
        low, high = ROBOT.limits.T
        joints = low + (high - low) * rng.random((30, 6))
        wrench = rng.normal(size=(30, 6)) * [300.0, 300.0, 300.0, 20.0, 20.0, 20.0]
        held = deflect_arm(soft, joints, Load(wrench=wrench))[0].position
        free = deflect_arm(soft, joints, Load(wrench=np.zeros((30, 6))))[0].position
        found = bending(ROBOT, compliance, joints, wrench)
        np.testing.assert_allclose(found, held - free, atol=2e-3 * np.abs(found).max())

    def test_across_and_stiffness(self) -> None:
        moved = np.array([[3e-5, 4e-5, 0.0]] * 2)
        found = across(moved, np.array([[1.0, 0.0, 0.0], [np.nan] * 3]))
        np.testing.assert_allclose(found, [[0.0, 4e-5, 0.0], [3e-5, 4e-5, 0.0]])
        force = np.array([[30.0, 40.0, 0.0, 0, 0, 0], [0.0] * 6])
        np.testing.assert_allclose(stiffness(force, moved), [1e6, np.nan])

    def test_what_the_caller_adds_decides(self) -> None:
        joints = np.tile(np.array([0.0, -0.3, 0.5, 0.1, 0.8, 0.2]), (4, 1, 6, 1))
        extra = np.ones((4, 1, 6))
        extra[:, 0, 4] = 0.0
        spin = np.tile(np.arange(6) * 60.0 * DEG, (4, 1))
        grid = Grid(joints=joints, spin=spin, length=np.full(4, 0.02), circular=True, extra=extra)
        way = best_way(ROBOT, require_opw(ROBOT), grid, FREE.spin)
        np.testing.assert_allclose(np.mod(way.spin, 2.0 * np.pi), 240.0 * DEG)


class TestPath:
    def test_dense_points_lie_on_the_circle(self) -> None:
        angle = np.array([0.0, 0.0, 100.0, 250.0]) * DEG
        place = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
        place[0] = [1.0, -0.5, 0.0]
        found = dense_run(place, np.tile(np.eye(3), (4, 1, 1)), np.array([PTP, LIN, VIA, END]))
        np.testing.assert_allclose(found.position[found.at], place, atol=1e-12)
        arc = found.position[found.target > 1]
        np.testing.assert_allclose(np.linalg.norm(arc, axis=1), 1.0, atol=1e-12)
        np.testing.assert_allclose(np.diff(found.along[found.at]), [0.5, *np.diff(angle[1:])])
        apart = np.linalg.norm(np.diff(found.position, axis=0), axis=1)
        assert apart.max() <= 20.0 * MM + 1e-12
        np.testing.assert_allclose(found.share[found.at], [1.0, 1.0, 0.4, 1.0])

    def test_attitudes_turn_evenly(self) -> None:
        turn = matrix_from_rotation_vector(np.array([[0.0] * 3, [0.0] * 3, [0.9, 0.3, 0.0]]))
        turn[1] = matrix_from_rotation_vector(np.array([0.0, 0.0, 2.0]))  # of the via: not taken
        place = np.array([[0.0, 0.0, 0.0], [0.05, 0.05, 0.0], [0.1, 0.0, 0.0]])
        found = dense_run(place, turn, np.array([PTP, VIA, END]))
        vector = rotation_vector_from_matrix(found.attitudes(turn))
        np.testing.assert_allclose(vector[1:], found.share[1:, None] * [0.9, 0.3, 0.0], atol=1e-12)
        np.testing.assert_allclose(found.attitudes(turn)[0], turn[0])

    def test_runs_and_their_faults(self) -> None:
        motions = [PTP, LIN, LIN, PTP, PTP, VIA, END, Motion.UNUSED, LIN, PTP]
        program = circle(10, motions=motions)
        known = np.ones(10, dtype=bool)
        runs = runs_of(program, known)
        assert [run.rows.tolist() for run in runs] == [[0, 1, 2], [4, 5, 6, 8]]
        assert not any(run.fault or run.fixed for run in runs)
        reason = np.full(10, Reason.NONE)
        reason[0], reason[6] = Reason.JOINT_TARGET, Reason.EXPRESSION
        runs = runs_of(replace(program, reason=reason), known)
        assert [run.fixed for run in runs] == [True, False]
        assert runs[1].fault == "a target among them cannot be read"
        known[1] = False
        assert "does not reach" in runs_of(program, known)[0].fault
        other = np.zeros(10, dtype=np.int64)
        other[8] = 1
        assert "tool changes" in runs_of(replace(program, tool=other), known)[1].fault


class TestChoice:
    def test_only_the_spin_changes(self, spun) -> None:
        program, found = spun
        assert found.runs == (1, 1)
        assert found.turned.all()
        new = found.program
        np.testing.assert_array_equal(new.position, program.position)
        np.testing.assert_allclose(new.rotation @ Z, program.rotation @ Z, atol=1e-12)
        turn = np.swapaxes(program.rotation, 1, 2) @ new.rotation
        vector = rotation_vector_from_matrix(turn)
        np.testing.assert_allclose(vector[:, :2], 0.0, atol=1e-12)
        off = np.angle(np.exp(1j * (vector[:, 2] - found.spin)))
        np.testing.assert_allclose(off, 0.0, atol=1e-12)

    def test_the_arm_follows_on_its_branch_within_its_limits(self, spun) -> None:
        _, found = spun
        new = found.program
        dense = dense_run(
            (FRAME @ pose(new.rotation, new.position))[:, :3, 3], new.rotation, new.motion
        )
        T = pose(dense.attitudes(new.rotation), dense.position)
        joints = inverse_path(ROBOT, T, near=found.after.joints[0])
        assert np.isfinite(joints).all()
        assert np.abs(np.diff(joints, axis=0)).max() < 20.0 * DEG
        np.testing.assert_allclose(joints[dense.at], found.after.joints, atol=1e-9)
        before = branches_of(ROBOT, found.before.joints)
        assert len(set(branches_of(ROBOT, joints)) | set(before)) == 1

    def test_it_wins_room_and_bends_less(self, spun) -> None:
        _, found = spun
        gained = found.summary()
        assert gained["limit_distance_deg"]["before"]["worst"] < 0.0
        assert gained["limit_distance_deg"]["after"]["worst"] > 15.0
        bent = gained["deflection_across_feed_um"]
        assert bent["after"]["mean"] < 0.95 * bent["before"]["mean"]
        assert gained["targets_turned"] == 80
        assert set(gained["stiffness_N_per_um"]) == {"before", "after"}

    def test_more_weight_on_deflection_bends_less(self, spun) -> None:
        program, found = spun
        free = replace(FREE, deflection=5e-6)
        stiff = choose_spins(MODEL, program, free, settings=pushed(program))
        assert stiff.after.across.mean() < 0.98 * found.after.across.mean()

    def test_equal_input_equal_output(self, spun) -> None:
        program, found = spun
        again = choose_spins(MODEL, program, FREE, settings=pushed(program))
        np.testing.assert_array_equal(again.spin, found.spin)

    def test_what_is_well_already_stays(self, spun) -> None:
        program, found = spun
        again = choose_spins(MODEL, found.program, FREE, settings=pushed(program))
        assert again.runs == (1, 0)
        assert not again.turned.any()
        np.testing.assert_array_equal(again.program.rotation, found.program.rotation)

    def test_the_largest_spin_is_kept(self) -> None:
        program = circle(40)
        free = replace(FREE, most=25.0 * DEG)
        found = choose_spins(MODEL, program, free, settings=pushed(program))
        assert found.turned.any()
        assert np.abs(found.spin).max() <= 25.0 * DEG + 1e-9

    def test_an_axis_target_is_where_it_begins(self) -> None:
        reason, axes = np.full(60, Reason.NONE), np.full((60, 6), np.nan)
        program = circle(60)
        start = compensate(MODEL, program, settings=pushed(program)).joints[0]
        reason[0] = Reason.JOINT_TARGET
        axes[0] = ROBOT.controller.to_controller(start[None])[0]
        position, rotation = np.array(program.position), np.array(program.rotation)
        position[0] = rotation[0] = np.nan
        program = replace(program, reason=reason, axes=axes, position=position, rotation=rotation)
        found = choose_spins(MODEL, program, FREE, settings=pushed(program))
        assert found.runs == (1, 1)
        assert not found.turned[0]
        assert np.abs(found.spin[1]) < 30.0 * DEG
        assert np.abs(np.diff(found.after.joints, axis=0)).max() < 45.0 * DEG
        np.testing.assert_allclose(found.after.joints[0], start, atol=1e-9)

    def test_a_run_that_cannot_be_read_stays(self) -> None:
        reason = np.full(40, Reason.NONE)
        reason[20] = Reason.EXPRESSION
        found = choose_spins(MODEL, circle(40, reason=reason), FREE, settings=STANDS)
        assert found.runs == (1, 0)
        assert found.notes == ("lines 1 to 40: not turned, a target among them cannot be read.",)

    def test_a_part_on_the_robot_is_refused(self) -> None:
        with pytest.raises(ConfigurationError, match="carries the part"):
            choose_spins(MODEL, circle(4, held=np.array([False, True, False, False])), FREE)

    def test_a_language_that_prints_an_axis_alone_is_refused(self) -> None:
        with pytest.raises(ConfigurationError, match="does not print the rotation"):
            choose_spins(MODEL, circle(4, dialect="apt"), FREE)

    def test_weights_are_above_zero(self) -> None:
        for bad in ({"deflection": 0.0}, {"most": -1.0}):
            with pytest.raises(ConfigurationError, match="expected above 0"):
                FreeSpinSettings(spin=FREE.spin, **bad)


class TestWritten:
    def test_turned_targets_that_are_not_compensated(self, spun) -> None:
        program, found = spun
        narrow = replace(STANDS, max_shift=1e-4)
        result = compensate(MODEL, found.program, settings=narrow)
        left = result.status == Status.UNCHANGED_STEP
        assert left.any()
        new = found.restate(program, result)
        assert new.replacement.changed.all()
        np.testing.assert_array_equal(new.replacement.position[left], program.position[left])
        np.testing.assert_array_equal(new.replacement.rotation[left], found.program.rotation[left])
        assert f"{left.sum()} targets were turned and not compensated" in new.notes[-1]

    def test_configuration_words_follow_the_arm(self) -> None:
        program = circle(40)
        plain = compensate(MODEL, program, settings=STANDS).joints
        words = np.full((40, 2), NO_WORD)
        words[0] = configuration_words(ROBOT, "kuka", plain[:1])[0]
        program = replace(program, words=words)
        found = choose_spins(MODEL, program, FREE, settings=STANDS)
        new = found.restate(program, compensate(MODEL, found.program, settings=STANDS))
        want = configuration_words(ROBOT, "kuka", new.joints[:1])[0]
        said = np.where(new.replacement.words[0] == NO_WORD, words[0], new.replacement.words[0])
        np.testing.assert_array_equal(said, want)
        assert (new.replacement.words[1:] == NO_WORD).all()
        np.testing.assert_allclose(new.joints[0], found.after.joints[0], atol=0.02)
