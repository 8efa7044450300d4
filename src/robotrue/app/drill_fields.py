"""Fields that requests about drilling share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

from robotrue.app.request import NOT_IN_FORMS, InputFile, Item, Option, Reference
from robotrue.app.request_fields import model_output

DrillModel: TypeAlias = Annotated[
    Reference, Item(noun="document", argument="MODEL", help="Model file of `drill fit`.")
]
ModelOutput: TypeAlias = Annotated[
    Path, model_output(saved_as="drill.robotrue", help="Model file to write.")
]
ZeroFoot: TypeAlias = Annotated[
    Path | None,
    InputFile(shells=NOT_IN_FORMS, help="Foot file, where the readings are not less their zero."),
]
ReferenceSigma: TypeAlias = Annotated[
    float, Option(help="Standard deviation of that reference in deg.")
]
CarryingRobot: TypeAlias = Annotated[
    Path | None, InputFile(help="A robot carries the foot: its calibrated model.")
]
FootAngles: TypeAlias = Annotated[
    str, Option(help="With --robot: A,B,C of the foot in the tool; default z against z.")
]
