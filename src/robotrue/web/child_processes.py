"""How the server starts processes: forked from one that has loaded the libraries already.

Loading them takes seconds of a core, and a query, a worker and each of its jobs need the same ones.
The server itself has threads and is never forked. Where the system cannot fork, each is spawned.
"""

from __future__ import annotations

import multiprocessing
from typing import Final, TypeAlias

from robotrue.store.jobs_worker import Start

LIBRARIES: Final = [
    "matplotlib.figure",
    "numba",
    "scipy.optimize",
    "scipy.spatial.transform",
    "robotrue.app.operations.calibrate",
    "robotrue.app.workbench.workbench_calls",
    "robotrue.app.workspace_context",
    "robotrue.report.page",
    "robotrue.store.jobs_worker",
]
"""What nearly every child imports."""
Context: TypeAlias = multiprocessing.context.BaseContext


def child_start() -> Start:
    """Returns how children are started here."""
    return "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"


def child_context() -> Context:
    """Returns what starts children; the libraries are loaded with the first of them."""
    context = multiprocessing.get_context(child_start())
    context.set_forkserver_preload(LIBRARIES)
    return context
