"""Learners for scikit-learn users: GP, transfer GP and boosting from source rows.

The only room that imports scikit-learn; the mathematics is NumPy and SciPy.
"""

from robotrue.calibration.learners.gaussian_process import GaussianProcess
from robotrue.calibration.learners.tradaboost import TrAdaBoostR2
from robotrue.calibration.learners.transfer_gaussian_process import TransferGaussianProcess

__all__ = ["GaussianProcess", "TrAdaBoostR2", "TransferGaussianProcess"]
