"""BLAS on one thread: products here are thin, and threads that wait for each other cost more than they give."""

from __future__ import annotations

import os


def on_one_thread() -> None:
    """Keep numpy's and scipy's BLAS from starting threads, unless the user has said how many; before their import.

    Colour models multiply 10 x 10 by 10 x 20,000 some hundred times: to segment a photo took 5.9 s of processor time
    on two cores, 3.3 to 8 s by the clock where another worker was busy, and takes 2.4 s. The bytes are the same.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
