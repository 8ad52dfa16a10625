"""Who solves a block of points: this process, workers beside it, or a dask cluster; what becomes of a worker that dies.

A unit of work is arrays: a body, loads, laws, options and neighbours (`Task`), so that it travels anywhere and a
worker imports tcstudy.online and nothing else. An executor takes tasks and gives futures; it writes nothing and knows
no study.

Not here: which points form a block, what is recorded of them (study); how they are solved (online).
"""

from tcstudy.executors.cluster import Cluster
from tcstudy.executors.processes import Processes, available
from tcstudy.executors.protocol import Executor, Here, Solved, Task, WorkerDied, WorkersFailed

__all__ = [
    "Cluster",
    "Executor",
    "Here",
    "Processes",
    "Solved",
    "Task",
    "WorkerDied",
    "WorkersFailed",
    "available",
]
