"""A certificate of an arm that does not exist, for the tests of reports."""

from __future__ import annotations

import numpy as np
from validation_fakes import FakeModel, measured

from robotrue.report.certificate import CertificateFacts, check_regions
from robotrue.report.content import Fact
from robotrue.validation.budget import Budget, Contribution
from robotrue.validation.evaluation import evaluate
from robotrue.validation.metrics import error_statistics
from robotrue.validation.validate import validate


def wave(joints):
    return 1e-3 * np.stack([np.sin(3 * joints[:, 0]), np.cos(2 * joints[:, 1]), joints[:, 2]], 1)


MODEL = FakeModel(mean=wave)
LINES = tuple(
    Contribution(
        name=name, value=value, unit=unit, distribution="normal", divisor=1.0, sensitivity=c,
        evaluation="A", in_target=name != "range",
    )
    for name, value, unit, c in (
        ("model", 3e-5, "m", 1.0),
        ("repeatability", 4e-5, "m", 1.0),
        ("force", 0.0, "N", 1e-6),
        ("range", 1.2e-4, "m", 1.0),
    )
)  # fmt: skip
BUDGET = Budget(contributions=LINES, poses=60, worst=2e-4)


def make_facts() -> CertificateFacts:
    check = measured(60, error=wave)
    seen = evaluate(MODEL, check)
    rows = check_regions(seen.measured.position, check.group, check.group_names)
    return CertificateFacts(
        robot="Arm 7",
        method="elastic",
        simulated=True,
        budget=BUDGET,
        places=None,
        check=validate(MODEL, check),
        regions=tuple((name, error_statistics(seen.after[r])) for name, r in rows),
        lineage=({"step": "fit", "rows": 80, "data_sha256": "ab" * 32, "sources": ["a.csv"]},),
        provenance=(Fact(name="模型文件", key="model file", value="m.rtm sha256:" + "ab" * 32),),
    )
