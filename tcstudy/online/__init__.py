"""Many contact problems of one body at once: descent, search and certificates on rows of arrays.

Not here: meshes, scenes, files. The single problem (solve) is its oracle.
"""

from tcstudy.online.block import Options, solve_block
from tcstudy.online.every import Every, solve_every
from tcstudy.online.problems import BlockAnswers, Certificates, CondensedBody

__all__ = [
    "BlockAnswers",
    "Certificates",
    "CondensedBody",
    "Every",
    "Options",
    "solve_block",
    "solve_every",
]
