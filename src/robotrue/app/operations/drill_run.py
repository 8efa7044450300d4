"""Serve a drilling machine: one corrective move per clamp, updates from references, alarms."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from robotrue.app.context import Context
from robotrue.app.operation import operation
from robotrue.app.presentation import Block, Note, count
from robotrue.app.request import InputFile, Option, Request
from robotrue.app.request_fields import (
    CarryingRobot,
    DrillModel,
    FootAngles,
    ReferenceSigma,
    ZeroFoot,
    model_output,
)
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, UM
from robotrue.drilling.drill_defaults import (
    CLAMP_FORCE_N,
    FOOT_ABC_DEG,
    MODEL,
    PATIENCE_S,
    PORT,
    QUIET_MS,
    REFERENCE_SIGMA_DEG,
    RELEASED,
    STEADY_N,
    STEADY_UM,
)
from robotrue.errors import ConfigurationError, ModelMismatchError

if TYPE_CHECKING:
    from robotrue.drilling.clamp_watch import ClampSettings
    from robotrue.drilling.foot_model import NormalModel
    from robotrue.drilling.journal import Journal


class DrillRunRequest(Request):
    """Drilling model, address of the machine, and the rules for a clamp at rest."""

    model: DrillModel
    journal: Annotated[Path, InputFile()]
    """Journal of answers and updates, one line each; an existing journal is continued."""
    address: Annotated[str, Option(names=("--from",))] = f"udp://127.0.0.1:{PORT}"
    """Address that receives the machine's values."""
    output: Annotated[Path | None, model_output(renews="model")] = None
    """Model file, written after every reference."""
    foot: ZeroFoot = None
    approach: str = ""
    """Approach of the foot; default: the usual one."""
    truth: str = ""
    """Reference that measures the residual tilts, if the datagrams do not name it."""
    sigma_deg: Annotated[ReferenceSigma, Field(gt=0.0)] = REFERENCE_SIGMA_DEG
    clamp_force_N: Annotated[float, Option(names=("--clamp-force-n",))] = CLAMP_FORCE_N
    """Force above which the foot is clamped, N."""
    quiet_ms: float = QUIET_MS
    """Rest period."""
    steady_um: float = STEADY_UM
    """Maximum change of a reading in that period."""
    steady_N: Annotated[float, Option(names=("--steady-n",))] = STEADY_N
    """Maximum change of the force in that period."""
    patience_s: float = PATIENCE_S
    """A clamp without a rest period is refused after this time."""
    seconds: float | None = None
    """Run time in s; default: until Ctrl-C."""
    robot: CarryingRobot = None
    joints: str | None = None
    """With --robot: source of its joints, rsi://, egm:// or rtde://."""
    foot_abc_deg: FootAngles = FOOT_ABC_DEG


@dataclass(frozen=True, slots=True, kw_only=True)
class DrillServed:
    """A service that has ended.

    Attributes:
        summary: What it came to.
        provenance: Of the model and of the machine that spoke to it.
    """

    summary: str
    provenance: Provenance

    def document(self) -> None:
        """Returns nothing: every answer was a document."""
        return

    def blocks(self) -> Iterable[Block]:
        """Returns one line."""
        yield Note(self.summary)


@operation(is_service=True)
def run(request: DrillRunRequest, context: Context) -> DrillServed:
    """Answers clamps until stopped, or for a time.

    Raises:
        ModelMismatchError: A journal of a later version of the model.
        ConfigurationError: A model that uses positions of a head, and a robot carries the foot.
    """
    import asyncio

    from robotrue.app.drilling_desk import Desk, serve_desk
    from robotrue.app.drilling_robot import drilling_robot
    from robotrue.drilling.campaign_csv import setup_of
    from robotrue.drilling.foot_model import use_zero
    from robotrue.drilling.hole_session import HoleSession
    from robotrue.drilling.journal import Journal
    from robotrue.drilling.model_archive import read_model

    (path,) = context.document_files(request.model, MODEL)
    model, settings = read_model(path), _settings(request)
    if request.robot is not None and model.correction.inputs:
        raise ConfigurationError(
            f"the model uses the positions {', '.join(model.correction.inputs)} of a five-axis "
            "head; a robot carries the foot.",
            source=path,
            hint="fit the campaign with --inputs none.",
        )
    setup = setup_of(model, path, request.foot)
    model = use_zero(model, setup.taken_zero)
    with Journal(request.journal) as kept:
        model, said = _replay(request, model, kept, path)
        session = HoleSession(
            model,
            settings=settings,
            reference=request.sigma_deg * DEG,
            approach=request.approach,
            waiting=kept.state.waiting,
            count=kept.state.answered,
        )
        arm = None
        if request.robot is not None:
            arm = drilling_robot(
                request.robot,
                request.joints,
                model.head.order,
                request.foot_abc_deg,
                still=settings.quiet,
            )
        desk = Desk(
            session,
            setup,
            kept,
            truth=request.truth,
            output=request.output,
            robot=arm,
            reporter=context,
        )
        asyncio.run(serve_desk(desk, request.address, request.seconds, begin=said))
    return DrillServed(summary=desk.summary(), provenance=desk.provenance)


def _settings(request: DrillRunRequest) -> ClampSettings:
    from robotrue.drilling.clamp_watch import ClampSettings

    return ClampSettings(
        force_on=request.clamp_force_N,
        force_off=RELEASED * request.clamp_force_N,
        quiet=request.quiet_ms * 1e-3,
        reading_moves=request.steady_um * UM,
        force_moves=request.steady_N,
        patience=request.patience_s,
    )


def _replay(
    request: DrillRunRequest, model: NormalModel, kept: Journal, path: Path
) -> tuple[NormalModel, str]:
    """Brings the model up to date with its journal; returns it with a message."""
    from robotrue.drilling.journal import replay_references
    from robotrue.drilling.model_archive import write_model

    journal = request.journal
    model, replayed = replay_references(
        model, kept.state.references, reference_sigma=request.sigma_deg * DEG, source=journal
    )
    if kept.state.version > model.version:
        raise ModelMismatchError(
            f"{journal} was written with version {kept.state.version} of the model, this is "
            f"version {model.version}.",
            source=path,
            hint="the model that run wrote with -o, or another journal.",
        )
    if not replayed:
        return model, ""
    if request.output is not None:
        write_model(request.output, model)
    return model, (
        f"note: {count(replayed, 'reference')} of {journal.name} imported into the model, which "
        f"was written before them; it is version {model.version} now"
    )
