"""The paper's deviation online: what the saved model says of windows offline. SIMULATED."""

from functools import cache

import numpy as np
from test_sensing import estimated
from test_sensing_learned import OWN, ROWS, models, stream, window

from robotrue.core.archive import archive_bytes, archive_from
from robotrue.core.units import UM
from robotrue.dynamics.learned_deviation import WindowTrust
from robotrue.dynamics.paper_regression import fit_paper, paper_from_archive
from robotrue.dynamics.streaming import ModalFilter
from robotrue.online.estimates import Doubt
from robotrue.online.sensing import Sensing


@cache
def saved():
    """The paper's regression of the windows of ``learned``, written and opened again."""
    of = models().learned.model
    data = archive_bytes(fit_paper(of.windows, of.arm).to_archive())
    return paper_from_archive(archive_from(data))


def run(arm, block):
    sensing = Sensing(models(deviation=saved()))
    sensing.joints(arm)
    return sensing, estimated(sensing, block, ())


def test_live_is_offline():
    arm, block, _ = stream()
    sensing, found = run(arm, block)
    count = len(block) // ROWS
    own = ModalFilter(OWN, models().rate)
    own.settle(np.array(block.wrench[0, :3]))
    bent = own.push(np.array(block.wrench[:, :3]))[:, 1]
    sound = round(sensing.memory * models().rate) // ROWS + 1
    assert sound < count
    for k in range(sound, count):
        rows = slice(k * ROWS, (k + 1) * ROWS)
        joints = models().robot.controller.to_model(found["joints"][rows]).mean(axis=0)
        asked = window(np.array(block.wrench[rows, :3]), bent[rows], joints, name="online")
        said = saved().predict(asked)
        after = slice((k + 1) * ROWS, min((k + 2) * ROWS, len(block)))
        e_0 = -(found["error"][after, 1] - bent[after])  # the direction is -y
        assert np.abs(e_0 - said.deviation[0]).max() < 1e-9 * UM
        np.testing.assert_array_equal(found["sd"][after, 1] >= said.sd[0], True)
    correction = sensing.state()["correction"]
    assert abs(correction[0] - said.deviation[0]) < 1e-9 * UM
    assert correction[2] == said.standing[0] == WindowTrust.INSIDE


def test_unseen_pose_is_marked():
    arm, block, _ = stream(shift=(0.4, -0.15))
    sensing, found = run(arm, block)
    settled = slice(round(sensing.memory * models().rate), None)
    assert (found["doubt"][settled] & int(Doubt.EXTRAPOLATED)).all()
