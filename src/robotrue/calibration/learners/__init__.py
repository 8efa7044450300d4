"""Learners for scikit-learn users: GP, transfer GP and boosting from source rows.

The only room that imports scikit-learn; the mathematics is NumPy and SciPy.
"""

from robotrue.calibration.learners.gaussian_process import GaussianProcess
from robotrue.calibration.learners.tradaboost import TrAdaBoostR2

__all__ = ["GaussianProcess", "TrAdaBoostR2"]
