"""One BLAS thread for all tests: two make the many small dense operations slower, not faster. No terminal, no width, no
results of other days in the cache."""

import os
import tempfile

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.pop("COLUMNS", None)  # that of whoever runs the tests; their workers set one, too
os.environ["TCSTUDY_CACHE"] = tempfile.mkdtemp(prefix="tcstudy-cache-")
