"""Static condensation (method eq. (20)) by a multifrontal Cholesky factorisation; NumPy and SciPy only."""

from tcstudy.condense.condensation import Condensation, ForwardLoad, condense
from tcstudy.condense.multifrontal import NotPositiveDefinite

__all__ = ["Condensation", "ForwardLoad", "NotPositiveDefinite", "condense"]
