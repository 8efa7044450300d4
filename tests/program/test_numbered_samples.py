"""Sample programs of a post processor, with the frames and tools their numbers stand for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import fanuc_samples
import jbi_samples
import numpy as np
import pytest

from robotrue.core.units import DEG
from robotrue.program.formats import read_job, write_program
from robotrue.program.program import FrameTable, Motion, Reason

TABLE = FrameTable(
    bases={"1": np.eye(4)}, tools={"1": np.eye(4)}, pulses_per_degree=np.full(6, 1.0)
)


@pytest.mark.data
@pytest.mark.parametrize("name", ["jbi/robodk_MillDe.JBI", "fanuc_ls/robodk_MillDemo.LS"])
def test_every_target_of_the_sample_is_read_and_written(
    name: str, data_dir: Path, tmp_path: Path
) -> None:
    path = data_dir.parent / "programs" / name
    if not path.is_file():
        pytest.skip(f"no {path}")
    (program,) = read_job(path, TABLE)
    axis = program.reason == Reason.JOINT_TARGET
    assert np.flatnonzero(axis).tolist() == [0, len(program) - 1]
    assert (program.reason[~axis] == Reason.NONE).all()
    np.testing.assert_allclose(program.axes[0] / DEG, [10, -70, 100, 5, 60, -20])
    assert program.motion[-3:].tolist() == [Motion.ARC_VIA, Motion.ARC_END, Motion.PTP]
    samples = jbi_samples if program.dialect == "jbi" else fanuc_samples
    everything = np.ones(len(program), dtype=bool)
    still = replace(samples.shifted(program), changed=everything)
    assert write_program(program, still) == path.read_bytes()
    change = replace(
        samples.shifted(program, (0.3, -0.2, 0.1)), changed=everything, axes=program.axes + DEG
    )
    (tmp_path / path.name).write_bytes(write_program(program, change))
    (again,) = read_job(tmp_path / path.name, TABLE)
    assert np.abs(again.position - change.position)[~axis].max() < 0.51e-6
    assert np.abs(again.axes - change.axes)[axis].max() < 0.51e-3 * DEG
