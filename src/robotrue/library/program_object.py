"""Robot programs and their compensation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias, Unpack

import numpy as np

from robotrue.app.operations.diff import COLUMNS, ProgramDifference
from robotrue.app.presentation import Block, PlainResult
from robotrue.app.reporting import Message
from robotrue.core.arrays import Array
from robotrue.core.files import write_atomic
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.library.measurement_object import CellSource, place_cell
from robotrue.library.model_object import Model, ModelSource, model_of
from robotrue.library.operation_call import call_operation, open_context, with_options_of
from robotrue.library.option_types import CompensateOptions
from robotrue.library.presented import Presented
from robotrue.program.formats import read_job
from robotrue.program.identity import SUFFIX, identity_path
from robotrue.program.program import Motion, Program, Reason
from robotrue.program.target_poses import target_poses

if TYPE_CHECKING:
    import pandas as pd

    from robotrue.library.pictures import Picture

IN_DIFF: Final = ("wrench", "force", "cutter", "start")
"""Options of a compensation that the prediction of its errors takes, too."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RobotProgram(Presented):
    """The programs of one job, as the controller reads them.

    Attributes:
        path: File or folder.
        job: Its programs.
        messages: Empty.
    """

    path: Path
    job: tuple[Program, ...]
    messages: tuple[Message, ...] = ()

    def __len__(self) -> int:
        return sum(map(len, self.job))

    @property
    def provenance(self) -> Provenance | None:
        """None: a program has no data source."""
        return None

    def blocks(self) -> Iterable[Block]:
        """Returns counts by motion and by reason, and the notes of the reader."""
        from robotrue.app.file_contents import document_blocks, program_document

        yield from document_blocks(self.path.name, program_document(self.job))

    def to_dataframe(self) -> pd.DataFrame:
        """Returns one row per target: mm in the robot base, deg of axis targets."""
        import pandas as pd

        return pd.concat([_target_table(program) for program in self.job], ignore_index=True)

    def plot(self) -> Picture:
        """Returns the targets from above and from the side, in the robot base."""
        from robotrue.library.pictures import draw_path, make_picture

        places = _known_places(self.job)
        drawing = draw_path(places, np.arange(len(places)), "base")
        return make_picture([drawing], title=f"{self.path.name}: {len(self)} targets")

    def _describe(self) -> str:
        return f"program {self.path.name}: {self.job[0].dialect}, {len(self)} targets"


ProgramSource: TypeAlias = str | Path | RobotProgram
"""A program, or the path of its file or of the folder of a job."""


def read_program(path: str | Path) -> RobotProgram:
    """Returns the programs of a job: a file with its companions, or a folder.

    Raises:
        FormatError: Not a known program dialect, with file and line.
    """
    return RobotProgram(path=Path(path), job=read_job(path))


def _target_table(program: Program) -> pd.DataFrame:
    import pandas as pd

    places = target_poses(program)[:, :3, 3] / MM
    axes = {f"a{k + 1}_deg": column / DEG for k, column in enumerate(program.axes.T)}
    return pd.DataFrame(
        {
            "file": program.name,
            "line": program.line,
            "motion": [Motion(int(each)).name.lower() for each in program.motion],
            "x_mm": places[:, 0],
            "y_mm": places[:, 1],
            "z_mm": places[:, 2],
            **axes,
            "left_alone": [
                "" if each == Reason.NONE else Reason(int(each)).name.lower()
                for each in program.reason
            ],
        }
    )


def _known_places(job: tuple[Program, ...]) -> Array:
    """Places (n, 3) m in base of the targets that have one.

    Raises:
        ConfigurationError: None has one.
    """
    places = np.vstack([target_poses(program)[:, :3, 3] for program in job])
    known = places[np.isfinite(places).all(axis=1)]
    if not len(known):
        raise ConfigurationError("no target of the program has a known place.")
    return np.asarray(known)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RewrittenProgram(Presented):
    """A compensated program, in memory; ``save(path)`` writes it.

    Attributes:
        before: File or folder of the program before.
        model: Model of the compensation.
        files: Bytes by file name: the programs and their identities.
        cell: Cell with the part frame of the program; None without one.
        options: Of the compensation.
        result: Of the operation ``compensate``.
        messages: Report on the targets.
    """

    before: Path
    model: Model
    files: Mapping[str, bytes]
    cell: CellSource | None
    options: Mapping[str, object]
    result: PlainResult
    messages: tuple[Message, ...]

    @property
    def text(self) -> str:
        """The program as text; of a job of several files the first by name."""
        return next(iter(self.files.values())).decode("latin-1")

    @property
    def provenance(self) -> Provenance | None:
        """Provenance of the model and the part frame."""
        return self.result.provenance

    def document(self) -> dict[str, object]:
        """Returns the JSON values of ``robotrue compensate --json``, without paths."""
        return {k: v for k, v in self.result.document().items() if k not in ("output", "identity")}

    def blocks(self) -> Iterable[Block]:
        """Returns nothing: the messages report the targets."""
        return ()

    def save(self, path: str | Path) -> None:
        """Writes the program with its identity next to it; a job of several files into a folder.

        Raises:
            ConfigurationError: It is the program before.
        """
        place = Path(path)
        programs = [name for name in self.files if not name.endswith(SUFFIX)]
        if place.exists() and place.samefile(self.before):
            raise ConfigurationError(
                "the output is the original program; it is not overwritten.",
                source=place,
                hint="another name.",
            )
        if len(programs) > 1:
            place.mkdir(exist_ok=True)
            for name, data in self.files.items():
                write_atomic(place / name, data)
            return
        for name, data in self.files.items():
            write_atomic(identity_path(place) if name.endswith(SUFFIX) else place, data)

    def to_dataframe(self) -> pd.DataFrame:
        """Returns one row per target: shift, predicted error before and after, bound at 95 %."""
        import pandas as pd

        table = pd.DataFrame(self._compare().rows(), columns=list(COLUMNS))
        for name in COLUMNS[4:]:
            table[name] = pd.to_numeric(table[name])
        return table.astype({"line": int, "line_after": int})

    def _compare(self) -> ProgramDifference:
        """The difference that ``robotrue diff`` shows."""
        with open_context() as context:
            after = context.new_file("after")
            after.mkdir()
            for name, data in self.files.items():
                (after / name).write_bytes(data)
            alone = len([name for name in self.files if not name.endswith(SUFFIX)]) == 1
            fields = {
                "before": self.before,
                "after": after / next(iter(self.files)) if alone else after,
                "model": self.model.place(context),
                "cell": None if self.cell is None else place_cell(context, self.cell),
                **{name: self.options[name] for name in IN_DIFF if name in self.options},
            }
            return call_operation(context, "diff", ProgramDifference, fields).result

    def plot(self) -> Picture:
        """Returns the predicted error of each target before, and its bound at 95 % after."""
        from matplotlib.axes import Axes

        from robotrue.library.pictures import make_picture
        from robotrue.report.figure import AFTER, BEFORE, Drawing

        table = self.to_dataframe()

        def draw(axes: list[Axes]) -> None:
            (ax,) = axes
            ax.plot(table["error_before_um"] / 1e3, color=BEFORE, label="before: predicted error")
            ax.plot(table["bound_95_um"] / 1e3, color=AFTER, label="after: 95 % bound")
            ax.set_ylim(bottom=0.0)
            ax.set_xlabel("target, in file order")
            ax.set_ylabel("error in mm")
            ax.legend()

        return make_picture(
            [Drawing(draw=draw)], title=f"{self._mark}{self.before.name}, compensated"
        )

    def _describe(self) -> str:
        counts = self.result.values
        return (
            f"compensated {self.before.name}: {counts['compensated']} of {counts['targets']} "
            "targets"
        )


@with_options_of("compensate", "model", "program", "output", "cell")
def compensate(
    model: ModelSource,
    program: ProgramSource,
    *,
    cell: CellSource | None = None,
    **options: Unpack[CompensateOptions],
) -> RewrittenProgram:
    """Returns a program with compensated targets.

    Args:
        model: The model, or the path of its file.
        program: The program, or the path of its file or of the folder of a job.
        cell: Cell with the part frame or the other frames of the program.
        options: See below.

    Raises:
        ModelMismatchError: A program or a part frame of another model.
        StepError: Steps in the path are too large and not allowed.
    """
    path = program.path if isinstance(program, RobotProgram) else Path(program)
    known = model_of(model)
    with open_context() as context:
        place = context.new_file("after")
        place.mkdir()
        fields = {
            "model": known.place(context),
            "program": path,
            "output": place,
            "cell": None if cell is None else place_cell(context, cell),
            **options,
        }
        call = call_operation(context, "compensate", PlainResult, fields)
        names = sorted(place.iterdir(), key=lambda each: (each.name.endswith(SUFFIX), each.name))
        files = {each.name: each.read_bytes() for each in names}
    return RewrittenProgram(
        before=path,
        model=known,
        files=files,
        cell=cell,
        options=dict(options),
        result=call.result,
        messages=call.messages,
    )
