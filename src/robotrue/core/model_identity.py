"""Identity of an arm's model, and the refusal to mix two of them.

A frame found by touching carries the error of the arm that touched; it cancels only where the same
description of that arm drives the machining. Touching with one and machining with another is six
to twelve times worse than either alone, and nothing in the numbers shows it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from robotrue.errors import ModelMismatchError

Kind = Literal["nominal", "calibrated"]
SAME_ARM: Final = "0.19 mm (nominal) or 0.09 mm (calibrated)"
"""Machining error, rms, of a part touched at 20 points and machined with the same model."""
MIXED: Final = {
    ("calibrated", "nominal"): "Probing with a calibrated and machining with the nominal arm "
    "leaves 1.15 mm rms",
    ("nominal", "calibrated"): "Probing with the nominal and machining with a calibrated arm "
    "leaves 1.12 mm rms",
}
"""The same with (touched, machined) by different models; simulated, 193 arms of a KR160."""
OTHERS: Final = "Mixing a calibrated with the nominal arm leaves 1.12 to 1.15 mm rms"
"""Where both are of one kind: what is known of the mix that is worst."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelIdentity:
    """One description of one arm.

    Attributes:
        kind: ``nominal`` (the controller's own kinematics) or ``calibrated`` (an error model).
        robot: Name of the arm, for messages.
        sha256: Of the nominal geometry, or of everything in the error model.
    """

    kind: Kind
    robot: str
    sha256: str

    def __str__(self) -> str:
        """E.g. ``the calibrated KUKA KR160 R1570 (3f2a81c07b11)``."""
        return f"the {self.kind} {self.robot} ({self.sha256[:12]})"

    def same(self, other: ModelIdentity) -> bool:
        """Returns whether both are one description; the robot's name does not count."""
        return (self.kind, self.sha256) == (other.kind, other.sha256)

    def document(self) -> dict[str, str]:
        """Returns JSON values: ``kind``, ``robot``, ``sha256``."""
        return {"kind": self.kind, "robot": self.robot, "sha256": self.sha256}


def identity_from(document: object) -> ModelIdentity:
    """Returns the identity that :meth:`ModelIdentity.document` made.

    Raises:
        ModelMismatchError: Something is missing or of another kind.
    """
    stated = document if isinstance(document, Mapping) else {}
    kind, robot, digest = (stated.get(key) for key in ("kind", "robot", "sha256"))
    if kind not in ("nominal", "calibrated") or not isinstance(digest, str):
        raise ModelMismatchError(
            f"a model identity with kind {kind!r} and sha256 {digest!r}, expected nominal or "
            "calibrated and a hash.",
            hint="make the file again with this robotrue.",
        )
    return ModelIdentity(
        kind="nominal" if kind == "nominal" else "calibrated", robot=str(robot), sha256=digest
    )


def require_same_model(
    made: ModelIdentity, used: ModelIdentity, *, what: str, source: str | None = None
) -> None:
    """Passes if a thing made with one model is used with the same one.

    Args:
        made: The model it was made with.
        used: The model that is to use it.
        what: The thing, for the message: ``"the part frame"``.
        source: Its file.

    Raises:
        ModelMismatchError: They differ; states the error of mixing them.
    """
    if made.same(used):
        return
    raise ModelMismatchError(
        f"{what} was made with {made} and would be used with {used}. "
        f"{MIXED.get((made.kind, used.kind), OTHERS)} at the part (simulated arms, 20 touches), "
        f"where one model for both leaves {SAME_ARM}.",
        source=source,
        hint="probe and machine with one model: register again with the model that will machine, "
        "or machine with the one that touched.",
    )
