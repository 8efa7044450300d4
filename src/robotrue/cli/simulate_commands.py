"""Signatures of ``robotrue simulate ...``: controllers, a force sensor, a drilling head."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robotrue.app.outputs import CSV, XML
from robotrue.cli.app import Json, app

simulate = typer.Typer(
    name="simulate",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    help="Simulated controllers and sensors for `sense`, and a drilling head for `drill run`.",
)
app.add_typer(simulate)

Host = Annotated[str, typer.Option(help="Its own address; 0.0.0.0 lets other computers in.")]
Target = Annotated[str, typer.Option(help="Computer that it sends to.")]
Seconds = Annotated[float | None, typer.Option(help="Ends then; otherwise with Ctrl-C.")]
Seed = Annotated[int, typer.Option(help="Of the cutter and of the noise.")]
Robot = Annotated[
    str | None,
    typer.Option(help="Preset: KR160, UR10; otherwise the arm of the virtual milling experiment."),
]
Faults = Annotated[
    list[str] | None,
    typer.Option("--fault", help="KIND@START_S+DURATION_S, once or more; a wrong one says which."),
]


@simulate.command()
def rsi(
    host: Target = "127.0.0.1",
    port: Annotated[
        int | None, typer.Option(help="UDP port that it sends to; 0 picks a free one.")
    ] = None,
    config: Annotated[
        Path | None, typer.Option(help="EthernetConfig.xml; otherwise the usual one.")
    ] = None,
    cycle_ms: Annotated[int, typer.Option(help="4 (IPO_FAST) or 12 (IPO).")] = 4,
    mode: Annotated[str, typer.Option(help="Of corrections: absolute or relative.")] = "absolute",
    robot: Robot = None,
    seconds: Seconds = None,
    seed: Seed = 0,
    fault: Faults = None,
    json: Json = False,
) -> None:
    """A KUKA controller: sends a packet every cycle and judges each answer."""
    from robotrue.cli.simulate import run_rsi

    run_rsi(
        host,
        port,
        config=config,
        cycle_ms=cycle_ms,
        mode=mode,
        robot=robot,
        seconds=seconds,
        seed=seed,
        faults=fault or [],
        as_json=json,
    )


@simulate.command()
def egm(
    host: Target = "127.0.0.1",
    port: Annotated[
        int, typer.Option(help="UDP port that it sends to; 0 picks a free one.")
    ] = 6510,
    robotware: Annotated[int, typer.Option(help="6 or 7: their messages differ.")] = 7,
    no_force: Annotated[bool, typer.Option("--no-force", help="Sends no measured force.")] = False,
    robot: Robot = None,
    seconds: Seconds = None,
    seed: Seed = 0,
    fault: Faults = None,
    json: Json = False,
) -> None:
    """An ABB controller: sends a message every 4 ms and takes path corrections."""
    from robotrue.cli.simulate import run_egm

    run_egm(
        host,
        port,
        robotware=robotware,
        force=not no_force,
        robot=robot,
        seconds=seconds,
        seed=seed,
        faults=fault or [],
        as_json=json,
    )


@simulate.command()
def rtde(
    host: Host = "127.0.0.1",
    port: Annotated[int, typer.Option(help="TCP port; 0 takes a free one.")] = 30004,
    robot: Robot = "UR10",
    seconds: Seconds = None,
    seed: Seed = 0,
    fault: Faults = None,
    json: Json = False,
) -> None:
    """A Universal Robots controller: joints, tool point and force, 500 times a second."""
    from robotrue.cli.simulate import run_rtde

    run_rtde(host, port, robot=robot, seconds=seconds, seed=seed, faults=fault or [], as_json=json)


@simulate.command()
def rdt(
    host: Host = "127.0.0.1",
    port: Annotated[int, typer.Option(help="UDP port; 0 takes a free one.")] = 49152,
    rate: Annotated[float, typer.Option(help="Records per second.")] = 1000.0,
    device: Annotated[str, typer.Option(help="net or axia: their status words differ.")] = "net",
    page_port: Annotated[
        int | None, typer.Option(help="Serves netftapi2.xml over HTTP there; 0 takes a free one.")
    ] = None,
    scale: Annotated[
        Path | None, typer.Option(help="Writes netftapi2.xml to this file.", callback=XML)
    ] = None,
    poses: Annotated[
        Path | None,
        typer.Option(
            help="Writes readings at rest in six attitudes, for `dynamics sensor`.", callback=CSV
        ),
    ] = None,
    robot: Robot = None,
    seconds: Seconds = None,
    seed: Seed = 0,
    fault: Faults = None,
    json: Json = False,
) -> None:
    """An ATI force sensor: counts over UDP, once it is asked for them."""
    from robotrue.cli.simulate import run_rdt

    run_rdt(
        host,
        port,
        rate=rate,
        device=device,
        page_port=page_port,
        scale=scale,
        poses=poses,
        robot=robot,
        seconds=seconds,
        seed=seed,
        faults=fault or [],
        as_json=json,
    )


@simulate.command(name="drill")
def drilling_head(
    to: Annotated[str, typer.Option(help="Where `drill run` listens.")] = "udp://127.0.0.1:47600",
    write: Annotated[
        Path | None,
        typer.Option(help="Writes foot, campaign and test of this machine to a folder and ends."),
    ] = None,
    holes: Annotated[int, typer.Option(help="How many it clamps.")] = 20,
    pause_s: Annotated[float, typer.Option(help="Between two holes, s.")] = 0.5,
    damaged: Annotated[
        float, typer.Option(help="Share of datagrams that are lost, repeated or cut short.")
    ] = 0.0,
    shift_at: Annotated[
        int, typer.Option(help="Hole from which a sensor's zero is shifted; 0 for never.")
    ] = 0,
    shift_um: Annotated[float, typer.Option(help="By how much.")] = 50.0,
    gauge_deg: Annotated[
        float, typer.Option(help="Scatter of the gauge that measures each hole; 0 for no gauge.")
    ] = 0.005,
    nonlinear: Annotated[
        bool, typer.Option("--nonlinear", help="A foot that bends with force and tilt.")
    ] = False,
    friction: Annotated[
        bool, typer.Option("--friction", help="With friction in the foot's joint.")
    ] = False,
    seconds: Seconds = None,
    seed: Annotated[int, typer.Option(help="Of the machine, its surfaces and its noise.")] = 0,
    json: Json = False,
) -> None:
    """A drilling head: clamps, asks for its move, turns, and has the hole measured."""
    from robotrue.cli.simulate_drill import run_drill, write_campaign_files
    from robotrue.simulation.drilling_machine import drilling_machine

    machine = drilling_machine(seed, nonlinear=nonlinear, friction=friction)
    if write is not None:
        write_campaign_files(machine, write, seed=seed, as_json=json)
        return
    run_drill(
        machine,
        to,
        holes=holes,
        pause_s=pause_s,
        damaged=damaged,
        shift_at=shift_at,
        shift_um=shift_um,
        gauge_deg=gauge_deg,
        seconds=seconds,
        seed=seed,
        as_json=json,
    )
