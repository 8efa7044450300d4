"""Learners for scikit-learn users: GP, transfer GP and boosting from source rows.

The only room that imports scikit-learn; the mathematics is NumPy and SciPy.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robotrue.calibration.learners.gaussian_process import GaussianProcess
    from robotrue.calibration.learners.tradaboost import TrAdaBoostR2
    from robotrue.calibration.learners.transfer_gaussian_process import TransferGaussianProcess

__all__ = ["GaussianProcess", "TrAdaBoostR2", "TransferGaussianProcess"]


def __getattr__(name: str) -> Any:
    """Returns a learner, imported when it is first used.

    Commands use the mathematics beside the learners; scikit-learn would take most of the time in
    which `sense` and `drill run` start.
    """
    if name == "GaussianProcess":
        from robotrue.calibration.learners.gaussian_process import GaussianProcess

        return GaussianProcess
    if name == "TrAdaBoostR2":
        from robotrue.calibration.learners.tradaboost import TrAdaBoostR2

        return TrAdaBoostR2
    if name == "TransferGaussianProcess":
        from robotrue.calibration.learners.transfer_gaussian_process import TransferGaussianProcess

        return TransferGaussianProcess
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
