"""One BLAS thread while the condensation runs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

from threadpoolctl import ThreadpoolController


@cache
def _thread_pools() -> ThreadpoolController:
    return ThreadpoolController()  # looks through all loaded libraries: once is enough


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """More threads than one make the many small dense operations slower."""
    with _thread_pools().limit(limits=1, user_api="blas"):
        yield
