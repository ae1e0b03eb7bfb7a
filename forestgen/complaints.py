"""Complaints: what the system refused, in words."""

from __future__ import annotations

import errno

ROOM = "make room, or choose another folder with -o"
RIGHTS = "choose a folder that you may write to with -o"
REMEDIES = {
    errno.ENOSPC: ROOM,
    errno.EDQUOT: ROOM,
    errno.EFBIG: ROOM,
    errno.EACCES: RIGHTS,
    errno.EPERM: RIGHTS,
    errno.EROFS: RIGHTS,
}


def in_words(error: OSError) -> str:
    """What the system refused, and what to do where that is known."""
    remedy = REMEDIES.get(error.errno or 0)
    where = f"{error.filename}: " if error.filename else ""
    return where + (error.strerror or str(error)) + (f": {remedy}" if remedy else "")
