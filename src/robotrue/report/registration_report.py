"""The report of a registered cell: the frames of its parts, and their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from robotrue.cell.part import PartFrame, PartTable
from robotrue.core.arrays import Array
from robotrue.core.files import DEFAULT_LANG
from robotrue.core.poses import propagate_covariance
from robotrue.core.rotations import abc_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.report.content import (
    Conclusion,
    Fact,
    KeyFigure,
    ReportContent,
    ReportTable,
    Section,
    TableColumn,
)
from robotrue.report.labels import column, columns, fact, plain_columns, tile, versions
from robotrue.report.words import Lang, ReportTexts
from robotrue.validation.budget import COVERAGE_FACTOR

LEVERS: Final = (0.0, 0.1, 0.25, 0.5, 1.0, 2.0)
"""m from the part's origin."""
DIRECTIONS: Final = 200
"""Directions a lever is tried in."""
_MM: Final = "mm"


def registration_content(
    part: PartTable,
    *,
    name: str,
    robot: str,
    simulated: bool = False,
    provenance: Sequence[Fact] = (),
    lang: Lang = DEFAULT_LANG,
) -> ReportContent:
    """Returns the content of a report about the part frames of a cell.

    Args:
        part: Of the registered cell.
        name: Of its file.
        robot: Name of the arm.
        simulated: Whether the touches are.
        provenance: Files and hashes.
        lang: Language of the report.
    """
    t = ReportTexts(lang=lang)
    bad = [frame.name for frame in part.frames if frame.verdict != "GO"]
    origin = max(_worst_axis(frame.covariance[:3, :3]) for frame in part.frames)
    text = (
        t("reg.no_go", names=", ".join(bad))
        if bad
        else t("reg.go", u=COVERAGE_FACTOR * origin / MM)
    )
    outliers = [
        t("reg.not_believed", part=frame.name, names=", ".join(frame.outliers))
        for frame in part.frames
        if frame.outliers
    ]
    return ReportContent(
        title=t("reg.title", name=", ".join(part.names)),
        subtitle=t("reg.subtitle", robot=robot, file=name),
        simulated=simulated,
        verdict=Conclusion(
            text=text,
            tone="bad" if bad else "good",
            detail=t(
                "reg.detail",
                kind=t(f"reg.{part.identity.kind}"),
                robot=part.identity.robot,
                digest=part.identity.sha256[:12],
            ),
        ),
        tiles=_tiles(part, origin, t),
        sections=(_frames(part, t), _uncertainty(part, t)),
        unseen=(t("reg.unseen_form"),),
        doubts=(*outliers, t("reg.doubt_arm")),
        provenance=(
            *provenance,
            fact(t, "fact.touches", f"{part.points_file} sha256:{part.points_sha256}"),
            fact(t, "fact.identity", f"{part.identity.kind} {part.identity.sha256}"),
            fact(t, "fact.model", part.model_file or "-"),
            *versions(),
        ),
        lang=lang,
    )


def _tiles(part: PartTable, origin: float, t: ReportTexts) -> tuple[KeyFigure, ...]:
    rms = max(frame.rms for frame in part.frames)
    touches = sum(frame.touches for frame in part.frames)
    return (
        tile(t, "reg.touches", float(touches), digits=0),
        tile(t, "reg.rms", rms / MM, _MM, note=t("reg.rms_note")),
        tile(t, "cert.U", COVERAGE_FACTOR * origin / MM, _MM),
    )


def _frames(part: PartTable, t: ReportTexts) -> Section:
    pose = ReportTable(
        title=t("reg.table"),
        columns=(
            column(t, "reg.part"),
            *plain_columns(*"XYZ", unit=_MM),
            *plain_columns(*"ABC", unit="deg", digits=4),
            *columns(t, "reg.touches", "reg.outliers"),
            column(t, "reg.rms", _MM),
            column(t, "reg.verdict"),
        ),
        rows=tuple(
            (
                frame.name,
                *(float(v) / MM for v in frame.T_base_part[:3, 3]),
                *(float(v) / DEG for v in abc_from_matrix(frame.T_base_part[:3, :3])),
                frame.touches,
                len(frame.outliers),
                frame.rms / MM,
                frame.verdict,
            )
            for frame in part.frames
        ),
    )
    return Section(title=t("reg.frames"), blocks=(pose,))


def _uncertainty(part: PartTable, t: ReportTexts) -> Section:
    sd = ReportTable(
        title=t("reg.sd"),
        columns=(
            column(t, "reg.part"),
            *(TableColumn(title=f"u({a})", unit=_MM, digits=4) for a in "xyz"),
            *(TableColumn(title=f"u(r{a})", unit="deg", digits=5) for a in "xyz"),
        ),
        rows=tuple(
            (
                frame.name,
                *(float(v) / MM for v in np.sqrt(np.diag(frame.covariance)[:3])),
                *(float(v) / DEG for v in np.sqrt(np.diag(frame.covariance)[3:])),
            )
            for frame in part.frames
        ),
        caption=t("reg.sd_text"),
    )
    levers = ReportTable(
        title=t("reg.levers"),
        columns=(
            column(t, "reg.lever", _MM, 0),
            *(
                TableColumn(title=f"{frame.name}: {t('reg.U')}", key=f"{frame.name} U", unit=_MM)
                for frame in part.frames
            ),
        ),
        rows=tuple(
            (lever / MM, *(COVERAGE_FACTOR * _at(frame, lever) / MM for frame in part.frames))
            for lever in LEVERS
        ),
        caption=t("reg.levers_text"),
    )
    return Section(title=t("reg.uncertainty"), blocks=(sd, levers))


def _at(frame: PartFrame, lever: float) -> float:
    """Standard uncertainty along the worst axis, for the worst direction of a lever, m."""
    return max(
        _worst_axis(part)
        for part in propagate_covariance(frame.covariance, lever * _directions(DIRECTIONS))
    )


def _worst_axis(covariance: Array) -> float:
    return float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0)))


def _directions(count: int) -> Array:
    """Unit vectors evenly over the sphere (a Fibonacci spiral)."""
    k = np.arange(count) + 0.5
    height = 1.0 - 2.0 * k / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - height**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)
