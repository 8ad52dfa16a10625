"""One BLAS thread for all tests: two make the many small dense operations slower, not faster. No
terminal, no width, no results of other days in the cache."""

import gc
import os
import tempfile

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.pop("COLUMNS", None)  # that of whoever runs the tests; their workers set one, too
os.environ["TCSTUDY_CACHE"] = tempfile.mkdtemp(prefix="tcstudy-cache-")


def pytest_collection_finish() -> None:
    """What is imported stays: the garbage collector need not walk through it again and again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(5_000, 20, 20)
