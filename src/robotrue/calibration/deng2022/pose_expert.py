"""What a model of poses is made of: the expert of a region, and its training summary."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robotrue.calibration.deng2022.committee import Committee
from robotrue.calibration.deng2022.joined import Expert
from robotrue.calibration.deng2022.labelled_poses import Labelled
from robotrue.calibration.lineage import describe_rows
from robotrue.calibration.settings import FitSettings
from robotrue.core.regions import CylinderRegion
from robotrue.core.units import MM
from robotrue.measurement.measurement_set import MeasurementSet


def expert_of(
    region: CylinderRegion, committee: Committee, rows: Labelled, settings: FitSettings
) -> Expert:
    """Returns the expert of a region; its noise is the learned one without the instrument's.

    That is repeatability and what no pose explains.
    """
    instrument = float(np.mean(np.trace(rows.covariance, axis1=1, axis2=2)) / 3.0)
    left = (committee.noise * MM) ** 2 - instrument
    white = float(np.sqrt(max(left, settings.repeatability_sd**2)))
    return Expert(region=region, committee=committee, white=white)


def pose_summary(
    rows: MeasurementSet,
    method: str,
    *,
    inside: str = ", and only inside its domains",
    doubts: Sequence[str] = (),
) -> dict[str, object]:
    """Returns the JSON values of a model of poses; lengths are SI like everything in an archive.

    Args:
        rows: All rows it was fitted to.
        method: Its name.
        inside: Where it holds, the end of the doubt.
        doubts: That come before it.
    """
    return {
        "method": method,
        **describe_rows(rows),
        "screened_rows": [],
        "verdict": "conditional",
        "doubts": [
            *doubts,
            "A model of poses: it holds for the payload, the tool point and the arm configuration "
            f"that were measured{inside}.",
        ],
    }
