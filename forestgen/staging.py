"""Staging: output is made in a hidden folder inside OUT, and takes its place there only when all of it is done."""

from __future__ import annotations

import fcntl
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp

from forestgen.errors import InputError
from forestgen.interrupts import uninterrupted

PREFIX = ".forestgen_partial_"  # hidden folders of this name are unfinished work, cleared by the next build
REPLACED = "replaced"  # in such a folder: what was moved away


@contextmanager
def staging(out: Path) -> Iterator[Path]:
    """Give a fresh hidden folder inside `out`; it is gone at the end, and so are folders made for nothing.

    Raises:
        InputError: another forestgen is writing to `out`.
        OSError: `out` cannot be made or written to.
    """
    made = [folder for folder in (out, *out.parents) if not folder.exists()]
    work: Path | None = None
    try:
        out.mkdir(parents=True, exist_ok=True)
        with _locked(out):
            for stale in out.glob(PREFIX + "*"):
                shutil.rmtree(stale, ignore_errors=True)
            work = Path(mkdtemp(prefix=PREFIX, dir=out))
            yield work
    except OSError as error:
        if error.errno is not None and error.filename is None:  # a full disk does not say where
            error.filename = os.fspath(out)
        raise
    finally:
        with uninterrupted():
            if work is not None:
                shutil.rmtree(work, ignore_errors=True)
            for folder in made:
                if not folder.is_dir() or any(folder.iterdir()):
                    break
                folder.rmdir()


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Keep other processes out of a folder; the lock ends with the process, however that ends."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"{folder}: another forestgen is writing here; wait for it, or choose another -o"
            ) from None
        except OSError:
            pass  # a file system without locks: two builds at once into one folder are then the user's to avoid
        yield
    finally:
        os.close(handle)


def install(work: Path, out: Path, fresh: Sequence[str], stale: Sequence[str] = ()) -> None:
    """Move the `fresh` entries of a staging folder into `out`, in place of earlier ones, and `stale` ones away.

    Names are relative to both folders. Where one cannot be moved, all moves are undone.

    Raises:
        OSError: an entry could not be moved; `out` is as it was.
    """
    moved: list[tuple[Path, Path]] = []

    def move(source: Path, target: Path) -> None:
        target.parent.mkdir(parents=True, exist_ok=True)
        source.rename(target)
        moved.append((source, target))

    with uninterrupted():
        try:
            for name in (*fresh, *stale):
                if os.path.lexists(out / name):
                    move(out / name, work / REPLACED / name)
                if name in fresh:
                    move(work / name, out / name)
        except OSError:
            for source, target in reversed(moved):
                target.rename(source)
            raise
