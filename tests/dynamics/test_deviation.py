"""The learned deviation on planted windows: recovers, extrapolates, refuses, opens again."""

from dataclasses import replace

import numpy as np
import pytest
from frf_cases import measured, robot_with_tool, single
from window_cases import FACTORS, planted, stated_arm

from robotrue.core.archive import archive_bytes, read_archive
from robotrue.core.units import DEG, UM
from robotrue.dynamics.deviation import (
    WIDER,
    DeviationSettings,
    deviation_from_archive,
    fit_deviation,
)
from robotrue.dynamics.deviation_kernel import CENTRE, DRIFT, WindowRows, covariance, variance
from robotrue.dynamics.deviation_physics import (
    CompliantArm,
    compliance_of,
    physics_terms,
    static_compliance,
)
from robotrue.dynamics.deviation_validation import scores
from robotrue.dynamics.formats.dynamics_csv import read_windows, write_windows
from robotrue.dynamics.interpolation import response_curve
from robotrue.dynamics.learned_deviation import WindowTrust
from robotrue.dynamics.paper_learners import components_of
from robotrue.dynamics.paper_regression import fit_paper
from robotrue.dynamics.window_folds import folds
from robotrue.dynamics.windows import concatenate_windows
from robotrue.errors import (
    ArchiveError,
    ConfigurationError,
    FormatError,
    ImplausibleDataError,
    ModelMismatchError,
    ObservabilityError,
)

ROW = np.array([-0.3, -2.0, 0.0]) * UM
"""What the planted prediction contains of a standing force."""


@pytest.fixture(scope="module")
def model():
    return fit_deviation(planted(), stated_arm())


def test_factors_of_the_joints_come_back(model):
    found, sd = model.factors[:6], model.factors_sd[:6]
    assert (np.abs(found - FACTORS) < 3.0 * sd).all()
    assert (sd < 0.26).all()
    assert sd.min() < 0.1


def test_unseen_pass_is_predicted_within_its_band(model):
    other = planted(passes=(3, 4), seed=9)
    found = model.predict(other)
    miss = found.error - other.measured
    assert np.sqrt((miss**2).mean()) < 1.0 * UM
    before = other.deviation
    assert np.sqrt((miss**2).mean()) < 0.3 * np.sqrt((before**2).mean())
    assert 0.85 < (np.abs(miss) < 1.96 * found.sd).mean() <= 1.0


def test_pose_far_from_all_windows_is_marked_and_gets_physics_alone(model):
    far = planted(passes=(5,), each=14, seed=3)
    turned = replace(far, joints=far.joints + np.array([0.9, 0.0, 0.0, 0.6, 0.0, 0.0]))
    found = model.predict(turned)
    assert (found.standing == WindowTrust.EXTRAPOLATED).all()
    np.testing.assert_allclose(found.deviation, found.physics, atol=1e-12)
    assert (found.sd >= model.predict(planted(passes=(0,), each=14)).sd.max()).all()


def test_force_unlike_any_is_marked(model):
    windows = planted(passes=(0,), each=14)
    strange = replace(windows, force=windows.force * 8.0)
    assert (model.predict(strange).standing == WindowTrust.EXTRAPOLATED).all()


def test_pose_outside_the_arm_is_invalid(model):
    windows = planted(passes=(0,), each=14)
    joints = windows.joints.copy()
    joints[3, 1] = 100.0 * DEG
    found = model.predict(replace(windows, joints=joints))
    assert found.standing[3] == WindowTrust.INVALID
    assert np.isnan([found.error[3], found.sd[3], found.physics[3]]).all()
    assert np.isfinite(found.error[4])


def test_model_opens_again_with_the_same_numbers(model, tmp_path):
    path = tmp_path / "m.robotrue"
    path.write_bytes(archive_bytes(model.to_archive()))
    again = deviation_from_archive(read_archive(path))
    windows = planted(passes=(1, 3), each=20, seed=4)
    for name in ("error", "sd", "physics", "standing"):
        np.testing.assert_array_equal(
            getattr(again.predict(windows), name), getattr(model.predict(windows), name)
        )
    with pytest.raises(ArchiveError, match="expected 'dynamic-deviation'"):
        deviation_from_archive(replace(model.to_archive(), kind="error-model/learned"))


def test_model_of_the_first_schema_opens(model, tmp_path):
    """Written before there was a static row: no such arrays, schema 1."""
    new = replace(model, row=None).to_archive()
    assert new.schema == 4
    new = replace(new, arrays={**new.arrays, "theta": new.arrays["theta"][:5]}, schema=3)
    arrays = {name: v for name, v in new.arrays.items() if name not in ("row", "row_sd")}
    path = tmp_path / "first.robotrue"
    path.write_bytes(archive_bytes(replace(new, schema=1, arrays=arrays)))
    again = deviation_from_archive(read_archive(path))
    assert again.row is None
    settings = {k: v for k, v in new.document["settings"].items() if k != "force_drift"}
    document = {**new.document, "settings": settings}
    older = deviation_from_archive(replace(new, schema=2, document=document))
    assert older.settings.force_drift == 0.0
    assert older.sizes["drift_N"] < 1e-6
    assert deviation_from_archive(new).sizes["drift_N"] == pytest.approx(DRIFT)
    windows = planted(passes=(1, 3), each=20, seed=4)
    theta = np.append(model.theta[:5], np.log(DRIFT))
    found, asked = again.predict(windows), replace(model, row=None, theta=theta).predict(windows)
    np.testing.assert_array_equal(found.error, asked.error)
    np.testing.assert_array_equal(found.sd, asked.sd)
    with pytest.raises(ArchiveError, match="this robotrue reads 1 to 4"):
        deviation_from_archive(replace(new, schema=5))


def test_variance_is_the_diagonal_of_the_covariance():
    rng = np.random.default_rng(5)
    rows = WindowRows(
        basis=rng.normal(size=(7, 3)) * 1e-6,
        joints=rng.normal(size=(7, 6)),
        place=rng.normal(size=(7, 3)),
        member=np.array([0, 0, 0, 1, 1, 2, 2]),
        way=np.linspace(0.0, 1.0, 7),
        zero=rng.normal(size=(7, 6)) * 1e-6,
        lever=rng.normal(size=(7, 3)) * 1e-6,
    )
    prior = np.array([0.1, 1.0, 2.0])
    full = covariance(rows, rows, CENTRE, prior)
    np.testing.assert_allclose(np.diag(full), variance(rows, CENTRE, prior), rtol=1e-9)


def drifted(windows, size, seed):
    """Windows whose dynamometer drifts by ``size`` N along each pass, not seen by the error."""
    rng, part = np.random.default_rng(seed), windows.pass_index
    way = np.concatenate([np.linspace(0.0, 1.0, (part == k).sum()) for k in np.unique(part)])
    moved = size * rng.normal(size=(part.max() + 1, 3))[part] * way[:, None]
    return replace(
        windows,
        force=windows.force + moved,
        force_mean=windows.force_mean + moved[:, 1],
        predicted=windows.predicted + moved @ ROW,
    )


def test_drift_of_the_zero_is_learned_and_widens_the_band_of_a_new_pass():
    shape = {"passes": (0, 1, 2, 3), "each": 30, "noise": 0.05 * UM}
    row = static_compliance(ROW)
    steady = fit_deviation(planted(**shape), stated_arm(), row=row)
    moving = fit_deviation(drifted(planted(**shape), 1.5, 3), stated_arm(), row=row)
    assert moving.sizes["drift_N"] > 1.5 * steady.sizes["drift_N"]
    new = drifted(planted(passes=(4,), each=30, seed=9), 1.5, 8)
    wide, narrow = moving.predict(new), steady.predict(new)
    assert wide.sd[-1] > 1.3 * narrow.sd[-1]
    assert wide.sd[-1] > 1.2 * wide.sd[0]
    share = (np.abs(wide.error - new.measured) < 1.96 * wide.sd).mean()
    assert share > 0.85


def test_a_zero_that_was_taken_off_narrows_the_band():
    kept = planted(passes=(0, 1), each=30)
    taken = replace(kept, zero_taken=np.ones(len(kept), dtype=bool))
    model = fit_deviation(taken, stated_arm())
    assert model.sizes["drift_N"] == pytest.approx(DRIFT)  # nothing to learn it from
    again = deviation_from_archive(model.to_archive())
    np.testing.assert_array_equal(again.windows.zero_taken, taken.zero_taken)
    new = planted(passes=(3,), each=30, seed=9)
    loose, tight = model.predict(new), again.predict(replace(new, zero_taken=~new.zero_taken))
    assert (tight.sd[1:] < loose.sd[1:]).all()
    assert tight.sd[-1] < 0.9 * loose.sd[-1]


def test_covariance_of_a_prediction_holds_its_standard_deviations(model):
    windows = planted(passes=(1, 3), each=20, seed=4)
    found = model.predict_covariance(windows)
    np.testing.assert_allclose(np.sqrt(np.diag(found)), model.predict(windows).sd, rtol=1e-9)
    near = found[20, 21] / np.sqrt(found[20, 20] * found[21, 21])
    assert 0.3 < near < 1.0


def test_terms_add_up_to_the_static_deflection():
    """Independent: compliance of the arm in robot.statics turns the same force into a twist."""
    from robotrue.robot.model import parameter_slice
    from robotrue.robot.statics import Load, deflect_arm

    arm, windows = stated_arm(), planted(passes=(2,), each=12)
    wrench = np.concatenate([windows.force, np.zeros((12, 3))], axis=1)
    errors = arm.robot.errors.copy()
    errors[parameter_slice(6, "compliance")] = 1.0 / arm.stiffness
    bent = arm.robot.with_errors(errors)
    loaded, _ = deflect_arm(bent, windows.joints, Load(wrench=wrench))
    free, _ = deflect_arm(bent, windows.joints)
    moved = (loaded.position - free.position) @ arm.direction
    terms = physics_terms(arm, windows)
    np.testing.assert_allclose(terms.by_joint.sum(axis=1), moved, rtol=1e-3)
    np.testing.assert_allclose(
        np.einsum("ni,ni->n", terms.compliance, windows.force), terms.by_joint.sum(axis=1)
    )


def test_splits_hold_out_what_they_say():
    windows = planted(passes=(0, 1, 2), each=30)
    for train, test in folds(windows, "blocks"):
        assert len(test) == 15
        assert not np.intersect1d(train, test).size
        for k in range(3):
            rows = test[windows.pass_index[test] == k]
            assert (np.diff(rows) == 1).all()
    assert [set(windows.pass_index[t]) for _, t in folds(windows, "passes")] == [{0}, {1}, {2}]
    train, test = folds(windows, "unseen", known="p1")[0]
    assert set(windows.pass_index[train]) == {1}
    assert set(windows.pass_index[test]) == {0, 2}
    with pytest.raises(ConfigurationError, match="no pass 'p9'"):
        folds(windows, "unseen", known="p9")
    with pytest.raises(ObservabilityError, match="needs two passes"):
        folds(windows.take(windows.pass_index == 0), "passes")


def test_scores_rank_the_methods_on_unseen_poses():
    windows = planted(passes=(0, 3), each=40)
    found = {s.method: s for s in scores(windows, stated_arm(), kinds=["unseen"])}
    assert found["deviation"].rmse < found["prediction"].rmse
    assert found["deviation"].rmse < found["paper"].rmse
    assert found["prediction"].coverage is None
    assert found["deviation"].document()["windows"] == 40


def test_paper_interpolates_and_its_components_are_orthonormal():
    windows = planted(passes=(0,), each=60)
    train, test = folds(windows, "random")[0]
    paper = fit_paper(windows.take(train), stated_arm())
    held = windows.take(test)
    miss = paper.predict(held).error - held.measured
    assert np.sqrt((miss**2).mean()) < 0.5 * np.sqrt((held.deviation**2).mean())
    assert paper.components.count <= 4
    with pytest.raises(ImplausibleDataError, match="f_peak_N does not vary"):
        components_of(np.column_stack([windows.joints, np.full(60, 80.0), windows.force_mean]))


def test_bad_windows_are_refused():
    arm, windows = stated_arm(), planted(passes=(0,), each=20)

    def refused(error, match, **changes):
        with pytest.raises(error, match=match):
            fit_deviation(replace(windows, **changes), arm)

    with pytest.raises(ObservabilityError, match="11 windows, 12 are the least"):
        fit_deviation(windows.take(np.arange(11)), arm)
    measured = windows.measured.copy()
    measured[4] = np.nan
    refused(ObservabilityError, "window 5 has no measured error", measured=measured)
    refused(ImplausibleDataError, "measured_um does not vary", measured=np.full(20, 30 * UM))
    refused(ImplausibleDataError, "these look like radians", joints=windows.joints * DEG)
    refused(ImplausibleDataError, "look like mm or m", predicted=windows.predicted * 1e-3)
    refused(ImplausibleDataError, "are these nm", measured=windows.measured * 1e3)
    refused(ImplausibleDataError, "the negative of predicted_um", measured=-windows.measured)
    forces = ("force", "force_peak", "force_mean")
    small = {name: getattr(windows, name) * 1e-3 for name in forces}
    refused(ImplausibleDataError, "look like kN", **small)
    stuck = windows.force.copy()
    stuck[:, 2] = 4.0
    refused(ImplausibleDataError, "fz_mean_N does not vary: 4 in all 20", force=stuck)
    twice = concatenate_windows([windows, windows.take(np.arange(3))])
    with pytest.raises(ImplausibleDataError, match="window 21 is window 1 again; 3 of 23"):
        fit_deviation(twice, arm)
    refused(ImplausibleDataError, "counts", force=windows.force * 1e4)
    refused(ImplausibleDataError, "below the size of f_mean_N", force_peak=np.linspace(1, 2, 20))
    still = np.tile(windows.joints[:1], (20, 1))
    refused(ImplausibleDataError, "the arm was at rest", joints=still)
    refused(ModelMismatchError, "beyond the limits", joints=windows.joints + 2.0)
    with pytest.raises(ConfigurationError, match="not a unit vector"):
        CompliantArm(robot=arm.robot, stiffness=arm.stiffness, direction=np.ones(3))
    with pytest.raises(ConfigurationError, match="prior gain"):
        DeviationSettings(gain=-1.0)


def test_windows_are_read_as_written(tmp_path):
    windows = planted(passes=(0, 1), each=5)
    measured = windows.measured.copy()
    measured[3] = np.nan
    taken = np.array(windows.passes) == "p1"
    windows = replace(windows, measured=measured, zero_taken=taken)
    path = tmp_path / "w.csv"
    write_windows(path, windows)
    again = read_windows(path)
    assert again.passes == windows.passes
    np.testing.assert_array_equal(again.zero_taken, taken)
    (tmp_path / "odd.csv").write_text(path.read_text().replace(",yes", ",perhaps", 1))
    with pytest.raises(
        FormatError, match=r"odd\.csv:7: zero_taken is 'perhaps', expected yes or no"
    ):
        read_windows(tmp_path / "odd.csv")
    for name in ("joints", "force", "force_peak", "force_mean", "predicted", "measured"):
        np.testing.assert_allclose(getattr(again, name), getattr(windows, name), rtol=1e-11)
    text = path.read_text()
    path.write_text(text.replace("f_peak_N", "f_peak_kN"))
    with pytest.raises(FormatError, match=r"w\.csv:1: no column 'f_peak_N'"):
        read_windows(path)
    lines = text.splitlines()
    path.write_text("\n".join([*lines[:4], lines[4].replace(lines[4].split(",")[0], "", 1)]))
    with pytest.raises(FormatError, match=r"w\.csv:5: a window without a pass"):
        read_windows(path)
    lines[2] = lines[2].replace(lines[2].split(",")[8], "nan")
    path.write_text("\n".join(lines))
    with pytest.raises(FormatError, match=r"w\.csv:3: fy_mean_N is nan"):
        read_windows(path)


def test_known_static_row_settles_what_one_pass_cannot():
    """Along one pass a bending that is the same everywhere and a factor on it look alike."""
    one = planted(passes=(0,))
    blind = fit_deviation(one, stated_arm())
    told = fit_deviation(one, stated_arm(), row=static_compliance(ROW))
    dof = 6
    np.testing.assert_allclose(told.factors[dof : dof + 3], ROW, atol=3.0 * told.row.sd.max())
    far = planted(passes=(3, 4), seed=9)
    assert (
        told.factors_sd[dof + 1 : dof + 3] < [0.7, 0.5] * blind.factors_sd[dof + 1 : dof + 3]
    ).all()
    miss = told.predict(far).error - far.measured
    assert np.sqrt((miss**2).mean()) < 1.0 * UM
    assert (np.abs(miss) < 1.96 * told.predict(far).sd).mean() > 0.85


def test_row_the_windows_contradict_is_trusted_less():
    windows = planted()
    believed = fit_deviation(windows, stated_arm(), row=static_compliance(ROW)).row
    wrong = static_compliance(ROW + np.array([3.0, 0.0, 0.0]) * UM)
    doubted = fit_deviation(windows, stated_arm(), row=wrong)
    np.testing.assert_array_equal(believed.sd, static_compliance(ROW).sd)
    np.testing.assert_allclose(doubted.row.sd, WIDER * wrong.sd)
    again = deviation_from_archive(doubted.to_archive())
    np.testing.assert_array_equal(again.row.sd, doubted.row.sd)


def test_row_of_a_response_along_the_direction():
    frf = measured(robot_with_tool(), highest=400.0)
    curve = response_curve(frf)
    row = compliance_of(curve, np.array([0.0, -1.0, 0.0]))
    np.testing.assert_allclose(row.value, -curve.at_rest[1])
    with pytest.raises(ModelMismatchError, match="no displacement along y"):
        compliance_of(response_curve(measured(single(), highest=400.0)), [0.0, 1.0, 0.0])


def test_a_cell_of_windows_beyond_the_reader_is_refused(tmp_path):
    path = tmp_path / "windows.csv"
    path.write_text("pass,j1_deg\n1," + "1" * 200_000 + "\n")
    with pytest.raises(FormatError, match="cannot be split into columns"):
        read_windows(path)
