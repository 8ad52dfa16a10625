"""One BLAS thread for all tests: two make the many small dense operations slower, not faster."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")
