"""Predicted errors of a model at given joints."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from robotrue.app.operations.predict import Predictions
from robotrue.app.presentation import Block, Facts
from robotrue.app.reporting import Message
from robotrue.core.provenance import Provenance
from robotrue.core.units import DEG, MM
from robotrue.library.presented import Presented
from robotrue.robot.forward import forward

if TYPE_CHECKING:
    import pandas as pd

    from robotrue.calibration.model import ErrorModel
    from robotrue.library.pictures import Picture


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class PredictedErrors(Presented):
    """Errors, actual minus commanded, in the base frame; one row per query.

    Attributes:
        model: Model of the prediction.
        result: Of the operation ``predict``.
        messages: Messages of the operation.
    """

    model: ErrorModel
    result: Predictions
    messages: tuple[Message, ...]

    def __len__(self) -> int:
        return self.result.n

    @property
    def error_mm(self) -> npt.NDArray[np.float64]:
        """(n, 3) mm."""
        return self.result.prediction.error / MM

    @property
    def covariance_mm2(self) -> npt.NDArray[np.float64]:
        """(n, 3, 3) mm^2 of the actual position about its prediction at one visit."""
        return self.result.prediction.covariance / MM**2

    @property
    def sigma_mm(self) -> npt.NDArray[np.float64]:
        """(n, 3) mm, one standard deviation along each axis."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance_mm2, axis1=1, axis2=2)))

    @property
    def commanded_mm(self) -> npt.NDArray[np.float64]:
        """(n, 3) mm, measured point according to the controller."""
        return forward(self.model.robot.nominal(), self.result.queries.joints)[:, :3, 3] / MM

    @property
    def provenance(self) -> Provenance | None:
        """Provenance of the model."""
        return self.result.provenance

    def blocks(self) -> Iterable[Block]:
        """Returns counts and sizes."""
        yield Facts(
            title=f"predicted errors of {self.model.robot.name}",
            rows=(
                ("queries", f"{self.result.n}"),
                ("mean error", f"{self.result.mean_mm:.3f} mm"),
                ("largest error", f"{self.result.max_mm:.3f} mm"),
                ("mean standard deviation per axis", f"{self.result.mean_sigma_mm:.3f} mm"),
            ),
        )

    def to_dataframe(self) -> pd.DataFrame:
        """Returns one row per query: deg, mm."""
        import pandas as pd

        joints = self.result.queries.joints / DEG
        blocks = [
            (joints, [f"j{k + 1}_deg" for k in range(joints.shape[1])]),
            (self.commanded_mm, ["x_mm", "y_mm", "z_mm"]),
            (self.error_mm, ["ex_mm", "ey_mm", "ez_mm"]),
            (self.sigma_mm, ["sx_mm", "sy_mm", "sz_mm"]),
        ]
        return pd.concat([pd.DataFrame(values, columns=names) for values, names in blocks], axis=1)

    def plot(self) -> Picture:
        """Returns the errors as enlarged arrows, from above and from the side."""
        from robotrue.library.pictures import draw_arrows, make_picture

        drawing = draw_arrows(self.commanded_mm * MM, self.result.prediction.error, "base")
        return make_picture(
            [drawing], title=f"{self._mark}predicted errors of {self.model.robot.name}"
        )

    def _describe(self) -> str:
        return (
            f"predicted errors: {self.result.n} queries, mean {self.result.mean_mm:.3f} mm, "
            f"sigma {self.result.mean_sigma_mm:.3f} mm"
        )
