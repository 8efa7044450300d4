"""Long programs in blocks: the bytes and counts of the whole, whoever did which block."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import cases
import numpy as np
import pytest
from test_dialect_programs import TABLE, fanuc, jbi
from test_path_programs import MAKERS, spin_of, table
from test_rapid_urscript_programs import rapid, urscript

from robotrue.calibration.calibrated_model import CalibratedModel
from robotrue.compensation.chunk_workers import ChunkProcesses
from robotrue.compensation.compensate import compensate
from robotrue.compensation.compensate_file import CompensatedFile, compensate_file, worker_count
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.files import atomic_stream
from robotrue.core.poses import inverse
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError, FormatError, MissingExtraError
from robotrue.program.formats import read_job, write_program
from robotrue.program.program import FrameTable
from robotrue.program.program_file import outline_job
from robotrue.robot.forward import forward
from robotrue.robot.presets import preset
from robotrue.robot.statics import Load

COUNT = 2000
BLOCK = 300
NO_FRAMES = FrameTable()
NAMES = {
    "sinumerik": "part.mpf", "fanuc_gcode": "part.nc", "heidenhain": "part.h", "apt": "part.apt",
    "toolpath_csv": "part.csv",
}  # fmt: skip


def aggregate(T: np.ndarray) -> str:
    x, y, z = T[:3, 3] / MM
    a, b, c = abc_from_matrix(T[:3, :3]) / DEG
    return f"{{X {x:.4f},Y {y:.4f},Z {z:.4f},A {a:.4f},B {b:.4f},C {c:.4f}}}"


def text(count: int = COUNT) -> bytes:
    """A path of the arm with frames, speeds, joint moves, an arc, and targets out of reach."""
    robot = cases.kr160()
    joints = cases.path_joints(count)
    poses = forward(robot, joints)
    lines = ["DEF part()", f"$TOOL={aggregate(robot.T_flange_tool)}", "$BASE=$NULLFRAME"]
    for k, T in enumerate(poses):
        here = aggregate(T)
        if k % 50 == 0:
            lines.append(f"$VEL.CP={0.01 + 1e-5 * k:.5f}")
        if k == 1300:
            lines.append("$BASE={X 0.5,Y 0,Z -0.25,A 0,B 0.1,C 0}")
        if k % 701 == 3:
            lines.append(f"PTP {here[:-1]},S 2,T 10}} C_PTP")
        elif k % 1203 == 5:
            lines.append("LIN {X 9000,Y 0,Z 0,A 0,B 0,C 0} ; out of reach")
        elif k % 900 == 7:
            lines.append(f"CIRC {here},{aggregate(poses[k + 1])}")
        elif k == 11:
            lines.append("PTP {A1 -10,A2 -80,A3 95,A4 5,A5 20,A6 0}")
        else:
            lines.append(f"LIN {here} C_DIS")
    return "\r\n".join([*lines, "END", ""]).encode()


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stream") / "part.src"
    path.write_bytes(text())
    return path


def settings(**more: object) -> CompensationSettings:
    return CompensationSettings(home=cases.path_joints(COUNT)[0], **more)  # type: ignore[arg-type]


def whole(
    source: Path, model: object, how: CompensationSettings, *, frames: FrameTable = NO_FRAMES
) -> tuple[bytes, dict]:
    (program,) = read_job(source, frames)
    result = compensate(model, program, settings=how)
    return write_program(program, result.replacement), dict(result.tally(program).summary())


def streamed(
    source: Path,
    model: object,
    how: CompensationSettings,
    *,
    block: int = BLOCK,
    frames: FrameTable = NO_FRAMES,
    **options: object,
) -> tuple[bytes, CompensatedFile]:
    (found,) = outline_job(source, frames, targets=block)
    target = source.with_name("out.src")
    with atomic_stream(target) as writing:
        result = compensate_file(model, found, source, writing, settings=how, **options)
    data = target.read_bytes()
    target.unlink()
    return data, result


def require_equal_summaries(found: dict, expected: dict) -> None:
    assert found["status"] == expected["status"]
    assert found["notes"] == expected["notes"]
    for name, value in expected.items():
        if isinstance(value, dict) and "mean" in value:
            assert found[name]["max"] == value["max"]
            assert found[name]["mean"] == pytest.approx(value["mean"], rel=1e-12)
        else:
            assert found[name] == value


@pytest.mark.parametrize("block", [BLOCK, 257])
def test_blocks_give_the_bytes_of_the_whole(source: Path, block: int) -> None:
    model, how = cases.rich_model(harmonics=8, centres=20), settings()
    data, expected = whole(source, model, how)
    assert data != source.read_bytes()
    assert len(expected["status"]) > 2
    found, result = streamed(source, model, how, block=block, workers=1)
    assert found == data
    assert result.again == 0
    assert result.workers == 1
    require_equal_summaries(dict(result.summary()), expected)


@pytest.mark.parametrize(("make", "arm"), [(rapid, "IRB120"), (urscript, "UR10")])
def test_other_languages(tmp_path: Path, make: Callable[..., bytes], arm: str) -> None:
    robot = preset(arm).with_tool(cases.TOOL)
    middle = {"IRB120": [5, 10, -15, 20, 50, 85], "UR10": [15, -80, 90, -100, -80, 20]}[arm]
    joints = np.array(middle) * DEG + np.linspace(0, 0.4, 600)[:, None]
    path = tmp_path / ("part.mod" if make is rapid else "part.script")
    path.write_bytes(make(robot, joints))
    model, how = cases.rich_model(robot=robot, harmonics=8, centres=20), CompensationSettings()
    data, expected = whole(path, model, how)
    found, result = streamed(path, model, how, block=90, workers=1)
    assert found == data != path.read_bytes()
    assert result.chunks == 7
    require_equal_summaries(dict(result.summary()), expected)


@pytest.mark.parametrize(("make", "arm"), [(fanuc, "KR160"), (jbi, "GP225")])
def test_languages_of_numbered_points(tmp_path: Path, make: Callable[..., bytes], arm: str) -> None:
    name = "part.ls" if make is fanuc else "part.jbi"
    robot = replace(preset(arm), maker="fanuc" if make is fanuc else "yaskawa")
    robot = robot.with_tool(cases.TOOL)
    joints = np.array([5, 10, -15, 20, 50, 30]) * DEG + np.linspace(0, 0.4, 600)[:, None]
    path, how = tmp_path / name, CompensationSettings()
    path.write_bytes(make(robot, joints))
    model = cases.rigid_model(robot=robot)
    data, expected = whole(path, model, how, frames=TABLE)
    for workers in (1, 2):
        found, result = streamed(path, model, how, block=90, frames=TABLE, workers=workers)
        assert found == data != path.read_bytes()
        assert (result.chunks, result.workers) == (9 if make is jbi else 8, workers)
        require_equal_summaries(dict(result.summary()), expected)


@pytest.mark.parametrize("name", sorted(MAKERS))
def test_languages_of_words(tmp_path: Path, name: str) -> None:
    robot = cases.kr160()
    joints = np.array([5, -60, 70, 20, 50, 30]) * DEG + np.linspace(0, 0.4, 600)[:, None]
    T = inverse(cases.FRAME) @ forward(robot, joints)
    T[300:303, :3, 3] *= 9.0  # out of reach
    path, frames = tmp_path / NAMES[name], table(cases.FRAME, spin_of(T))
    path.write_text(MAKERS[name](T))
    model, how = cases.rigid_model(robot=robot), CompensationSettings(home=joints[0])
    data, expected = whole(path, model, how, frames=frames)
    assert len(expected["notes"]) > (name != "sinumerik")
    found, result = streamed(path, model, how, block=90, frames=frames, workers=1)
    assert found == data != path.read_bytes()
    assert result.chunks > 5
    require_equal_summaries(dict(result.summary()), expected)
    found, result = streamed(path, model, how, block=90, frames=frames, workers=2)
    assert found == data
    assert (result.workers, result.again) == (2, 0)
    require_equal_summaries(dict(result.summary()), expected)


def test_loads_go_with_their_targets(source: Path) -> None:
    (program,) = read_job(source, FrameTable())
    rng = np.random.default_rng(2)
    wrench = rng.normal(size=(len(program), 6)) * [200.0, 200.0, 200.0, 5.0, 5.0, 5.0]
    how = settings(load=Load(mass=np.array([30.0])), wrench=wrench)
    model = cases.rigid_model()
    assert streamed(source, model, how, workers=1)[0] == whole(source, model, how)[0]


def test_an_arm_followed_step_by_step_stays_in_one_process(source: Path) -> None:
    robot = cases.kr160()
    bent = replace(robot, alpha=robot.alpha + np.array([0.0, 0.0, 0.0, 0.01, 0.0, 0.0]))
    model, how = cases.rigid_model(robot=bent), settings()
    found, result = streamed(source, model, how, workers=3)
    assert result.workers == 1
    assert "closed form" in result.notes[0]
    assert found == whole(source, model, how)[0]


def test_covariances_are_summed_up_too(source: Path) -> None:
    robot = cases.with_errors(cases.kr160(), 3)
    size = len(robot.errors)
    model = CalibratedModel(
        robot=robot.nominal(), errors=robot.errors, covariance=np.eye(size) * 1e-9,
        repeatability=2e-5, white=1e-5,
    )  # fmt: skip
    how = settings(covariance=True, max_sigma=1.5e-4)
    data, expected = whole(source, model, how)
    found, result = streamed(source, model, how, workers=1)
    assert found == data
    summary = dict(result.summary())
    for name in ("mean", "max"):
        sigma = expected["predicted_sigma_um"][name]
        assert summary["predicted_sigma_um"][name] == pytest.approx(sigma, rel=1e-12)
    assert summary["notes"] == expected["notes"]
    assert "outside the range of the calibration" in expected["notes"][-1]


def test_processes_give_the_same_bytes_and_one_may_die(
    source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, how = cases.rich_model(harmonics=8, centres=20), settings()
    alone, _ = streamed(source, model, how, workers=1)
    begun = ChunkProcesses.submit

    def kill_one(self: ChunkProcesses, task: object) -> None:
        begun(self, task)  # type: ignore[arg-type]
        if task.number == 3:  # type: ignore[attr-defined]
            os.kill(next(iter(self._pool._processes)), signal.SIGKILL)

    monkeypatch.setattr(ChunkProcesses, "submit", kill_one)
    found, result = streamed(source, model, how, workers=2)
    assert found == alone
    assert result.workers == 2
    assert "a worker process died" in result.notes[0]
    assert result.again == 0


@pytest.fixture
def scheduler(request: pytest.FixtureRequest) -> Iterator[str]:
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=request.param, dashboard_address=":0"
        ) as cluster,
    ):
        yield cluster.scheduler_address


@pytest.mark.parametrize("scheduler", [False, True], indirect=True, ids=["threads", "processes"])
def test_dask_gives_the_same_bytes(source: Path, scheduler: str) -> None:
    model, how = cases.rich_model(harmonics=8, centres=20), settings()
    alone, expected = streamed(source, model, how, workers=1)
    found, result = streamed(source, model, how, dask=scheduler)
    assert found == alone
    assert (result.workers, result.again, result.notes) == (2, 0, ())
    assert result.tally.summary() == expected.tally.summary()


def test_no_scheduler_no_result(source: Path) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(ConfigurationError, match="no Dask scheduler answers"):
        streamed(source, cases.rigid_model(), settings(), dask="nonsense://127.0.0.1:9")
    assert not source.with_name("out.src").exists()


def test_dask_is_an_extra(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(MissingExtraError, match="distributed is not installed"):
        streamed(source, cases.rigid_model(), settings(), dask="tcp://127.0.0.1:8786")


def test_a_wrong_guess_is_found_out(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from robotrue.compensation import compensate_file as module

    class Astray(module.ThisProcess):
        def __init__(self, job, progress) -> None:
            super().__init__(job, progress)
            self.ahead = 3

    model, how = cases.rich_model(harmonics=8, centres=20), settings()
    alone, _ = streamed(source, model, how, workers=1)
    monkeypatch.setattr(module, "ThisProcess", Astray)
    found, result = streamed(source, model, how, workers=1)
    assert (found, result.again) == (alone, 0)

    def nowhere(job, file, read, start):
        wrong = start.copy()
        wrong.record["near"][0][:] += [np.pi, 0.0, 0.0, 2.0 * np.pi, 0.0, -2.0 * np.pi]
        return wrong

    monkeypatch.setattr(module, "_guess_state", nowhere)
    found, result = streamed(source, model, how, workers=1)
    assert found == alone
    assert result.again > 0


def test_bad_requests(source: Path) -> None:
    model, how = cases.rigid_model(), settings()
    with pytest.raises(ConfigurationError, match="--workers is 0"):
        streamed(source, model, how, workers=0)
    with pytest.raises(ConfigurationError, match="no flat tables"):
        streamed(source, cases.TableModel(tables=model.tables, flat=False), how)
    (found,) = outline_job(source, FrameTable(), targets=BLOCK)
    other = source.with_name("shorter.src")
    other.write_bytes(source.read_bytes()[:-2000])
    with (
        pytest.raises(FormatError, match="became shorter"),
        atomic_stream(source.with_name("no.src")) as writing,
    ):
        compensate_file(model, found, other, writing, settings=how, workers=1)
    assert not source.with_name("no.src").exists()
    assert worker_count(10_000, None) == 1
    assert worker_count(10_000, 3) == 3
    assert 1 <= worker_count(10**9, None) <= 8
