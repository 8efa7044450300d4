"""Clamp by clamp at a machine: values in, one move or a refusal out, until stopped."""

from __future__ import annotations

import asyncio
import re
import time
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

from robotrue.app.drilling_robot import DrillingRobot, follow_joints, with_robot
from robotrue.app.presentation import count
from robotrue.app.reporting import Message, Reporter
from robotrue.core.provenance import Provenance, mark_sentence, mark_title
from robotrue.core.units import DEG
from robotrue.drilling.clamp_watch import SIMULATED, foot_sample, is_reference, read_reference_tilt
from robotrue.drilling.drill_defaults import PORT
from robotrue.drilling.foot_file import FootSetup
from robotrue.drilling.hole_session import HoleAnswer, HoleSession
from robotrue.drilling.journal import Journal, answer_document, step_document
from robotrue.drilling.model_archive import write_model
from robotrue.errors import ConfigurationError, RobotrueError
from robotrue.online.net_address import net_address
from robotrue.online.service_run import stop_on_signals
from robotrue.online.signals import SignalSample, UdpSignals, write_signals

_AGAIN: Final = 200
"""Answers stored for repeated requests of a machine."""


class Desk:
    """Receives values and returns answers, each written to the journal first.

    Args:
        session: Model and watch.
        setup: Of the foot.
        journal: Open.
        truth: Instrument of references that do not state one.
        output: File of the refined model.
        robot: Carries the foot; None for a head.
        reporter: Called with every answer, as a line and as JSON values.
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
        reporter: Reporter,
    ) -> None:
        self.robot, self.reporter = robot, reporter
        self._session, self._setup, self._journal = session, setup, journal
        self._truth, self._output = truth, output
        self._answers: OrderedDict[str, dict[str, object]] = OrderedDict()
        self.moves = self.refusals = self.references = self.alarms = self.unread = 0

    def take(self, sample: SignalSample) -> dict[str, object] | None:
        """Returns the reply to a sample; None if there is none.

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
            self._session.mark_simulated()
            self.reporter.report(Message(mark_sentence(self._session.provenance)))
        if is_reference(sample.values):
            return self._reference(sample)
        return self._foot(sample)

    @property
    def provenance(self) -> Provenance:
        """Provenance of the model merged with that of the machine."""
        return self._session.provenance

    def summary(self) -> str:
        """Summary of the session."""
        text = (
            f"{count(self.moves, 'move')}, {count(self.refusals, 'refusal')}, "
            f"{count(self.references, 'reference')}, {count(self.alarms, 'alarm')}; model version "
            f"{self._session.model.version}"
        )
        return mark_title(text, self._session.provenance)

    def _foot(self, sample: SignalSample) -> dict[str, object] | None:
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
        self._journal.write_answer(answer, document)
        self.moves += answer.adjustment is not None
        self.refusals += answer.adjustment is None
        return self._give_answer(document)

    def _by_robot(
        self, answer: HoleAnswer, robot: DrillingRobot
    ) -> tuple[HoleAnswer, dict[str, object]]:
        """The answer as the robot's move, or the refusal it comes to."""
        document, found = answer_document(answer), answer.adjustment
        if found is None:
            return answer, document
        try:
            return answer, with_robot(document, found, robot)
        except RobotrueError as cause:
            self._session.forget(answer.hole)
            refused = replace(answer, adjustment=None, refused=_word_fault(cause))
            return refused, answer_document(refused)

    def _reference(self, sample: SignalSample) -> dict[str, object]:
        hole = sample.texts.get("hole", "")
        truth = sample.texts.get("truth", self._truth)
        try:
            left = read_reference_tilt(sample.values)
            step = self._session.take_reference(hole, left, truth)
        except RobotrueError as cause:
            return self._unread(cause, hole=hole)
        a, b = (left / DEG).tolist()
        document = step_document(hole, step, (a, b), truth)
        self._journal.write_reference(
            document,
            sigma=self._session.reference_sigma,
            records=step.model.monitor.records,
        )
        if self._output is not None:
            write_model(self._output, step.model)
        self.references += 1
        self.alarms += step.alarm
        return self._give_answer(document)

    def _give_answer(self, document: dict[str, object]) -> dict[str, object]:
        self._answers[str(document["hole"])] = document
        if len(self._answers) > _AGAIN:
            self._answers.popitem(last=False)
        self._print(document)
        return document

    def _unread(self, cause: RobotrueError, **beside: str) -> dict[str, object]:
        """Returns the reply to an unreadable datagram; the console shows it from time to time."""
        document: dict[str, object] = {"status": "unread", "said": _word_fault(cause), **beside}
        self.unread += 1
        if self.unread.bit_count() == 1:
            self._print(document)
        return document

    def _print(self, document: Mapping[str, object]) -> None:
        self.reporter.report(Message(_line(document), document=document))


def _word_fault(cause: RobotrueError) -> str:
    return cause.message + (f" ({cause.hint})" if cause.hint else "")


def _line(document: Mapping[str, object]) -> str:
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
            f"measured by {document['truth']}; model version {document['version']}"
        )
    if status == "alarm":
        return f"ALARM: {document['said']}"
    return f"hole {hole or '?'}: no move. {document['said']}"


async def serve_desk(desk: Desk, address: str, seconds: float | None, *, begin: str) -> None:
    """Answers requests until stopped, or for a time.

    Args:
        desk: Takes values and gives answers.
        address: ``udp://HOST:PORT``, where the machine's values come in.
        seconds: s, then it ends; None for until Ctrl-C.
        begin: A line reported once it listens; empty for none.

    Raises:
        ConfigurationError: Another kind of address.
    """
    where = net_address(address, default_port=PORT)
    where.read_options({"from": "HOST, the only accepted sender"})
    if where.scheme != "udp":
        raise ConfigurationError(
            f"--from {where.scheme}://, expected udp://.", hint=f"--from udp://0.0.0.0:{PORT}"
        )
    source = UdpSignals(where.host, where.port, only=where.options.get("from", ""))
    stop = stop_on_signals()
    listening = f"listening on udp://{source.address[0]}:{source.address[1]}; Ctrl-C ends"
    for line in filter(None, (listening, mark_sentence(desk.provenance), begin)):
        desk.reporter.report(Message(line))
    ended = asyncio.create_task(stop.wait())
    async with follow_joints(desk.robot) as joints:
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
        unread = f"{count(health.refused, 'datagram')} not read; the last: {health.last_fault}"
        desk.reporter.report(Message(unread))


async def _answer(desk: Desk, source: UdpSignals) -> None:
    async for sample in source.samples():
        document = desk.take(sample)
        if document is not None:
            source.answer(write_signals(_flat(document)))


def _flat(document: Mapping[str, object]) -> dict[str, object]:
    """An answer for a control: numbers and texts only."""
    out: dict[str, object] = {}
    for name, value in document.items():
        if name == "notes" and isinstance(value, list):
            out["said"] = " ".join(value)[:1000]
        elif name == "shift_deg" and isinstance(value, list):
            out |= {"shift_a_deg": value[0], "shift_b_deg": value[1]}
        else:
            out[name] = int(value) if isinstance(value, bool) else value
    return out
