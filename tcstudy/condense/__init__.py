"""Static condensation (method eq. (20)) by a multifrontal Cholesky factorisation.

It needs only NumPy and SciPy. Not here: where the matrix comes from (fem), loads of a scene
(offline).
"""

from tcstudy.condense.condensation import Condensation, NotPositiveDefinite, condense

__all__ = ["Condensation", "NotPositiveDefinite", "condense"]
