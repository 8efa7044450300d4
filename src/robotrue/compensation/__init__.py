"""From a program and an ErrorModel to corrected targets, with guards and a status per target."""

from robotrue.compensation.compensate import compensate
from robotrue.compensation.result import Compensation, zero_correction
from robotrue.compensation.settings import CompensationSettings
from robotrue.compensation.status import Status

__all__ = ["Compensation", "CompensationSettings", "Status", "compensate", "zero_correction"]
