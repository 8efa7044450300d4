"""``robotrue drill run``: at the machine, clamp by clamp: values in, one move or a refusal out."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import signal
import sys
import time
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from robotrue.app.outputs import check_output
from robotrue.cli.console import count, say, say_mark
from robotrue.cli.drill import setup_of
from robotrue.cli.drill_robot import DrillingRobot, drilling_robot, followed, with_robot
from robotrue.core.provenance import Provenance, marked
from robotrue.core.units import DEG
from robotrue.drilling.clamp_watch import ClampSettings
from robotrue.drilling.foot_file import FootSetup
from robotrue.drilling.foot_signals import SIMULATED, foot_sample, is_reference, read_reference_tilt
from robotrue.drilling.hole_session import HoleAnswer, HoleSession
from robotrue.drilling.journal import Journal, answer_document, step_document
from robotrue.drilling.journal_replay import replay_references
from robotrue.drilling.model_archive import read_model, write_model
from robotrue.errors import ConfigurationError, ModelMismatchError, RobotrueError
from robotrue.online.net_address import net_address
from robotrue.online.signals import SignalSample, write_signals
from robotrue.online.signals_udp import UdpSignals

PORT: Final = 47600
_AGAIN: Final = 200
"""Answers kept for a machine that asks again."""


def run(
    model_path: Path,
    *,
    address: str,
    journal: Path,
    output: Path | None,
    foot: Path | None,
    approach: str,
    truth: str,
    sigma_deg: float,
    settings: ClampSettings,
    seconds: float | None,
    robot: Path | None,
    joints: str | None,
    foot_abc_deg: str,
    as_json: bool,
) -> None:
    """Answers clamps until stopped, or for a time."""
    if output is not None and output != model_path:
        check_output(output, [p for p in (model_path, foot) if p is not None])
    model = read_model(model_path)
    setup = setup_of(model, model_path, foot)
    with Journal(journal) as kept:
        model, replayed = replay_references(
            model, kept.state.references, reference_sigma=sigma_deg * DEG, source=journal
        )
        if kept.state.version > model.version:
            raise ModelMismatchError(
                f"{journal} was written with version {kept.state.version} of the model, this is "
                f"version {model.version}.",
                source=model_path,
                hint="the model that run wrote with -o, or another journal.",
            )
        if replayed and output is not None:
            write_model(output, model)
        session = HoleSession(
            model,
            settings=settings,
            reference=sigma_deg * DEG,
            approach=approach,
            waiting=kept.state.waiting,
            count=kept.state.answered,
        )
        arm = None
        if robot is not None:
            order, still = model.head.order, settings.quiet
            arm = drilling_robot(robot, joints, order, foot_abc_deg, still=still)
        desk = Desk(session, setup, kept, truth=truth, output=output, robot=arm, as_json=as_json)
        note = "" if not replayed else _replay_note(journal, replayed, model.version)
        asyncio.run(_serve(desk, address, seconds, note=note))
    if not as_json:
        say(desk.summary())


class Desk:
    """Takes values, gives answers; what it says is on the journal's disk first.

    Args:
        session: Model and watch.
        setup: Of the foot.
        journal: Open.
        truth: What measures references that do not say so themselves.
        output: Where a refined model is kept.
        robot: Carries the foot; None for a head.
        as_json: A line of JSON for every answer on standard output.
    """

    def __init__(
        self,
        session: HoleSession,
        setup: FootSetup,
        journal: Journal,
        *,
        truth: str,
        output: Path | None,
        robot: DrillingRobot | None,
        as_json: bool,
    ) -> None:
        self.robot = robot
        self._session, self._setup, self._journal = session, setup, journal
        self._truth, self._output, self._as_json = truth, output, as_json
        self._answers: OrderedDict[str, dict[str, Any]] = OrderedDict()
        self.moves = self.refusals = self.references = self.alarms = self.unread = 0

    def take(self, sample: SignalSample) -> dict[str, Any] | None:
        """Returns what the other side is told about a sample; None if nothing.

        Raises:
            FormatError: The journal cannot be written: nothing is answered, nothing moves.
        """
        if "again" in sample.texts:
            hole = sample.texts["again"]
            return self._answers.get(hole) or {"hole": hole, "status": "unknown"}
        if not sample.valid:
            self._session.broken()
            return None
        if sample.values.get(SIMULATED, 0.0) and not self._session.provenance.simulated:
            self._session.simulated()
            say_mark(self._session.provenance)
        if is_reference(sample.values):
            return self._reference(sample)
        return self._foot(sample)

    @property
    def provenance(self) -> Provenance:
        """Of the model and of the machine that speaks to it."""
        return self._session.provenance

    def summary(self) -> str:
        """What it came to."""
        text = (
            f"{count(self.moves, 'move')}, {count(self.refusals, 'refusal')}, "
            f"{count(self.references, 'reference')}, {count(self.alarms, 'alarm')}; model version "
            f"{self._session.model.version}"
        )
        return marked(text, self._session.provenance)

    def _foot(self, sample: SignalSample) -> dict[str, Any] | None:
        try:
            head = self.robot is None
            foot = foot_sample(sample.values, self._setup, sample.host_time, head=head)
            answer = self._session.push(foot, hole=sample.texts.get("hole", ""))
        except RobotrueError as cause:
            return self._unread(cause)
        if answer is None:
            return None
        document = answer_document(answer)
        if self.robot is not None and answer.adjustment is not None:
            answer, document = self._by_robot(answer, self.robot)
        self._journal.answered(answer, document)
        self.moves += answer.adjustment is not None
        self.refusals += answer.adjustment is None
        return self._told(document)

    def _by_robot(
        self, answer: HoleAnswer, robot: DrillingRobot
    ) -> tuple[HoleAnswer, dict[str, Any]]:
        """The answer as the robot's move, or the refusal it comes to."""
        document, found = answer_document(answer), answer.adjustment
        if found is None:
            return answer, document
        try:
            return answer, with_robot(document, found, robot)
        except RobotrueError as cause:
            self._session.forget(answer.hole)
            refused = replace(answer, adjustment=None, refused=_said(cause))
            return refused, answer_document(refused)

    def _reference(self, sample: SignalSample) -> dict[str, Any]:
        hole = sample.texts.get("hole", "")
        truth = sample.texts.get("truth", self._truth)
        try:
            left = read_reference_tilt(sample.values)
            step = self._session.remained(hole, left, truth)
        except RobotrueError as cause:
            return self._unread(cause, hole=hole)
        a, b = (left / DEG).tolist()
        document = step_document(hole, step, (a, b), truth)
        self._journal.recorded(
            document,
            sigma=self._session.reference_sigma,
            records=step.model.monitor.records,
        )
        if self._output is not None:
            write_model(self._output, step.model)
        self.references += 1
        self.alarms += step.alarm
        return self._told(document)

    def _told(self, document: dict[str, Any]) -> dict[str, Any]:
        self._answers[document["hole"]] = document
        if len(self._answers) > _AGAIN:
            self._answers.popitem(last=False)
        self._print(document)
        return document

    def _unread(self, cause: RobotrueError, **beside: str) -> dict[str, Any]:
        """A machine that sends what cannot be read is told so, once in a while on the console."""
        document = {"status": "unread", "said": _said(cause), **beside}
        self.unread += 1
        if self.unread.bit_count() == 1:
            self._print(document)
        return document

    def _print(self, document: Mapping[str, Any]) -> None:
        if self._as_json:
            sys.stdout.write(json.dumps(document, allow_nan=False) + "\n")
            sys.stdout.flush()
            return
        say(_line(document))


def _said(cause: RobotrueError) -> str:
    return cause.message + (f" ({cause.hint})" if cause.hint else "")


def _line(document: Mapping[str, Any]) -> str:
    status, hole = document["status"], document.get("hole", "")
    if status == "move" and "turn_deg" in document:
        axes = [v for name, v in document.items() if re.fullmatch(r"a\d_deg", name)]
        joints = ", ".join(f"{v:.4f}" for v in axes)
        return f"hole {hole}: joints to {joints} deg, turned by {document['turn_deg']:.4f} deg"
    if status == "move":
        return (
            f"hole {hole}: A to {document['A_deg']:.4f}, B to {document['B_deg']:.4f} deg (by "
            f"{document['dA_deg']:+.4f}, {document['dB_deg']:+.4f}; +- "
            f"{document['a_sigma_deg']:.4f}, {document['b_sigma_deg']:.4f})"
        )
    if status == "recorded":
        return (
            f"hole {hole}: left {document['left_a_deg']:+.4f}, {document['left_b_deg']:+.4f} deg "
            f"as {document['truth']} measured; model version {document['version']}"
        )
    if status == "alarm":
        return f"ALARM: {document['said']}"
    return f"hole {hole or '?'}: no move. {document['said']}"


def _replay_note(journal: Path, replayed: int, version: int) -> str:
    return (
        f"note: {count(replayed, 'reference')} of {journal.name} taken into the model, which was "
        f"written before them; it is version {version} now"
    )


async def _serve(desk: Desk, address: str, seconds: float | None, *, note: str) -> None:
    where = net_address(address, default_port=PORT).only("from")
    if where.scheme != "udp":
        raise ConfigurationError(
            f"--from {where.scheme}://, expected udp://.", hint=f"--from udp://0.0.0.0:{PORT}"
        )
    source = UdpSignals(where.host, where.port, only=where.options.get("from", ""))
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for name in (signal.SIGINT, signal.SIGTERM):
        with contextlib.suppress(NotImplementedError):
            loop.add_signal_handler(name, stop.set)
    say(f"listening on udp://{source.address[0]}:{source.address[1]}; Ctrl-C ends")
    say_mark(desk.provenance)
    if note:
        say(note)
    ended = asyncio.create_task(stop.wait())
    async with followed(desk.robot) as joints:
        work = asyncio.create_task(_answer(desk, source))
        waits = {work, ended} if joints is None else {work, ended, joints}
        try:
            done, _ = await asyncio.wait(
                waits, timeout=seconds, return_when=asyncio.FIRST_COMPLETED
            )
        finally:
            health = source.health(time.monotonic())
            await source.close()
            ended.cancel()
        await work
        if joints in done:
            await joints
    if health.refused:
        say(f"{count(health.refused, 'datagram')} not read; the last: {health.last_fault}")


async def _answer(desk: Desk, source: UdpSignals) -> None:
    async for sample in source.samples():
        document = desk.take(sample)
        if document is not None:
            source.answer(write_signals(_flat(document)))


def _flat(document: Mapping[str, Any]) -> dict[str, Any]:
    """An answer for a control: numbers and texts only."""
    out: dict[str, Any] = {}
    for name, value in document.items():
        if name == "notes":
            out["said"] = " ".join(value)[:1000]
        elif name == "shift_deg":
            out |= {"shift_a_deg": value[0], "shift_b_deg": value[1]}
        else:
            out[name] = int(value) if isinstance(value, bool) else value
    return out
