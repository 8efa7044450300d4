"""What a command imports before it does anything."""

from __future__ import annotations

import subprocess
import sys


def test_services_start_without_scikit_learn() -> None:
    """Fails when a service beside a machine imports it again: it takes longer than all the rest."""
    code = (
        "import robotrue.app.drilling_desk, robotrue.app.operations.sense_run\n"
        "import robotrue.online.service_run\n"
        "from robotrue.simulation import egm_controller, rdt_sensor, rsi_controller\n"
        "from robotrue.simulation import rtde_controller\n"
        "from robotrue.simulation import drilling_machine, drilling_online, online_scenario\n"
        "from robotrue.store import model_file\n"
        "import sys; print([name for name in ('sklearn', 'pandas') if name in sys.modules])\n"
        "from robotrue.calibration.learners import __all__ as names\n"
        "import robotrue.calibration.learners as learners\n"
        "print([getattr(learners, name).__name__ for name in names] == names)\n"
    )
    done = subprocess.run(  # noqa: S603 - this interpreter
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout.split("\n")[:2] == ["[]", "True"]
