"""Signatures of ``robotrue sense``: the service itself, and ``sense align``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from robotrue.app.outputs import JSON
from robotrue.cli.app import CellFile, Json, app


class _ServiceFirst(TyperGroup):
    """A group in which ``sense CELL ...`` means ``sense run CELL ...``."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Returns what is left after the name of the command was put in where it is missing."""
        if args and args[0] not in (*self.commands, "--help"):
            args = ["run", *args]
        return super().parse_args(ctx, args)


sense = typer.Typer(
    name="sense",
    cls=_ServiceFirst,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Sense the tool's error online; `sense CELL ...` is `sense run CELL ...`.",
)
app.add_typer(sense)


@sense.command()
def run(
    cell: CellFile,
    robot: Annotated[
        str, typer.Option(help="Joints: rsi://, egm://, rtde:// or replay://FILE.csv")
    ],
    force: Annotated[
        str, typer.Option(help="Force: rdt://, egm://, rtde:// or replay://FILE.csv|.tdms")
    ],
    out: Annotated[
        list[str] | None,
        typer.Option(help="Sink, as often as wanted: csv:FILE, mqtt://, opcua://, ws://"),
    ] = None,
    record: Annotated[
        Path | None, typer.Option(help="Folder of the record: every sample and every estimate.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the record and the files that are there.")
    ] = False,
    rate_hz: Annotated[
        float | None, typer.Option(help="Force samples per second, where no address says it.")
    ] = None,
    model: Annotated[Path | None, typer.Option(help="Model of `calibrate`: stiffness.")] = None,
    frf: Annotated[Path | None, typer.Option(help="Frequency response of the tool.")] = None,
    frf_joints: Annotated[
        str | None, typer.Option(help="A1,..,A6 in deg, as displayed at the hammer test.")
    ] = None,
    frf_frame: Annotated[str | None, typer.Option(help="Its axes: base or tool.")] = None,
    tool: Annotated[
        Path | None, typer.Option(help="Held tool, of `dynamics sensor`: weight and offset.")
    ] = None,
    sensor: Annotated[
        str | None, typer.Option(help="Force sensor on the flange, X,Y,Z,A,B,C in mm and deg.")
    ] = None,
    deviation: Annotated[Path | None, typer.Option(help="Of `dynamics fit`.")] = None,
    spindle_rpm: Annotated[float | None, typer.Option(help="For --deviation.")] = None,
    force_most_n: Annotated[
        float | None, typer.Option("--force-most-n", help="Range of the force sensor.")
    ] = None,
    clock: Annotated[Path | None, typer.Option(help="Of `sense align`.")] = None,
    correct: Annotated[
        bool, typer.Option("--correct", help="Send corrections to the robot. Read the how-to.")
    ] = False,
    limit_mm: Annotated[float | None, typer.Option(help="Largest correction.")] = None,
    rate_mm_per_s: Annotated[float | None, typer.Option(help="Its fastest change.")] = None,
    watchdog_ms: Annotated[float, typer.Option(help="Oldest estimate that is acted on.")] = 100.0,
    recover: Annotated[
        bool,
        typer.Option("--recover", help="After a fault begin again from zero, once all is well."),
    ] = False,
    peer: Annotated[
        str | None,
        typer.Option(
            help="Address of the controller; other senders are ignored. Needed to correct."
        ),
    ] = None,
    trust_restart: Annotated[
        bool,
        typer.Option(
            "--trust-restart",
            help="RSI: a Delay near zero after a pause is a new RSI_ON without correction.",
        ),
    ] = False,
    confirm_zero: Annotated[
        bool,
        typer.Option("--confirm-zero", help="I have checked: the robot holds no correction."),
    ] = False,
    low_pass_hz: Annotated[float, typer.Option(help="Of the correction.")] = 2.0,
    correct_in: Annotated[
        str,
        typer.Option(help="Axes of the controller's correction: base, tool, path, A,B,C in deg."),
    ] = "base",
    name: Annotated[str | None, typer.Option(help="Of the cell, in topics and pages.")] = None,
    note: Annotated[
        str, typer.Option(help="Shown beside every estimate: `simulated` for one.")
    ] = "",
    nodesets: Annotated[Path | None, typer.Option(help="OPC UA NodeSet files.")] = None,
    seconds: Annotated[float | None, typer.Option(help="How long; default: until Ctrl-C.")] = None,
    json: Json = False,
) -> None:
    """Say at every force sample how far the tool is off, and how well that is known."""
    from robotrue.cli.sense import SenseOptions, run_sense

    run_sense(
        SenseOptions(
            cell=cell,
            robot=robot,
            force=force,
            out=tuple(out or ()),
            record=record,
            resume=resume,
            rate=rate_hz,
            model=model,
            frf=frf,
            frf_joints=frf_joints,
            frf_frame=frf_frame,
            tool=tool,
            sensor=sensor,
            deviation=deviation,
            spindle_rpm=spindle_rpm,
            force_most=force_most_n,
            clock=clock,
            correct=correct,
            limit_mm=limit_mm,
            rate_mm_per_s=rate_mm_per_s,
            watchdog_ms=watchdog_ms,
            recover=recover,
            peer=peer,
            trust_restart=trust_restart,
            confirm_zero=confirm_zero,
            low_pass_hz=low_pass_hz,
            correct_in=correct_in,
            name=name,
            note=note,
            nodesets=nodesets,
            seconds=seconds,
        ),
        as_json=json,
    )


@sense.command()
def align(
    joints: Annotated[Path, typer.Argument(metavar="JOINTS.csv", help="Recorded jog, joints.")],
    force: Annotated[
        Path, typer.Argument(metavar="FORCE", help="The same jog, force: CSV or TDMS.")
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Clock file to write (JSON).", callback=JSON)
    ],
    most_s: Annotated[float, typer.Option(help="How far apart the clocks may be.")] = 1.0,
    json: Json = False,
) -> None:
    """Find offset and drift between two recorded clocks from a jog."""
    from robotrue.cli.sense_align import run

    run(joints, force, output, most=most_s, as_json=json)
