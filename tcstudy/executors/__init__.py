"""Who does the work: this process, workers beside it, or a dask cluster; what becomes of a worker that dies.

A block of points is arrays: a body, loads, laws, options and neighbours (`Task`), so that it travels anywhere and a
worker imports tcstudy.online and nothing else. Larger work, a geometry for one, is a call of a function with what it
needs (`Errand`), both packed: its worker imports what the function does. An executor takes work and gives futures; it
writes nothing and knows no study.

Not here: which points form a block, what is recorded of them, what errands do (study); how to solve them (online).
"""

from tcstudy.executors.cluster import Cluster
from tcstudy.executors.processes import Processes, available
from tcstudy.executors.protocol import (
    Errand,
    Executor,
    Here,
    Solved,
    Task,
    WorkerDied,
    WorkersFailed,
    in_order,
    unpacked,
)

__all__ = [
    "Cluster",
    "Errand",
    "Executor",
    "Here",
    "Processes",
    "Solved",
    "Task",
    "WorkerDied",
    "WorkersFailed",
    "available",
    "in_order",
    "unpacked",
]
