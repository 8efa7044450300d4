"""Joints of a ball in sockets, a folder per place of the fixture and a file per socket.

    FOLDER/<place>/hole_0.csv, hole_1.csv, ...     one line per attitude, one joint per column, rad

No header, no measured position: the layout written by the recorder of the open
``kinematics_calibration`` (MUKCa, platonics-delft). Its ``hole_0_pose.csv`` files hold poses
computed by the controller, which are not measurements; they are ignored.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np

from robotrue.core.arrays import Array, BoolArray, IntArray
from robotrue.core.columns import Column, Columns
from robotrue.core.files import sha256
from robotrue.errors import ConfigurationError, FormatError, ImplausibleDataError, ShapeError
from robotrue.measurement.formats.sheet_file import read_sheet
from robotrue.measurement.probing_set import KnownDistance, ProbingSet

FILES: Final = "hole_[0-9].csv"
PRINTED: Final = 2e-4
"""m, sd of a length between two sockets of one printed fixture, the seat of the ball included."""
TURNS: Final = 6.3
"""rad; joints beyond it are in degrees."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SocketTouches(Columns):
    """A ball in the sockets of a fixture at several places.

    Attributes:
        touches: One part per socket, all of them places; names are ``<place>/hole_<k>``.
        sockets: Name of each socket, by its part number.
        places: Names of the places.
        place: (sockets,) index of the place each socket was at.
    """

    touches: ProbingSet
    sockets: Annotated[tuple[str, ...], Column("k")]
    places: tuple[str, ...]
    place: Annotated[IntArray, Column("k")]

    def rows_at(self, places: Collection[str]) -> BoolArray:
        """Returns (n,) True for the touches made at the named places.

        Raises:
            ConfigurationError: No such place.
        """
        unknown = sorted(set(places) - set(self.places))
        if unknown:
            raise ConfigurationError(
                f"no place {unknown[0]!r}; places of the fixture: {', '.join(self.places)}."
            )
        wanted = [self.places.index(name) for name in places]
        return np.isin(self.place[self.touches.part], wanted)


def read_sockets(
    folder: str | Path, *, spacing: float | None = None, spacing_sigma: float = PRINTED
) -> SocketTouches:
    """Returns the joints of all places and sockets in a folder.

    Args:
        folder: Holds one folder per place.
        spacing: m between the two sockets of the fixture, if known.
        spacing_sigma: m, its standard deviation.

    Raises:
        FormatError: No such files, cells that are no finite numbers, files of different joints.
        ImplausibleDataError: Joints in degrees.
        ShapeError: A spacing where a place has other than two sockets.
    """
    files = sorted(Path(folder).glob(f"*/{FILES}"))
    if not files:
        raise FormatError(
            "no socket files.", source=folder, hint="one folder per place, with hole_0.csv in each."
        )
    places = tuple(dict.fromkeys(path.parent.name for path in files))
    place = np.array([places.index(path.parent.name) for path in files])
    joints, lines, digests = zip(*(_read(path) for path in files), strict=True)
    dof = joints[0].shape[1]
    for path, q in zip(files, joints, strict=True):
        if q.shape[1] != dof:
            raise FormatError(
                f"{q.shape[1]} columns, {files[0].name} of {places[0]!r} has {dof}.", source=path
            )
    sockets = tuple(f"{path.parent.name}/{path.stem}" for path in files)
    counts = [len(q) for q in joints]
    touches = ProbingSet(
        names=tuple(np.repeat(sockets, counts)),
        point=np.zeros((sum(counts), 3)),
        joints=np.concatenate(joints),
        part=np.repeat(np.arange(len(files)), counts),
        sockets=tuple(range(len(files))),
        distances=() if spacing is None else _spacings(places, place, spacing, spacing_sigma),
        source=f"{Path(folder).name} sha256:{sha256(''.join(digests).encode())}",
        lines=np.concatenate(lines),
    )
    return SocketTouches(touches=touches, sockets=sockets, places=places, place=place)


def _read(path: Path) -> tuple[Array, IntArray, str]:
    """Joints (n, dof) rad, line numbers (n,) and the file's hash."""
    sheet = read_sheet(path, delimiter=",", decimal=".", header=False)
    joints = np.stack([sheet.parse(name) for name in sheet.header], axis=1)
    for row, column in np.argwhere(~np.isfinite(joints)).tolist():
        raise FormatError(
            f"joint {column + 1} is {sheet.cells[row][column]!r}, expected a finite number (rad).",
            source=path,
            line=sheet.lines[row],
        )
    largest = float(np.abs(joints).max())
    if largest > TURNS:
        row = int(np.argmax(np.abs(joints).max(axis=1)))
        raise ImplausibleDataError(
            f"a joint of {largest:.4g}, joints are in rad and within one turn.",
            source=path,
            line=sheet.lines[row],
            hint="convert from degrees.",
        )
    return joints, np.array(sheet.lines, dtype=np.int64), sheet.digest


def _spacings(
    places: tuple[str, ...], place: IntArray, spacing: float, sigma: float
) -> tuple[KnownDistance, ...]:
    out = []
    for k, name in enumerate(places):
        pair = np.flatnonzero(place == k).tolist()
        if len(pair) != 2:
            raise ShapeError(f"a spacing, and {len(pair)} sockets at {name!r}: expected two.")
        out.append(KnownDistance(first=pair[0], second=pair[1], length=spacing, sigma=sigma))
    return tuple(out)
