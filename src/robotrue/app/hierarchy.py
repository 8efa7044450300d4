"""``robotrue plan --method hierarchical``: options as settings, the poses as two tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robotrue.app.context import Context
from robotrue.app.number_options import parse_grid, parse_numbers, parse_posture
from robotrue.app.plan_request import PlanRequest
from robotrue.app.presentation import Block, Note, Table
from robotrue.app.transfer_method import parse_cylinder
from robotrue.calibration.deng2022.domains import divide_target
from robotrue.cell.cell import Cell
from robotrue.core.arrays import Array
from robotrue.core.provenance import MEASURED, Provenance
from robotrue.core.regions import describe_region
from robotrue.core.units import DEG
from robotrue.errors import ConfigurationError
from robotrue.planning.hierarchical_plan import (
    HierarchicalPlan,
    HierarchicalSettings,
    plan_hierarchy,
)
from robotrue.planning.plan_sheets import pose_sheet
from robotrue.robot.model import RobotModel

EXAMPLE = "-15..15/15,-10..10/5,-10..10/2.5"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedHierarchy:
    """Poses of a source and of its sub-spaces.

    Attributes:
        plan: The poses.
        files: Table of the source, table of the target.
        provenance: Nothing was measured.
    """

    plan: HierarchicalPlan
    files: tuple[Path, ...]
    provenance: Provenance = MEASURED

    def document(self) -> Mapping[str, object]:
        """Returns JSON values; deg."""
        plan = self.plan
        return {
            "poses_csv": str(self.files[0]),
            "target_csv": str(self.files[1]),
            "source_poses": len(plan.source),
            "target_poses": len(plan.target),
            "complete_poses": plan.complete,
            "sub_spaces": [
                {
                    "angle_deg": (np.array(region.angle) / DEG).tolist(),
                    "turned_by_deg": float(turn) / DEG,
                    "poses": int((plan.sub_space == k).sum()),
                }
                for k, (region, turn) in enumerate(
                    zip(plan.domains.sub_spaces, plan.domains.angles, strict=True)
                )
            ],
        }

    def blocks(self) -> Iterable[Block]:
        """Returns the number of poses of each region."""
        plan = self.plan
        rows = [("source", describe_region(plan.domains.source), "-", str(len(plan.source)))]
        for k, region in enumerate(plan.domains.sub_spaces):
            turn = f"{plan.domains.angles[k] / DEG:.4g}"
            count = str(int((plan.sub_space == k).sum()))
            rows.append((f"sub-space {k + 1}", describe_region(region), turn, count))
        yield Table(
            title=f"{len(plan.source) + len(plan.target)} poses",
            columns=("", "region", "turned by deg", "poses"),
            rows=tuple(rows),
        )
        yield Note(f"sampling every region like the source requires {plan.complete} poses")


def write_hierarchy(request: PlanRequest, cell: Cell, context: Context) -> PlannedHierarchy:
    """Returns the plan, its poses written to the table of the source and one next to it.

    Raises:
        ConfigurationError: Regions that were not stated, or invalid options.
        ReachError: A pose is out of reach.
    """
    regions = []
    for option, text in (
        ("--source-region", request.source_region),
        ("--target-region", request.target_region),
    ):
        region = parse_cylinder(option, text)
        if region is None:
            raise ConfigurationError(
                f"--method hierarchical needs {option}.",
                hint=f"{option} angle_deg=-40..-30,radius_mm=800..1400,height_mm=700..1200",
            )
        regions.append(region)
    settings = HierarchicalSettings(
        counts=parse_grid(request.grid),
        steps=parse_turns(request.turns_deg),
        targets=request.target_poses,
        further=request.further,
        rule=request.target_rule,
        attitude=request.attitude,
        tool_abc=parse_numbers("--tool-abc-deg", request.tool_abc_deg, 3) * DEG,
        near=parse_posture(request.posture_deg, cell.robot),
        seed=request.seed,
    )
    domains = divide_target(regions[0], regions[1], request.sub_spaces)
    plan = plan_hierarchy(cell.measured_robot.nominal(), domains, settings)
    remark = ": fill in what the tracker reads"
    data = _sheet(plan.source, ["source"] * len(plan.source), cell.robot)
    source = context.write(request.output, data, f"{len(plan.source)} source poses", remark)
    target = source.with_name(f"{source.stem}_target{source.suffix}")
    data = _sheet(plan.target, [f"sub-space {k + 1}" for k in plan.sub_space], cell.robot)
    context.write(target, data, f"{len(plan.target)} target poses", remark)
    return PlannedHierarchy(plan=plan, files=(source, target))


def parse_turns(text: str) -> tuple[Array, Array, Array]:
    """Returns the values in rad of rx, ry, rz from ``LOW..HIGH/STEP`` or one number each.

    Raises:
        ConfigurationError: Not three of them, or a step that does not divide its range.
    """
    values = [_values(part) for part in text.split(",")]
    if len(values) != 3 or any(v is None for v in values):
        raise ConfigurationError(
            f"--turns-deg {text!r}, expected LOW..HIGH/STEP or a number for each of rx, ry, rz.",
            hint=f"--turns-deg={EXAMPLE}",
        )
    rx, ry, rz = (np.array(v) * DEG for v in values)
    return rx, ry, rz


def _values(text: str) -> list[float] | None:
    try:
        span, slash, step = text.partition("/")
        if not slash:
            return [float(text)]
        low, high = (float(v) for v in span.split(".."))
        count = round((high - low) / float(step))
    except (ValueError, ZeroDivisionError):
        return None
    if count < 1 or abs(low + count * float(step) - high) > 1e-9:
        return None
    return [low + k * float(step) for k in range(count + 1)]


def _sheet(joints: Array, names: list[str], robot: RobotModel) -> bytes:
    return pose_sheet(joints, robot, "fill in x_mm, y_mm, z_mm", {"set": names})
