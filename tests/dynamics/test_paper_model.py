"""The paper's regression as a saved model: the same numbers, from numbers alone."""

import zipfile
from dataclasses import replace

import numpy as np
import pytest
from sklearn.svm import SVR
from window_cases import planted, stated_arm

from robotrue.core.archive import archive_bytes, archive_from
from robotrue.core.units import UM
from robotrue.dynamics.deviation_file import read_learned_deviation
from robotrue.dynamics.deviation_validation import scores
from robotrue.dynamics.learned_deviation import WindowTrust
from robotrue.dynamics.paper_learners import choose_settings
from robotrue.dynamics.paper_regression import fit_paper, paper_columns, paper_from_archive
from robotrue.dynamics.paper_tables import paper_tables
from robotrue.dynamics.window_folds import folds
from robotrue.errors import ArchiveError, ImplausibleDataError, ModelMismatchError


@pytest.fixture(scope="module")
def windows():
    return planted(passes=(0, 1), each=30)


@pytest.fixture(scope="module")
def model(windows):
    return fit_paper(windows, stated_arm())


def test_numbers_alone_say_what_scikit_learn_says(model, windows):
    columns = model.components.scores(paper_columns(windows))
    centre, scale = windows.deviation.mean(), windows.deviation.std()
    values = (windows.deviation - centre) / scale
    penalty, gamma, tube = choose_settings(columns, values)
    own = SVR(kernel="rbf", C=penalty, gamma=gamma, epsilon=tube, max_iter=200_000)
    expected = centre + scale * own.fit(columns, values).predict(columns)
    np.testing.assert_allclose(model.predict(windows).deviation, expected, rtol=0, atol=1e-12 * UM)


def test_saved_model_has_the_error_that_was_scored(windows, tmp_path):
    arm, path = stated_arm(), tmp_path / "m.robotrue"
    for kind in ("blocks", "passes"):
        missed = []
        for train, test in folds(windows, kind):
            held = windows.take(test)
            path.write_bytes(archive_bytes(fit_paper(windows.take(train), arm).to_archive()))
            missed.append(read_learned_deviation(path).predict(held).error - held.measured)
        scored = scores(windows, arm, kinds=[kind], methods=["paper"])[0]
        np.testing.assert_array_equal(np.concatenate(missed), scored.residual)


def test_archive_holds_json_and_numbers_and_is_hashed(model, tmp_path):
    path = tmp_path / "m.robotrue"
    path.write_bytes(archive_bytes(model.to_archive()))
    with zipfile.ZipFile(path) as bundle:
        names = bundle.namelist()
    assert {name.rsplit(".", 1)[1] for name in names} == {"json", "npy"}
    archive = archive_from(path.read_bytes())
    assert (archive.kind, archive.schema) == ("jin2022-deviation", 1)
    with pytest.raises(ArchiveError, match="this robotrue reads 1"):
        paper_from_archive(replace(archive, schema=2))
    short = {name: v for name, v in archive.arrays.items() if name != "weights"}
    with pytest.raises(ArchiveError, match="weights"):
        paper_from_archive(replace(archive, arrays=short))
    crooked = dict(archive.arrays) | {"weights": archive.arrays["weights"][:-1]}
    with pytest.raises(ArchiveError, match="incomplete or damaged"):
        paper_from_archive(replace(archive, arrays=crooked))


def test_what_it_has_not_seen_is_marked(model, windows):
    far = planted(passes=(5,), each=14, seed=3)
    found = model.predict(far)
    assert (found.standing == WindowTrust.EXTRAPOLATED).all()
    assert (found.sd > model.predict(windows).sd.max()).all()
    joints = far.joints.copy()
    joints[3, 1] = 9.0
    beyond = model.predict(replace(far, joints=joints))
    assert beyond.standing[3] == WindowTrust.INVALID
    assert np.isnan(beyond.error[3])
    assert (model.predict(windows).standing == WindowTrust.INSIDE).all()


def test_mean_force_may_count_either_way(model, windows):
    other = replace(windows, force_mean=-windows.force_mean)
    np.testing.assert_array_equal(model.predict(other).error, model.predict(windows).error)


def test_tables_add_up(model, windows):
    tables = paper_tables(model)
    assert tables.features.shape == (60, 8)
    assert tables.eigenvalues.sum() == pytest.approx(8.0)
    assert tables.contribution_percent.sum() == pytest.approx(100.0)
    assert tables.contribution_percent[: tables.kept].sum() >= 95.0
    np.testing.assert_allclose(tables.loadings @ tables.loadings.T, np.eye(tables.kept), atol=1e-12)
    rest = model.predict(windows).error - windows.measured
    assert tables.rmse_um["training"] == np.sqrt((rest**2).mean()) / UM
    assert tables.rmse_um["blocks"] == model.held_out / UM
    assert 0 < tables.support_vectors <= 60


def test_windows_it_cannot_learn_from_are_refused(windows):
    arm = stated_arm()
    with pytest.raises(ImplausibleDataError, match="these look like radians"):
        fit_paper(replace(windows, joints=np.deg2rad(windows.joints)), arm)
    with pytest.raises(ImplausibleDataError, match="these look like kN"):
        fit_paper(
            replace(
                windows,
                force=windows.force / 1e3,
                force_peak=windows.force_peak / 1e3,
                force_mean=windows.force_mean / 1e3,
            ),
            arm,
        )
    with pytest.raises(ModelMismatchError, match="beyond the limits"):
        fit_paper(replace(windows, joints=windows.joints + 3.0), arm)
