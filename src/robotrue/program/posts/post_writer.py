"""Writes the moves of a job in the language of a post description.

Joint moves are exact stops. Points that cut are passed with the post's ``blended`` line while
cutting continues, with exact stops at its ends; rapid points are straight moves at the rapid speed,
since the CAM system drew them straight. Statements of the tool path that move nothing are comments
at their place; ``STOP``, ``DELAY/``, ``SPINDL/``, ``COOLNT/`` and ``LOADTL/`` are also the post's
own lines for them, where it has some.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray
from robotrue.core.poses import pose
from robotrue.core.units import MM
from robotrue.errors import ConfigurationError, FormatError
from robotrue.program.posts.line_template import Values
from robotrue.program.posts.machining_moves import (
    JobSpeeds,
    JointMoves,
    MachiningMoves,
    SideMoves,
)
from robotrue.program.posts.post_description import BLOCKS, Block, FileText, Post
from robotrue.program.posts.post_fields import (
    AXIS,
    axes_values,
    feed_values,
    part_poses,
    pose_values,
    word_values,
)
from robotrue.program.toolpath import Remark, Toolpath

_NUMBER: Final = r"(\d++\.?+\d*+|\.\d++)"
_WAIT: Final = re.compile(rf"DELAY\s*/\s*{_NUMBER}", re.IGNORECASE)
_SPINDLE: Final = re.compile(r"SPINDL\s*/(.*)", re.IGNORECASE)
_COOLANT: Final = re.compile(r"COOLNT\s*/\s*(\w+)", re.IGNORECASE)
_TOOL: Final = re.compile(r"(?:LOADTL|TOOLNO)\s*/\s*([\w.-]+)", re.IGNORECASE)
_LARGEST_LOSS: Final = 0.05
"""Share of a feed that its printed digits may be off."""
_SAME_FRAME: Final = 1e-12
_STRAIGHT: Final = (
    "between sides the tool moves on straight lines to the postures of the checked joint moves; "
    "the lines are not checked: drive them slowly."
)


def require_name(post: Post, name: str) -> None:
    """Passes for a name a program of this language may have.

    Raises:
        ConfigurationError: Another one.
    """
    longest = post.stated.name_length
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or len(name) > longest:
        raise ConfigurationError(
            f"program name {name!r}: {post.stated.title} allows up to {longest} letters, digits "
            "and underscores, a letter first.",
            hint=f"another file name, e.g. job{post.stated.suffixes[0]}.",
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class WrittenProgram:
    """A program as files.

    Attributes:
        files: Bytes by name, the file of ``--output`` first.
        at_controller: What is to be set at the controller, one sentence each.
    """

    files: Mapping[str, bytes]
    at_controller: tuple[str, ...]


def write_machining(post: Post, job: MachiningMoves, output: str = "") -> WrittenProgram:
    """Returns the files of a program.

    Args:
        post: How it is written.
        job: Its content.
        output: Name of the first file; that of the program with the post's suffix if empty.

    Raises:
        ConfigurationError: A name the language does not allow, or several work frames where its
            programs have one.
        FormatError: A point that cuts without a feed, or what the post has no line for; with the
            line of the tool path.
    """
    require_name(post, job.name)
    return _JobWriter(post, job, output or f"{job.name}{post.stated.suffixes[0]}").write()


@dataclass(slots=True)
class _Counts:
    """Targets so far: all, straight moves, joint moves."""

    n: int
    nl: int
    nj: int


@dataclass(slots=True)
class _Stream:
    """Lines of one block as they grow."""

    block: Block
    lines: list[str] = field(default_factory=list)
    last: dict[str, str] = field(default_factory=dict)

    def put(self, event: str, values: Values) -> None:
        """Adds the lines of an event, if the block has any."""
        template = self.block.events.get(event)
        if template is not None:
            self.lines += template.render(values)

    def renew(self, event: str, text: str) -> None:
        """Adds the line of what stays in force, where it differs from that in force."""
        if self.last.get(event) != text:
            self.last[event] = text
            self.lines.append(text)


class _JobWriter:
    """One program while it is written."""

    def __init__(self, post: Post, job: MachiningMoves, output: str) -> None:
        self._post, self._job = post, job
        self._spelled = {name: tuple(two) for name, two in post.stated.words.items()}
        straight = sum(len(side.path) for side in job.sides)
        joint = sum(len(side.before) for side in job.sides) + len(job.after)
        self._common: dict[str, Array | str | float] = {
            "program": job.name, "PROGRAM": job.name.upper(), "output": output,
            "blend": job.speeds.blend / MM, "blend_m": job.speeds.blend,
            "joint_percent": job.speeds.joint,
            "targets": straight + joint, "straight": straight, "joint": joint,
            **pose_values(job.T_flange_tool[None], post.names, "tool_"),
        }  # fmt: skip
        self._frames = _distinct_frames(job)
        if post.stated.one_frame and len(self._frames) > 1:
            raise ConfigurationError(
                f"{len(self._frames)} part frames; {post.stated.title} by the post "
                f"{post.stated.name!r} has one work frame for a program.",
                hint="one program for each part frame.",
            )

    def write(self) -> WrittenProgram:
        """Returns the files."""
        lines = {name: self._block_lines(self._post.blocks[name]) for name in BLOCKS}
        end = "\r\n" if self._post.stated.line_end == "crlf" else "\n"
        values = {**self._common, "lines": float(len(lines["moves"]))}
        files = {}
        for file in self._post.files:
            name = str(values["output"]) if file.name is None else file.name.render(values)[0]
            files[name] = end.join([*_file_lines(file, lines, values), ""]).encode("ascii")
        told = [
            template.render({**values, **self._frame_values(T)})[0]
            for template in self._post.at_controller
            for T in self._frames
        ]
        if self._post.stated.straight_between_sides:
            told.append(_STRAIGHT)
        return WrittenProgram(files=files, at_controller=tuple(dict.fromkeys(told)))

    def _block_lines(self, block: Block) -> list[str]:
        """The lines of one block; all blocks count the same targets."""
        stream, first = _Stream(block=block), self._post.stated.first_number
        counts = _Counts(first, first, first)
        stream.put("head", self._common)
        for remark in self._job.remarks:
            self._comment(stream, remark)
        stream.put("start", self._common)
        for T in self._frames:
            stream.put("new_frame", {**self._common, **self._frame_values(T)})
        for side in self._job.sides:
            self._side(stream, side, counts)
        if len(self._job.sides):
            self._joint_moves(stream, self._job.after, self._job.sides[-1].T_base_part, counts)
        stream.put("foot", self._common)
        lines = "\n".join(stream.lines).split("\n") if stream.lines else []
        if block.line_number is None:
            return lines
        numbers = np.arange(block.first_line, block.first_line + len(lines), dtype=np.float64)
        before = block.line_number.render({"line": numbers}, len(lines))
        return [number + line for number, line in zip(before, lines, strict=True)]

    def _frame_values(self, T_base_part: Array) -> dict[str, Array | str | float]:
        number = next(
            k for k, T in enumerate(self._frames, 1) if np.abs(T - T_base_part).max() < _SAME_FRAME
        )
        return {"frame_n": number, **pose_values(T_base_part[None], self._post.names, "frame_")}

    def _comment(self, stream: _Stream, text: str) -> None:
        plain = text.encode("ascii", "replace").decode("ascii")
        for word in self._post.stated.not_in_comments:
            plain = plain.replace(word, "?")
        longest = self._post.stated.comment_length
        stream.put("comment", {**self._common, "text": plain[:longest]})

    def _joint_moves(
        self, stream: _Stream, moves: JointMoves, T_base_part: Array, counts: _Counts
    ) -> None:
        template = stream.block.events.get("joint")
        rows = len(moves)
        shift = np.arange(rows, dtype=np.float64)
        T_part_tool = part_poses(T_base_part, moves.T_base_tool)
        values = {
            **self._common,
            **self._frame_values(T_base_part),
            **axes_values(moves.axes),
            **pose_values(T_part_tool, self._post.names),
            **word_values(moves.words, self._job.words_of, self._spelled),
            "n": counts.n + shift,
            "nj": counts.nj + shift,
            "nl": np.full(rows, float(counts.nl)),
        }
        texts = [] if template is None else template.render(values, rows)
        words = self._render_words(stream, values, rows)
        for k, text in enumerate(texts):
            if words:
                stream.renew("configuration", words[k])
            stream.lines.append(text)
        counts.n += rows
        counts.nj += rows

    def _render_words(self, stream: _Stream, values: Values, rows: int) -> list[str]:
        template = stream.block.events.get("configuration")
        return [] if template is None else template.render(values, rows)

    def _side(self, stream: _Stream, side: SideMoves, counts: _Counts) -> None:
        path = side.path
        framed = {**self._common, **self._frame_values(side.T_base_part)}
        stream.last.clear()
        self._comment(stream, f"side {path.name} ({_file(path.source)}), {len(path)} points")
        stream.put("side", framed)
        self._joint_moves(stream, side.before, side.T_base_part, counts)
        stream.put("frame", framed)
        events, halts = self._remarks(stream, path)
        texts, feeds, words = self._path_texts(stream, side, counts, halts)
        operation = -1
        for k in range(len(path)):
            for text in events.get(k, ()):
                stream.lines.append(text)
            if path.operation[k] != operation:
                operation = int(path.operation[k])
                self._comment(stream, f"operation {path.operations[operation]}")
            for event, column in (("configuration", words), ("feed", feeds)):
                if column:
                    stream.renew(event, column[k])
            if texts:
                stream.lines.append(texts[k])
        stream.lines += events.get(len(path), ())
        counts.n += len(path)
        counts.nl += len(path)

    def _path_texts(
        self, stream: _Stream, side: SideMoves, counts: _Counts, halts: list[int]
    ) -> tuple[list[str], list[str], list[str]]:
        """The lines of the points, of their feeds and of their configuration; empty where none."""
        path, rows, events = side.path, len(side.path), stream.block.events
        shift = np.arange(rows, dtype=np.float64)
        feed = resolve_feeds(path, self._job.speeds)
        values = {
            **self._common,
            **self._frame_values(side.T_base_part),
            **pose_values(pose(side.rotation, path.position), self._post.names),
            **dict(zip(AXIS, path.axis.T, strict=True)),
            **word_values(side.words, self._job.words_of, self._spelled),
            **feed_values(feed),
            "n": counts.n + shift,
            "nl": counts.nl + shift,
            "nj": np.full(rows, float(counts.nj)),
        }
        exact, passed = (events.get(name) for name in ("linear", "blended"))
        texts = [] if exact is None else exact.render(values, rows)
        if passed is not None:
            blended = passed.render(values, rows)
            blends = choose_blends(path, self._job.speeds, halts)
            texts = [blended[k] if on else texts[k] for k, on in enumerate(blends.tolist())]
        told = events.get("feed")
        feeds = [] if told is None else told.render(values, rows)
        self._check_feeds(stream.block, path, feed)
        return texts, feeds, self._render_words(stream, values, rows)

    def _check_feeds(self, block: Block, path: Toolpath, feed: Array) -> None:
        """Refuses feeds that the digits of the post cannot represent."""
        values = feed_values(feed)
        for template in block.events.values():
            for each in template.fields:
                if each.name not in values:
                    continue
                lost = np.flatnonzero(each.loss(values[each.name]) > _LARGEST_LOSS)
                if len(lost):
                    raise FormatError(
                        f"the feed of this point is {feed[lost[0]] / MM:g} mm/s, which post "
                        f"{self._post.stated.name!r} prints with {each.decimals} decimals.",
                        source=path.source,
                        line=int(path.line[lost[0]]),
                        hint="another feed, or a post with more decimals.",
                    )

    def _remarks(self, stream: _Stream, path: Toolpath) -> tuple[dict[int, list[str]], list[int]]:
        """Lines to insert before each point, and the points before which the arm stops."""
        out: dict[int, list[str]] = {}
        halts: list[int] = []
        for remark in path.remarks:
            side = _Stream(block=stream.block)
            self._comment(side, f"{remark.line}: {remark.text}")
            event, values = _event_of(remark)
            if event in ("stop", "wait"):
                halts.append(remark.before)
                self._require_event(event, path, remark)
            if event:
                side.put(event, {**self._common, **values})
            out.setdefault(remark.before, []).extend(side.lines)
        return out, halts

    def _require_event(self, event: str, path: Toolpath, remark: Remark) -> None:
        if event not in self._post.blocks["moves"].events:
            raise FormatError(
                f"{remark.text}: post {self._post.stated.name!r} has no line for it.",
                source=path.source,
                line=remark.line,
                hint=f"a post with moves.{event}, or a tool path without it.",
            )


def _distinct_frames(job: MachiningMoves) -> list[Array]:
    frames: list[Array] = []
    for side in job.sides:
        if not any(np.abs(T - side.T_base_part).max() < _SAME_FRAME for T in frames):
            frames.append(side.T_base_part)
    return frames


def _file_lines(file: FileText, lines: Mapping[str, list[str]], values: Values) -> list[str]:
    out: list[str] = []
    for line in file.lines:
        out += lines[line] if isinstance(line, str) else line.render(values)
    return out


def resolve_feeds(path: Toolpath, speeds: JobSpeeds) -> Array:
    """Returns the speed (n,) m/s of every point.

    Raises:
        FormatError: A point that cuts before any feed is stated.
    """
    feed = np.where(path.rapid, speeds.rapid, np.where(np.isnan(path.feed), speeds.feed, path.feed))
    bad = np.flatnonzero(~np.isfinite(feed))
    if len(bad):
        raise FormatError(
            "this point cuts and no feed is stated before it.",
            source=path.source,
            line=int(path.line[bad[0]]),
            hint="FEDRAT/ in the CL data, or --feed-mm-per-min.",
        )
    return np.asarray(feed)


def choose_blends(path: Toolpath, speeds: JobSpeeds, halts: list[int]) -> BoolArray:
    """Returns which points (n,) are passed: between two that cut, and none where the arm halts."""
    cutting = path.cutting
    blends = np.append(cutting[:-1] & cutting[1:], False) & (speeds.blend > 0.0)
    blends[[k - 1 for k in halts if k]] = False
    return np.asarray(blends)


def _event_of(remark: Remark) -> tuple[str, dict[str, float | str]]:
    """Returns the event of a tool-path statement besides its comment; empty for none."""
    text = remark.text
    wait, tool, coolant = (each.fullmatch(text) for each in (_WAIT, _TOOL, _COOLANT))
    spindle = _SPINDLE.fullmatch(text)
    if text.upper() == "STOP":
        return "stop", {}
    if wait:
        return "wait", {"seconds": float(wait[1])}
    if tool:
        return "tool_call", {"tool": tool[1]}
    if coolant:
        return ("coolant_off" if coolant[1].upper() == "OFF" else "coolant_on"), {}
    return _spindle_event(spindle[1].upper()) if spindle else ("", {})


def _spindle_event(words: str) -> tuple[str, dict[str, float | str]]:
    if "OFF" in words:
        return "spindle_off", {}
    rpm = re.search(_NUMBER, words)
    left = re.search(r"\bCCLW\b|\bCCW\b", words)
    return (
        ("spindle_left" if left else "spindle_right", {"rpm": float(rpm[1])}) if rpm else ("", {})
    )


def _file(source: str) -> str:
    return re.split(r"[/\\]", source)[-1]
