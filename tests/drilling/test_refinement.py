"""Many holes moved by one model, and references that come late (all simulated)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robotrue.app.files_context import FilesContext
from robotrue.app.operations.drill_refine import DrillRefineRequest, run
from robotrue.app.reporting import Silent
from robotrue.core.csv_text import csv_text
from robotrue.core.units import DEG, MM, UM
from robotrue.drilling.adjust import adjustment
from robotrue.drilling.campaign import Campaign
from robotrue.drilling.campaign_csv import write_campaign
from robotrue.drilling.clamp_watch import ClampSettings
from robotrue.drilling.evaluate import evaluate_test
from robotrue.drilling.foot_model import NormalModel, estimate_tilt, fit_model
from robotrue.drilling.head import Head
from robotrue.drilling.hole_session import HoleAnswer, HoleSession
from robotrue.drilling.journal import Journal, answer_document
from robotrue.drilling.model_archive import read_model, write_model
from robotrue.errors import ConfigurationError
from robotrue.simulation.drilling_machine import drilling_machine, random_campaign

HEAD = Head(p_pivot_tip=np.array([0.0, 0.0, -350.0]) * MM)
GAUGE = 0.005 * DEG
OFF = np.array([10.0, 0.0, 0.0]) * UM


def shifted_job(seed: int, count: int) -> tuple[NormalModel, Campaign, Campaign]:
    """A model, then ``count`` holes and 200 test clamps with the first sensor's zero 10 um off."""
    machine, random = drilling_machine(seed), np.random.default_rng(seed)
    campaign = random_campaign(machine, 45, random)
    model, _ = fit_model(machine.foot, HEAD, campaign, kind="interactions")
    machine = replace(machine, offset=machine.offset + OFF)
    holes = random_campaign(machine, count, random, held_out=True, largest=3.0 * DEG)
    return model, holes, random_campaign(machine, 200, random, held_out=True)


def write_holes(path: Path, model: NormalModel, holes: Campaign, *, sign: float = 1.0) -> None:
    """All moved by the model; a gauge measures what is left."""
    random, clamps = np.random.default_rng(len(holes)), holes.clamps
    left = (
        holes.tilt - estimate_tilt(model, clamps).tilt + random.normal(0.0, GAUGE, holes.tilt.shape)
    )
    names = ["left_a_deg", "left_b_deg", "d1_mm", "d2_mm", "d3_mm", "force_N", "z_mm"]
    columns = (sign * left / DEG, clamps.readings / MM, clamps.force, clamps.height / MM)
    path.write_text(csv_text([names, *np.column_stack(columns).tolist()]))


def refined_by(
    folder: Path,
    *,
    records: str | None = "holes.csv",
    sigma_deg: float = 0.005,
    freeze: Path | None = None,
) -> NormalModel:
    """What ``robotrue drill refine`` makes of model and holes in a folder."""
    output = folder / "refined.robotrue"
    request = DrillRefineRequest(
        model=folder / "m.robotrue", records=None if records is None else folder / records,
        output=output, truth="hole gauge", sigma_deg=sigma_deg, freeze=freeze,
    )  # fmt: skip
    run(request, FilesContext(Silent()))
    return read_model(output)


def mean_left(model: NormalModel, test: Campaign) -> float:
    """Mean tilt left in deg."""
    return evaluate_test(model, test).ours.mean / DEG


@pytest.fixture
def job(tmp_path: Path) -> tuple[NormalModel, Campaign, Campaign]:
    """A shifted job of 60 holes, model and holes on the disk."""
    model, holes, test = shifted_job(1, 60)
    write_model(tmp_path / "m.robotrue", model)
    write_holes(tmp_path / "holes.csv", model, holes)
    return model, holes, test


def test_sixty_holes_moved_by_one_model_square_forty_machines(tmp_path: Path) -> None:
    before, after = np.empty((2, 40))
    for seed in range(40):
        model, holes, test = shifted_job(seed, 60)
        write_model(tmp_path / "m.robotrue", model)
        write_holes(tmp_path / "holes.csv", model, holes)
        before[seed] = mean_left(model, test)
        after[seed] = mean_left(refined_by(tmp_path), test)
    assert before.mean() > 0.006
    assert after.mean() <= 0.003
    assert (after < before).all()


def test_more_holes_of_one_model_do_not_add_the_same_residual_again(tmp_path: Path) -> None:
    model, holes, test = shifted_job(2, 200)
    write_model(tmp_path / "m.robotrue", model)
    write_holes(tmp_path / "holes.csv", model, holes)
    assert mean_left(refined_by(tmp_path), test) < 0.5 * mean_left(model, test)


def test_the_deviation_of_the_reference_weighs_what_is_learned(
    job: tuple[NormalModel, Campaign, Campaign], tmp_path: Path
) -> None:
    learned = [
        np.hypot(*refined_by(tmp_path, sigma_deg=sigma).refinement.coefficients[0])
        for sigma in (0.002, 0.02, 0.2, 2.0)
    ]
    assert (np.diff(learned) < 0.0).all()
    assert learned[0] > 0.004 * DEG
    assert learned[-1] < 0.01 * learned[0]


def test_a_model_that_refinement_made_worse_is_not_frozen(
    job: tuple[NormalModel, Campaign, Campaign], tmp_path: Path
) -> None:
    model, holes, test = job
    write_campaign(tmp_path / "test.csv", test)
    assert refined_by(tmp_path, freeze=tmp_path / "test.csv").frozen is not None
    before = (tmp_path / "refined.robotrue").read_bytes()
    write_holes(tmp_path / "holes.csv", model, holes, sign=-1.0)
    with pytest.raises(ConfigurationError, match="before it was refined: it is not frozen"):
        refined_by(tmp_path, freeze=tmp_path / "test.csv")
    assert (tmp_path / "refined.robotrue").read_bytes() == before


def test_a_model_is_frozen_as_it_is_without_records(
    job: tuple[NormalModel, Campaign, Campaign], tmp_path: Path
) -> None:
    write_campaign(tmp_path / "test.csv", job[2])
    kept = refined_by(tmp_path, records=None, freeze=tmp_path / "test.csv")
    assert kept.frozen is not None
    assert kept.refinement.records == 0
    with pytest.raises(ConfigurationError, match="no RECORDS"):
        refined_by(tmp_path, records=None)


def test_late_references_count_for_the_model_that_moved_the_hole(
    job: tuple[NormalModel, Campaign, Campaign], tmp_path: Path
) -> None:
    model, holes, test = job
    with Journal(tmp_path / "holes.jsonl") as journal:
        for i in range(len(holes)):
            clamps = holes.clamps.take(np.array([i]))
            answer = HoleAnswer(
                hole=f"H{i}", clamps=clamps, axes=np.zeros(2), refused="", version=model.version,
                adjustment=adjustment(model, clamps, np.zeros(2)),
            )  # fmt: skip
            journal.write_answer(answer, answer_document(answer))
    with Journal(tmp_path / "holes.jsonl") as journal:
        session = HoleSession(
            model, settings=ClampSettings(), reference=GAUGE, waiting=journal.state.waiting
        )
    random = np.random.default_rng(5)
    left = holes.tilt - estimate_tilt(model, holes.clamps).tilt + random.normal(0.0, GAUGE, (60, 2))
    for i in range(len(holes)):
        session.take_reference(f"H{i}", left[i], "hole gauge")
    assert session.model.refinement.records == 60
    assert mean_left(session.model, test) < 0.5 * mean_left(model, test)
