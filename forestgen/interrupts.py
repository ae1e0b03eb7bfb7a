"""Ctrl-C and its like: raised as KeyboardInterrupt, held back while files are moved."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def raise_on_signals() -> None:
    """Let a request to end come as KeyboardInterrupt, so that every block tidies up. For the commands only."""
    for number in SIGNALS:
        if signal.getsignal(number) != signal.SIG_IGN:  # nohup and the like stay in force
            signal.signal(number, _interrupt)


def _interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold requests to end back until the block is done; for blocks of some milliseconds."""
    if threading.current_thread() is not threading.main_thread():  # Python gives signals to the main thread only
        yield
        return
    came: list[int] = []
    kept = {number: signal.getsignal(number) for number in SIGNALS}
    held = {number: handler for number, handler in kept.items() if callable(handler)}
    for number in held:
        signal.signal(number, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for number, handler in held.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])
