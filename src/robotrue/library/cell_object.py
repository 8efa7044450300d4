"""Robot cells: from a file, or from the name of a robot."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from robotrue.app.presentation import Block
from robotrue.app.reporting import Message
from robotrue.cell.cell import Cell
from robotrue.cell.cell_text import portable_text
from robotrue.cell.config import parse_cell
from robotrue.cell.config import read_cell as parse_cell_file
from robotrue.cell.toml_edit import plain_names, write_toml
from robotrue.core.files import read_bytes, write_atomic
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, MM
from robotrue.errors import ConfigurationError
from robotrue.library.presented import Presented
from robotrue.robot.forward import walk
from robotrue.robot.presets import preset_names

if TYPE_CHECKING:
    import pandas as pd

    from robotrue.library.pictures import Picture

SCHEMA: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RobotCell(Presented):
    """A robot, its tool, its load, and its measuring instrument.

    Attributes:
        cell: The values, SI.
        messages: Empty.
    """

    cell: Cell
    messages: tuple[Message, ...] = ()

    @property
    def robot(self) -> str:
        """Name of the robot."""
        return self.cell.robot.name

    @property
    def text(self) -> str:
        """The cell as the text of a cell.toml."""
        return portable_text(self.cell)[0]

    @property
    def provenance(self) -> Provenance | None:
        """Provenance of the part frames; None without part frames."""
        return None if self.cell.part is None else self.cell.part.provenance

    def blocks(self) -> Iterable[Block]:
        """Returns the content of the cell."""
        from robotrue.app.file_contents import cell_blocks

        yield from cell_blocks(Path(self.cell.source).name or "cell", self.cell)

    def to_dataframe(self) -> pd.DataFrame:
        """Returns the geometry of the arm, one row per joint: deg, mm."""
        import pandas as pd

        robot = self.cell.robot
        return pd.DataFrame(
            {
                "joint": np.arange(robot.dof) + 1,
                "theta_deg": robot.theta / DEG,
                "alpha_deg": robot.alpha / DEG,
                "d_mm": robot.d / MM,
                "a_mm": robot.a / MM,
                "beta_deg": robot.beta / DEG,
                "limit_low_deg": robot.limits[:, 0] / DEG,
                "limit_high_deg": robot.limits[:, 1] / DEG,
            }
        )

    def plot(self) -> Picture:
        """Returns the arm with all joints at zero, from above and from the side."""
        from robotrue.library.pictures import draw_path, make_picture

        robot = self.cell.robot
        walked = walk(robot, np.zeros((1, robot.dof)))
        places = np.vstack([np.zeros(3), walked.link_position[0], walked.position])
        drawing = draw_path(places, np.arange(len(places)), "base")
        return make_picture([drawing], title=f"{robot.name}, all joints at zero")

    def save(self, path: str | Path) -> None:
        """Writes the cell as a cell.toml, with the files that it names next to it.

        A registered cell keeps its part frames and their model.

        Raises:
            ConfigurationError: A registered cell whose file is missing or has changed.
        """
        if self.cell.part is None:
            text, files = portable_text(self.cell)
        else:
            folder = self.require_file().parent
            text, stated = plain_names(self.cell.text)
            files = {name: read_bytes(folder / own) for name, own in stated.items()}
        write_atomic(Path(path), text.encode())
        for name, data in files.items():
            write_atomic(Path(path).parent / name, data)

    def require_file(self) -> Path:
        """Returns the file that it was read from, for a registered cell, which names its model.

        Raises:
            ConfigurationError: It was not read from a file, or the file has changed.
        """
        path = Path(self.cell.source)
        if not (self.cell.source and path.is_file() and path.read_text("utf-8") == self.cell.text):
            raise ConfigurationError(
                "a registered cell is used with its file, which names its model; the file is not "
                "there or has changed.",
                source=self.cell.source or None,
                hint="rt.read_cell with the path of the registered cell.",
            )
        return path

    def _describe(self) -> str:
        frame = "base" if self.cell.frame == "base" else "unknown"
        return f"cell: {self.robot}, {self.cell.robot.dof} joints, tracker frame {frame}"


def read_cell(path: str | Path) -> RobotCell:
    """Returns the cell of a cell.toml.

    Raises:
        ConfigurationError: Not a cell, with file, line and key.
        FormatError: The file, or one it names, cannot be read.
    """
    return RobotCell(cell=parse_cell_file(path))


def robots() -> tuple[str, ...]:
    """Returns the names of the known robots, for ``make_cell(robot=...)``."""
    return preset_names()


def make_cell(
    robot: str | Path,
    *,
    tool_xyz_mm: Sequence[float] | None = None,
    tool_abc_deg: Sequence[float] | None = None,
    target_xyz_mm: Sequence[float] | None = None,
    target_sigma_mm: float | None = None,
    tracker_frame: Literal["base", "unknown"] | None = None,
    tracker_xyz_mm: Sequence[float] | None = None,
    payload_kg: float | None = None,
    payload_centre_mm: Sequence[float] | None = None,
    repeatability_mm: float | None = None,
    stiffness_Nm_per_rad: Sequence[float] | None = None,
) -> RobotCell:
    """Returns a cell without a file; defaults are those of cell.toml.

    Args:
        robot: Name of a robot (``robots()`` lists them), or path of a URDF file.
        tool_xyz_mm: Tool of the programs in the flange frame.
        tool_abc_deg: Its attitude, KUKA A, B, C.
        target_xyz_mm: Measured point in the flange frame; default: the tool point.
        target_sigma_mm: Standard deviation of that position per axis.
        tracker_frame: ``"unknown"``: the calibration estimates the tracker pose.
        tracker_xyz_mm: Position of the tracker in the frame of the points.
        payload_kg: Mass on the flange.
        payload_centre_mm: Its centre of mass in the flange frame.
        repeatability_mm: ISO 9283 RP of the data sheet.
        stiffness_Nm_per_rad: One per joint.

    Raises:
        ConfigurationError: No such robot, or a value that is not allowed.
    """
    key = "urdf" if str(robot).lower().endswith((".urdf", ".xml")) else "preset"
    tables: dict[str, dict[str, object]] = {
        "robot": {key: str(robot), "stiffness_Nm_per_rad": stiffness_Nm_per_rad},
        "tool": {"xyz_mm": tool_xyz_mm, "abc_deg": tool_abc_deg},
        "payload": {"mass_kg": payload_kg, "centre_of_mass_mm": payload_centre_mm},
        "target": {"xyz_mm": target_xyz_mm, "sigma_mm": target_sigma_mm},
        "tracker": {"frame": tracker_frame, "xyz_mm": tracker_xyz_mm},
        "repeatability": {"mm": repeatability_mm},
    }
    stated = {name: _stated_values(table) for name, table in tables.items()}
    text = write_toml({"schema": SCHEMA, **{name: t for name, t in stated.items() if t}})
    return RobotCell(cell=parse_cell(text.encode(), Path("cell.toml")))


def _stated_values(table: Mapping[str, object]) -> dict[str, object]:
    """The values that are not None, numbers as TOML writes them."""
    return {
        key: value if isinstance(value, str) else np.asarray(value).tolist()
        for key, value in table.items()
        if value is not None
    }
