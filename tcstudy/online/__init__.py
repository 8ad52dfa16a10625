"""Online: many contact problems on one condensed body at once, on plain arrays.

Offline makes one `Body` of a mesh and a material; `LawTables` and `RowLaws` say which law every point or node has;
`solve_block` solves and certifies a block of points, `solve_points` any number of them in blocks and waves.
The single solve, tcstudy.solve.contact, is the oracle: no answer here has more energy than its answer.
"""

from tcstudy.online.answers import BlockAnswers, Certificates
from tcstudy.online.block import Options, solve_block
from tcstudy.online.body import Body
from tcstudy.online.law_tables import LawTables
from tcstudy.online.row_laws import RowLaws
from tcstudy.online.sweep import solve_points

__all__ = ["BlockAnswers", "Body", "Certificates", "LawTables", "Options", "RowLaws", "solve_block", "solve_points"]
