"""One thread for linear algebra: matrices of some hundred rows are done before a second thread has begun."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Within it NumPy's and SciPy's linear algebra uses one thread: several wait for each other most of the time."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1, "blas"):
        yield
