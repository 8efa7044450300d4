"""How readings are read that a model answers or is judged by."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from robotrue.core.units import UM
from robotrue.drilling.campaign import Campaign
from robotrue.drilling.campaign_checks import check_campaign
from robotrue.drilling.campaign_csv import read_campaign
from robotrue.drilling.foot_file import FootSetup, read_foot
from robotrue.drilling.foot_model import NormalModel
from robotrue.errors import ConfigurationError


def setup_of(model: NormalModel, path: Path, foot: Path | None) -> FootSetup:
    """Returns the setup readings are read with: the foot file's zero, the model's sensors.

    Args:
        model: What the readings are for.
        path: Its file, for messages.
        foot: Foot file; None for readings less their zero.

    Raises:
        ConfigurationError: A foot whose sensors stand elsewhere.
    """
    if foot is None:
        return FootSetup(foot=model.foot, head=model.head, count=None, zero=None, source=str(path))
    stated = read_foot(foot)
    same = len(stated.foot.radius) == len(model.foot.radius) and np.allclose(
        stated.foot.seat, model.foot.seat, rtol=0.0, atol=1.0 * UM
    )
    if not same:
        raise ConfigurationError(
            f"the sensors of {foot.name} stand elsewhere than those the model was learned with.",
            source=foot,
            hint="pass the foot file of the campaign, or learn anew.",
        )
    return stated


def read_test(
    model: NormalModel, path: Path, rows: Path, foot: Path | None
) -> tuple[Campaign, str]:
    """Returns checked clamps to judge a model on, and the SHA-256 of their file.

    Args:
        model: To be judged.
        path: Its file, for messages.
        rows: The clamps.
        foot: As in :func:`setup_of`.
    """
    test, digest = read_campaign(rows, setup_of(model, path, foot), model.head.order)
    check_campaign(model.foot, test)
    return test, digest
