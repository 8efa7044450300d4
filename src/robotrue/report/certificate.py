"""The calibration certificate: a validation, its uncertainty budget, its limits and its lineage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from robotrue.calibration.training_summary import read_step
from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.files import DEFAULT_LANG
from robotrue.core.units import DEG, MM
from robotrue.report.budget_section import budget_section
from robotrue.report.calibration_report import calibration_content
from robotrue.report.certificate_head import (
    CertificateHead,
    list_head_facts,
    list_signers,
    read_logo,
)
from robotrue.report.content import (
    Cell,
    Conclusion,
    Fact,
    KeyFigure,
    ReportContent,
    ReportTable,
    Section,
    TableColumn,
)
from robotrue.report.labels import (
    axis_columns,
    column,
    columns,
    fact,
    statistics_table,
    tile,
    versions,
)
from robotrue.report.map_plots import UncertaintyMap
from robotrue.report.words import ENGLISH, Lang, ReportTexts
from robotrue.validation.budget import Budget
from robotrue.validation.error_map import KnownPlaces
from robotrue.validation.iso9283 import RepeatedPose
from robotrue.validation.metrics import ErrorStatistics
from robotrue.validation.report import ValidationReport

MOST_POSES: Final = 12
"""Repeated poses printed."""
FEWEST_QUARTERED: Final = 20
"""Fewest rows of one set for separate statistics of its quarters."""
_MM: Final = "mm"


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One identified parameter in shop units.

    Attributes:
        name: As in the model.
        value: In ``unit``.
        sd: Standard deviation, in ``unit``.
        unit: mm, deg, ppm or 1e-6 rad/(N m).
        known: How the data determine it: ``seen``, ``weakly seen``, ``prior only``.
    """

    name: str
    value: float
    sd: float
    unit: str
    known: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CertificateFacts:
    """Data of a certificate. SI.

    Attributes:
        robot: Name of the arm.
        method: Of the calibration.
        simulated: Whether any data are simulated.
        budget: Over the poses of the check, or over ``places`` without one.
        places: Uncertainty of the tool point over the training range; None where not known.
        check: Of the held-out poses; None without a test file.
        regions: Name and statistics of the parts of the check.
        repeats: Poses of the check visited again.
        parameters: Identified.
        lineage: Steps that made the model, oldest first, as it records them.
        unseen: What the data cannot determine.
        doubts: Of the model, where there is no check.
        held_out: m, mean error on held-out blocks of the training rows; None if not recorded.
        provenance: Files and hashes.
        head: Number, dates, customer, robot, instrument and place, as far as stated.
    """

    robot: str
    method: str
    simulated: bool
    budget: Budget
    places: KnownPlaces | None
    check: ValidationReport | None
    regions: tuple[tuple[str, ErrorStatistics], ...] = ()
    repeats: tuple[RepeatedPose, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    lineage: tuple[Mapping[str, object], ...] = ()
    unseen: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    held_out: float | None = None
    provenance: tuple[Fact, ...] = ()
    head: CertificateHead = field(default=CertificateHead())


def certificate_content(
    facts: CertificateFacts, *, tolerance: float | None = None, lang: Lang = DEFAULT_LANG
) -> ReportContent:
    """Returns the content of a certificate.

    Args:
        facts: Measured and computed data.
        tolerance: m; the verdict then states whether 95 % of the held-out poses meet it.
        lang: Language of the report.
    """
    t = ReportTexts(lang=lang)
    title = t("cert.title", robot=facts.robot)
    subtitle = t("cert.subtitle", method=facts.method)
    limits = (*facts.unseen, *_not_in_budget(facts, t))
    if facts.check is None:
        body = _build_unchecked(facts, title, subtitle, t)
    else:
        body = calibration_content(
            facts.check,
            title=title,
            subtitle=subtitle,
            simulated=facts.simulated,
            tolerance=tolerance,
            unseen=facts.unseen,
            provenance=facts.provenance,
            lang=lang,
        )
    sections = [budget_section(facts.budget, t), *body.sections]
    if facts.regions:
        table = statistics_table(t("cal.regions"), facts.regions, words=t, highlight=None)
        table = replace(table, caption=t("cal.regions_text"))
        sections.insert(2, Section(title=t("cert.regions"), blocks=(table,)))
    if facts.places is not None:
        sections.append(_places(facts.places, t))
    sections.append(_repeats(facts, t))
    if facts.parameters:
        sections.append(_parameters(facts.parameters, t))
    if facts.lineage:
        sections.append(_lineage(facts.lineage, t))
    note = t("cert.U_note", worst=facts.budget.worst / MM)
    expanded = tile(t, "cert.U", facts.budget.expanded / MM, _MM, note=note)
    return replace(
        body,
        tiles=(*body.tiles[:3], expanded, *body.tiles[3:]),
        sections=tuple(sections),
        unseen=tuple(map(t.sentence, limits)),
        doubts=(*body.doubts, *_registration_doubt(facts, t), t("cert.no_accreditation")),
        head=(*list_head_facts(facts.head, t), _decision_rule(facts, tolerance, t)),
        signers=list_signers(facts.head, t),
        logo=read_logo(facts.head),
    )


def _decision_rule(facts: CertificateFacts, tolerance: float | None, t: ReportTexts) -> Fact:
    """Returns the decision rule, ISO/IEC 17025:2017, 7.8.6."""
    if tolerance is None or facts.check is None:
        return fact(t, "head.rule", t("cert.no_rule"))
    return fact(t, "head.rule", t("cert.rule", tolerance=tolerance / MM))


def check_regions(
    position: Array, group: IntArray, names: Sequence[str], *, lang: Lang = DEFAULT_LANG
) -> tuple[tuple[str, IntArray], ...]:
    """Returns name and rows of each part of a check: its sets, or the quarters of its one set.

    Args:
        position: (n, 3) m in base.
        group: (n,) set of each row.
        names: Of the sets.
        lang: Language of the names of quarters.
    """
    t = ReportTexts(lang=lang)
    present = np.unique(group)
    if len(present) > 1:
        return tuple((names[int(g)], _rows(group == g)) for g in present)
    if len(position) < FEWEST_QUARTERED:
        return ()
    a, b = np.sort(np.argsort(-np.ptp(position, axis=0), kind="stable")[:2])
    high = position > np.median(position, axis=0)
    out: list[tuple[str, IntArray]] = []
    for first in (False, True):
        for second in (False, True):
            rows = _rows((high[:, a] == first) & (high[:, b] == second))
            sides = [t("cal.high") if side else t("cal.low") for side in (first, second)]
            name = t("cal.quarter", a="xyz"[a], b="xyz"[b], a_side=sides[0], b_side=sides[1])
            if len(rows):
                out.append((name, rows))
    return tuple(out)


def _rows(mask: BoolArray) -> IntArray:
    return np.asarray(np.flatnonzero(mask), dtype=np.int64)


def _build_unchecked(
    facts: CertificateFacts, title: str, subtitle: str, t: ReportTexts
) -> ReportContent:
    """Returns the body without measured held-out poses, which it states first."""
    tiles: tuple[KeyFigure, ...] = ()
    if facts.held_out is not None:
        note = t("cert.blocks_note")
        tiles = (tile(t, "cert.blocks", facts.held_out / MM, _MM, note=note),)
    return ReportContent(
        title=title,
        subtitle=subtitle,
        simulated=facts.simulated,
        verdict=Conclusion(
            text=t("cert.unchecked", U=facts.budget.expanded / MM),
            tone="caution",
            detail=t("cert.unchecked_detail"),
        ),
        tiles=tiles,
        unseen=tuple(map(t.sentence, facts.unseen)),
        doubts=tuple(map(t.sentence, facts.doubts)),
        provenance=(*facts.provenance, *versions()),
        lang=t.lang,
    )


def _not_in_budget(facts: CertificateFacts, t: ReportTexts) -> tuple[str, ...]:
    lines = {c.name: c for c in facts.budget.contributions}
    out = []
    if "registration" not in lines:
        out.append(t("cert.no_registration"))
    if lines["force"].value == 0.0:
        out.append(t("cert.no_force", c=lines["force"].sensitivity * 100.0 / MM))
    out.append(t("cert.no_temperature"))
    return tuple(out)


def _registration_doubt(facts: CertificateFacts, t: ReportTexts) -> tuple[str, ...]:
    names = {c.name for c in facts.budget.contributions}
    return (t("cert.registration_apart"),) if "registration" in names else ()


def _places(places: KnownPlaces, t: ReportTexts) -> Section:
    return Section(
        title=t("cert.places"),
        text=t("cert.places_text", n=len(places.radius)),
        blocks=(
            UncertaintyMap(
                position=places.position,
                radius=places.radius,
                title=t("cert.places_map"),
                caption=t(
                    "cert.places_caption",
                    low=float(places.radius.min()) / MM,
                    middle=float(np.median(places.radius)) / MM,
                    high=float(places.radius.max()) / MM,
                ),
            ),
        ),
    )


def _repeats(facts: CertificateFacts, t: ReportTexts) -> Section:
    """ISO 9283 symbols where their definition was measured; a sentence where it was not."""
    if not facts.repeats:
        return Section(title=t("iso.title"), text=t("iso.none"))
    standard = all(pose.is_standard for pose in facts.repeats)
    names = ("AP_P", "RP_l") if standard else (t("iso.offset"), t("iso.spread"))
    keys = ("AP_P", "RP_l") if standard else (ENGLISH("iso.offset"), ENGLISH("iso.spread"))
    rows: list[tuple[Cell, ...]] = []
    for k, pose in enumerate(facts.repeats[:MOST_POSES]):
        c = pose.characteristics
        rows.append(
            (
                k + 1,
                c.n,
                c.AP_p / MM,
                c.RP_l / MM,
                *(float(v) / MM for v in c.AP_xyz),
                pose.compensated / MM,
                *(float(q) / DEG for q in pose.axes),
            )
        )
    axes = tuple(
        TableColumn(title=f"AP_{a}" if standard else a, key=f"mean_{a}", unit=_MM) for a in "xyz"
    )
    table = ReportTable(
        title=t("iso.table"),
        columns=(
            *columns(t, "pose", "n"),
            *(TableColumn(title=a, unit=_MM, key=k) for a, k in zip(names, keys, strict=True)),
            *axes,
            column(t, "iso.compensated", _MM),
            *axis_columns(len(facts.repeats[0].axes)),
        ),
        rows=tuple(rows),
        caption=t("iso.standard" if standard else "iso.few"),
    )
    return Section(title=t("iso.title"), blocks=(table,))


def _parameters(parameters: Sequence[Parameter], t: ReportTexts) -> Section:
    measured = [p for p in parameters if p.known != "prior only"]
    unseen = len(parameters) - len(measured)
    key = "cert.parameter_unseen" if unseen == 1 else "cert.parameters_unseen"
    note = f" {t(key, n=unseen)}" if unseen else ""
    table = ReportTable(
        title=t("cert.parameters"),
        columns=(
            column(t, "cert.parameter"),
            *columns(t, "cert.value", "cert.sd", digits=4),
            *columns(t, "cert.unit", "cert.known"),
        ),
        rows=tuple(
            (_name_parameter(p.name, t), p.value, p.sd, p.unit, t(f"known.{p.known}"))
            for p in measured
        ),
        caption=t("cert.parameters_text") + note,
    )
    return Section(title=t("cert.identified"), blocks=(table,))


def _name_parameter(name: str, t: ReportTexts) -> str:
    """The words for a name of :func:`robotrue.robot.model.parameter_names`."""
    frame, _, term = name.partition("_")
    if frame in ("base", "tool"):
        return t(f"param.{frame}", term=term)
    group = name.rstrip("0123456789")
    return t(f"param.{group}", axis=name.removeprefix(group))


def _lineage(lineage: Sequence[Mapping[str, object]], t: ReportTexts) -> Section:
    rows = tuple(
        (
            k + 1,
            t(f"step.{step.step}") if step.step in ("fit", "update", "transfer") else step.step,
            step.rows,
            step.data_sha256[:16],
            "; ".join(step.sources),
        )
        for k, step in enumerate(map(read_step, lineage))
    )
    names = ("lineage.number", "lineage.step", "lineage.rows", "lineage.hash", "lineage.sources")
    return Section(
        title=t("lineage.title"),
        blocks=(
            ReportTable(
                title=t("lineage.table"),
                columns=columns(t, *names),
                rows=rows,
                caption=t("lineage.text"),
            ),
        ),
    )
