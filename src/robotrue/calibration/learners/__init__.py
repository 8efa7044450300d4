"""Learners for scikit-learn users: GP, transfer GP and boosting from source rows.

The only room that imports scikit-learn; the mathematics is NumPy and SciPy.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from robotrue.calibration.learners.gaussian_process import GaussianProcess
    from robotrue.calibration.learners.tradaboost import TrAdaBoostR2
    from robotrue.calibration.learners.transfer_gaussian_process import TransferGaussianProcess

__all__ = ["GaussianProcess", "TrAdaBoostR2", "TransferGaussianProcess"]
_FILES: Final = ("gaussian_process", "tradaboost", "transfer_gaussian_process")


def __getattr__(name: str) -> object:
    """Returns a learner, imported when it is first used.

    Commands use the mathematics beside the learners; scikit-learn would take most of the time in
    which `sense` and `drill run` start.
    """
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_FILES[__all__.index(name)]}"), name)
