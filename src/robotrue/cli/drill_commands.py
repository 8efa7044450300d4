"""Signatures of the commands about the drilling normal: ``robotrue drill ...``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robotrue.app.outputs import CSV, MODEL
from robotrue.cli.app import Json, app

drill = typer.Typer(
    name="drill",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Square the drill to the surface: a foot's readings, corrected.",
)
app.add_typer(drill)

FootFile = Annotated[Path, typer.Argument(metavar="FOOT", help="Foot file (TOML).")]
CampaignFile = Annotated[
    Path, typer.Argument(metavar="CAMPAIGN", help="Clamps with known tilts (CSV or workbook).")
]
DrillModel = Annotated[Path, typer.Argument(metavar="MODEL", help="Model file of `drill fit`.")]


@drill.command()
def fit(
    foot: FootFile,
    campaign: CampaignFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Model file to write.", callback=MODEL)
    ],
    kind: Annotated[
        str,
        typer.Option(
            help="auto (what wins on held-out forces and tilts), patent, interactions, quadratic, "
            "cubic, gp or physics."
        ),
    ] = "auto",
    json: Json = False,
) -> None:
    """Learn what makes a foot's readings wrong."""
    from robotrue.cli.drill import run_fit

    run_fit(foot, campaign, output, kind=kind, as_json=json)


@drill.command()
def evaluate(
    model: DrillModel,
    test: Annotated[Path, typer.Argument(metavar="TEST", help="Clamps the fit has not seen.")],
    foot: Annotated[
        Path | None, typer.Option(help="Foot file, where the readings are not less their zero.")
    ] = None,
    json: Json = False,
) -> None:
    """Say what tilt one move leaves: uncorrected, by the patent's regression, by the model."""
    from robotrue.cli.drill import run_evaluate

    run_evaluate(model, test, foot=foot, as_json=json)


@drill.command()
def adjust(
    model: DrillModel,
    reading: Annotated[str, typer.Option(help="d1,d2,d3 in mm, less their zero.")],
    force: Annotated[float, typer.Option(help="Clamp force in N.")],
    z: Annotated[float, typer.Option(help="Position of the Z axis in mm.")],
    at: Annotated[
        str | None, typer.Option(help="A,B of the machine now, in deg; default 0,0.")
    ] = None,
    approach: Annotated[
        str, typer.Option(help="How the foot came down; default the usual way.")
    ] = "",
    robot: Annotated[
        Path | None, typer.Option(help="A robot carries the foot: its calibrated model.")
    ] = None,
    joints_deg: Annotated[
        str | None, typer.Option(help="With --robot: its joints now, in the model's sense.")
    ] = None,
    foot_abc_deg: Annotated[
        str,
        typer.Option(help="With --robot: A,B,C of the foot in the tool; default z against z."),
    ] = "0,0,180",
    language: Annotated[
        str | None,
        typer.Option("--as", help="Also print the move: gcode; with --robot krl, rapid, urscript."),
    ] = None,
    feed_mm_per_min: Annotated[float, typer.Option(help="Feed of --as gcode.")] = 500.0,
    json: Json = False,
) -> None:
    """Give the one move that squares the spindle to the surface under the foot."""
    from robotrue.cli.drill_adjust import run

    run(
        model,
        reading=reading,
        force=force,
        z_mm=z,
        at=at,
        approach=approach,
        robot=robot,
        joints_deg=joints_deg,
        foot_abc_deg=foot_abc_deg,
        language=language,
        feed_mm_per_min=feed_mm_per_min,
        as_json=json,
    )


@drill.command()
def plan(
    foot: FootFile,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Execution sheet (CSV) to write.", callback=CSV)
    ],
    clamps: Annotated[int, typer.Option(help="How many; 15 at least.")] = 60,
    forces_N: Annotated[
        str, typer.Option("--forces-n", help="Clamp forces in N.")
    ] = "0,250,500,750,1000",
    z_mm: Annotated[str, typer.Option(help="Heights in mm.")] = "-100,0,100",
    tilt_deg: Annotated[float, typer.Option(help="Largest tilt in deg.")] = 4.0,
    by: Annotated[str, typer.Option(help="information or chance.")] = "information",
    seed: Annotated[int, typer.Option(help="Of tilts and order.")] = 0,
    json: Json = False,
) -> None:
    """Plan a campaign: which tilts, forces and heights to clamp at, in which order."""
    from robotrue.cli.drill_production import run_plan

    run_plan(
        foot,
        output,
        clamps=clamps,
        forces_N=forces_N,
        z_mm=z_mm,
        tilt_deg=tilt_deg,
        by=by,
        seed=seed,
        as_json=json,
    )


@drill.command()
def refine(
    model: DrillModel,
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Model file to write.", callback=MODEL)
    ],
    records: Annotated[
        Path | None,
        typer.Argument(
            metavar="[RECORDS]",
            help="Holes that MODEL moved, with left_a_deg, left_b_deg as a reference measured "
            "them; with --freeze it may be left out.",
        ),
    ] = None,
    truth: Annotated[
        str, typer.Option(help="What measured what was left: a mandrel plane, a hole gauge, ...")
    ] = "",
    sigma_deg: Annotated[
        float, typer.Option(help="Standard deviation of that reference in deg.")
    ] = 0.005,
    freeze: Annotated[
        Path | None, typer.Option(help="Then freeze the model, if it does well on these clamps.")
    ] = None,
    allowed_deg: Annotated[
        float, typer.Option(help="With --freeze: 95 % of the tilts left must be within.")
    ] = 0.1,
    foot: Annotated[
        Path | None, typer.Option(help="Foot file, where the readings are not less their zero.")
    ] = None,
    json: Json = False,
) -> None:
    """Take what an outside reference measured into a model; watch it; freeze it."""
    from robotrue.cli.drill_production import run_refine

    run_refine(
        model,
        records,
        output,
        truth=truth,
        sigma_deg=sigma_deg,
        freeze=freeze,
        allowed_deg=allowed_deg,
        foot=foot,
        as_json=json,
    )


@drill.command()
def report(
    model: DrillModel,
    test: Annotated[Path, typer.Argument(metavar="TEST", help="Clamps the fit has not seen.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", help="Report to write: .html, .pdf or .json.")
    ],
    limit_deg: Annotated[float, typer.Option(help="95 % of the holes are to be within.")] = 0.1,
    simulated: Annotated[
        bool, typer.Option("--simulated", help="Say on the page that the test is simulated.")
    ] = False,
    foot: Annotated[
        Path | None, typer.Option(help="Foot file, where the readings are not less their zero.")
    ] = None,
    lang: Annotated[str, typer.Option(help="en or zh.")] = "en",
    json: Json = False,
) -> None:
    """Write the report of a model: what one move leaves, and what it was tested on."""
    from robotrue.cli.drill import run_report

    run_report(
        model,
        test,
        output,
        foot=foot,
        limit_deg=limit_deg,
        simulated=simulated,
        lang=lang,
        as_json=json,
    )


@drill.command(name="run")
def run_online(
    model: DrillModel,
    journal: Annotated[
        Path,
        typer.Option(help="What is answered and learned, a line each; gone on with if there."),
    ],
    address: Annotated[
        str, typer.Option("--from", help="Where the machine's values come in.")
    ] = "udp://127.0.0.1:47600",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="Model file, written after every reference.", callback=MODEL
        ),
    ] = None,
    foot: Annotated[
        Path | None, typer.Option(help="Foot file, where the readings are not less their zero.")
    ] = None,
    approach: Annotated[
        str, typer.Option(help="How the foot comes down; default the usual way.")
    ] = "",
    truth: Annotated[
        str, typer.Option(help="What measures the tilts left, where they do not say so.")
    ] = "",
    sigma_deg: Annotated[
        float, typer.Option(help="Standard deviation of that reference in deg.")
    ] = 0.005,
    clamp_force_N: Annotated[
        float, typer.Option("--clamp-force-n", help="Force above which the foot is clamped, N.")
    ] = 50.0,
    quiet_ms: Annotated[float, typer.Option(help="Time in which nothing may move.")] = 200.0,
    steady_um: Annotated[
        float, typer.Option(help="What a reading may move by in that time.")
    ] = 20.0,
    steady_N: Annotated[
        float, typer.Option("--steady-n", help="What the force may move by in that time.")
    ] = 10.0,
    patience_s: Annotated[float, typer.Option(help="Then a restless clamp is given up.")] = 5.0,
    seconds: Annotated[float | None, typer.Option(help="End after so long.")] = None,
    robot: Annotated[
        Path | None, typer.Option(help="A robot carries the foot: its calibrated model.")
    ] = None,
    joints: Annotated[
        str | None,
        typer.Option(help="With --robot: where its joints come from, rsi://, egm:// or rtde://."),
    ] = None,
    foot_abc_deg: Annotated[
        str,
        typer.Option(help="With --robot: A,B,C of the foot in the tool; default z against z."),
    ] = "0,0,180",
    json: Json = False,
) -> None:
    """Stand by a machine: answer every clamp with one move, learn from references, watch."""
    from robotrue.cli.drill_run import run
    from robotrue.core.units import UM
    from robotrue.drilling.clamp_watch import ClampSettings

    run(
        model,
        address=address,
        journal=journal,
        output=output,
        foot=foot,
        approach=approach,
        truth=truth,
        sigma_deg=sigma_deg,
        settings=ClampSettings(
            force_on=clamp_force_N,
            force_off=0.4 * clamp_force_N,
            quiet=quiet_ms * 1e-3,
            reading_moves=steady_um * UM,
            force_moves=steady_N,
            patience=patience_s,
        ),
        seconds=seconds,
        robot=robot,
        joints=joints,
        foot_abc_deg=foot_abc_deg,
        as_json=json,
    )
