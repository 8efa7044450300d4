"""A journal ahead of its model: references are booked again, once, on that model only."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.core.units import DEG, MM
from robotrue.drilling.adjust import adjustment
from robotrue.drilling.campaign import Campaign
from robotrue.drilling.clamp_watch import ClampSettings
from robotrue.drilling.foot_model import NormalModel, estimate_tilt, fit_model
from robotrue.drilling.head import Head
from robotrue.drilling.hole_session import HoleAnswer, HoleSession, MovedHole
from robotrue.drilling.journal import Journal, answer_document, replay_references, step_document
from robotrue.drilling.production import freeze_model
from robotrue.errors import ModelMismatchError
from robotrue.simulation.drilling_machine import drilling_machine, random_campaign

GAUGE = 0.005 * DEG
Work = tuple[NormalModel, Campaign]


@pytest.fixture(scope="module")
def work() -> Work:
    """A model (simulated machine) and holes that its fit did not use."""
    machine = drilling_machine(2)
    random = np.random.default_rng(2)
    head = Head(p_pivot_tip=np.array([0.0, 0.0, -350.0]) * MM)
    model, _ = fit_model(
        machine.foot, head, random_campaign(machine, 40, random), kind="interactions"
    )
    return model, random_campaign(machine, 30, random, held_out=True)


def drill_holes(
    model: NormalModel, holes: Campaign, journal: Path, *, offset: float = 0.0
) -> list[NormalModel]:
    """Moves for each hole and books a reference of it; returns the model after each."""
    models = [model]
    with Journal(journal) as opened:
        for i in range(len(holes)):
            model, clamps = models[-1], holes.clamps.take(np.array([i]))
            found = adjustment(model, clamps, np.zeros(2))
            answer = HoleAnswer(
                hole=f"H{i}", clamps=clamps, axes=np.zeros(2), refused="", version=model.version,
                adjustment=found,
            )  # fmt: skip
            opened.write_answer(answer, answer_document(answer))
            moved = MovedHole(clamps=clamps, tilt=found.tilt, version=model.version)
            session = HoleSession(
                model, settings=ClampSettings(), reference=GAUGE, waiting={f"H{i}": moved}
            )
            left = holes.tilt[i] - found.tilt + offset
            step = session.take_reference(f"H{i}", left, "hole gauge")
            a, b = (left / DEG).tolist()
            document = step_document(f"H{i}", step, (a, b), "hole gauge")
            opened.write_reference(document, sigma=GAUGE, records=step.model.monitor.records)
            models.append(step.model)
    return models


def replayed(model: NormalModel, journal: Path, sigma: float = 1.0) -> tuple[NormalModel, int]:
    with Journal(journal) as opened:
        return replay_references(
            model, opened.state.references, reference_sigma=sigma, source=journal
        )


def assert_same(got: NormalModel, expected: NormalModel) -> None:
    assert got.version == expected.version
    assert got.frozen == expected.frozen
    assert got.monitor.records == expected.monitor.records
    for name in ("coefficients", "covariance"):
        ours, theirs = getattr(got.refinement, name), getattr(expected.refinement, name)
        np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(got.monitor.sums, expected.monitor.sums, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("behind", [1, 2, 30])
def test_a_model_is_brought_up_to_its_journal(work: Work, tmp_path: Path, behind: int) -> None:
    models = drill_holes(*work, tmp_path / "j.jsonl")
    got, count = replayed(models[-1 - behind], tmp_path / "j.jsonl")
    assert count == behind
    assert_same(got, models[-1])
    again, count = replayed(got, tmp_path / "j.jsonl")
    assert count == 0
    assert again is got


def test_a_frozen_models_watch_is_brought_up_and_an_alarm_thaws_it(
    work: Work, tmp_path: Path
) -> None:
    """A frozen model keeps its version: the records of its watch tell what it lacks."""
    model, holes = work
    start = freeze_model(model, holes, "test", allowed=1.0 * DEG)
    models = drill_holes(start, holes, tmp_path / "j.jsonl", offset=0.05 * DEG)
    thawed = next(k for k, each in enumerate(models) if each.frozen is None)
    assert thawed > 2
    for lacking in (models[1], models[thawed - 1]):
        got, _ = replayed(lacking, tmp_path / "j.jsonl")
        assert_same(got, models[-1])


def test_lines_without_their_deviation_take_that_of_the_command(work: Work, tmp_path: Path) -> None:
    models = drill_holes(*work, tmp_path / "j.jsonl")
    lines = [json.loads(line) for line in (tmp_path / "j.jsonl").read_text().splitlines()]
    older = [
        {name: v for name, v in line.items() if name not in ("sigma_deg", "watch_records")}
        for line in lines
    ]
    (tmp_path / "old.jsonl").write_text("".join(json.dumps(line) + "\n" for line in older))
    got, count = replayed(models[0], tmp_path / "old.jsonl", sigma=GAUGE)
    assert count == 30
    assert_same(got, models[-1])


def test_a_journal_of_another_model_is_refused(work: Work, tmp_path: Path) -> None:
    model, holes = work
    models = drill_holes(model, holes, tmp_path / "j.jsonl")
    other = replace(model, head=model.head, refinement=models[5].refinement)
    assert (
        np.abs(
            estimate_tilt(other, holes.clamps).tilt - estimate_tilt(model, holes.clamps).tilt
        ).max()
        > 1e-7
    )
    with pytest.raises(ModelMismatchError, match=r"j\.jsonl: .*moved hole H0 by "):
        replayed(other, tmp_path / "j.jsonl")
    with pytest.raises(ModelMismatchError, match=r"was at version 2 after hole H0, version 1 "):
        replayed(
            freeze_model(replace(model, version=0), holes, "t", allowed=DEG), tmp_path / "j.jsonl"
        )
