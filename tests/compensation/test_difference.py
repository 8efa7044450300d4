import cases
import numpy as np
import pytest

from robotrue.compensation.compensate import compensate
from robotrue.compensation.difference import TargetChange, difference
from robotrue.compensation.settings import CompensationSettings
from robotrue.core.arm_words import NO_WORD
from robotrue.errors import ModelMismatchError
from robotrue.program.program import Program
from robotrue.robot.forward import forward


def replaced(program: Program, **values: np.ndarray) -> Program:
    names = {f: getattr(program, f) for f in Program.__dataclass_fields__}
    return Program(**(names | values))


@pytest.fixture(scope="module")
def job():
    model = cases.rigid_model()
    joints = cases.path_joints(40)
    program = cases.program_of(forward(model.robot, joints))
    settings = CompensationSettings(max_joint_step=1.0, home=joints[0])
    made = compensate(model, program, settings=settings)
    new = made.replacement
    return model, program, replaced(program, position=new.position, rotation=new.rotation), made


def test_shift_and_errors_are_those_of_the_compensation(job):
    model, program, after, made = job
    found = difference(program, after, model=model, home=cases.path_joints(40)[0])
    assert (found.change == TargetChange.MOVED).all()
    np.testing.assert_allclose(found.shift, made.shift, atol=1e-12)
    np.testing.assert_allclose(found.turn, made.turn, atol=1e-7)
    np.testing.assert_allclose(found.error_before, made.predicted_error_before, atol=1e-9)
    assert np.linalg.norm(found.error_before, axis=1).min() > 1e-4
    assert np.linalg.norm(found.error_after, axis=1).max() < 1e-6


def test_a_program_is_the_same_as_itself(job):
    _, program, _, _ = job
    found = difference(program, program)
    assert (found.change == TargetChange.SAME).all()
    assert not found.shift.any()
    assert not found.has_errors
    assert found.summary()["shift_um"] is None


def test_a_word_alone_is_told_apart(job):
    _, program, _, _ = job
    words = np.full_like(program.words, NO_WORD)
    words[3] = 2, 10
    found = difference(program, replaced(program, words=words))
    assert found.change[3] == TargetChange.WORDS
    assert (np.delete(found.change, 3) == TargetChange.SAME).all()


def test_other_programs_are_refused(job):
    model, program, _, _ = job
    fewer = cases.program_of(forward(model.robot, cases.path_joints(7)))
    with pytest.raises(ModelMismatchError, match=r"has 7 targets, .* has 40"):
        difference(program, fewer)
    other = replaced(program, motion=1 - program.motion)
    with pytest.raises(ModelMismatchError, match="another motion"):
        difference(program, other)
