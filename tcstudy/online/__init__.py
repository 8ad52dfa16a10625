"""Many contact problems of one body at once: descent, search and certificates on rows of arrays.

Not here: meshes, scenes, files. The single problem (solve) is its oracle.
"""

from tcstudy.online.block import Options, solve_block
from tcstudy.online.problems import BlockAnswers, Certificates, CondensedBody
from tcstudy.online.row_laws import RowLaws
from tcstudy.scene.law_tables import LawTables

__all__ = [
    "BlockAnswers",
    "Certificates",
    "CondensedBody",
    "LawTables",
    "Options",
    "RowLaws",
    "solve_block",
]
