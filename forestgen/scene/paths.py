"""Paths of a manifest: relative to its folder, and never above the scene's root."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path, PurePosixPath, PureWindowsPath

from forestgen.errors import InputError
from forestgen.reading import file_fault, quoted

ROOT_MARKS = ("stroke_sets", "scenes")  # a folder that holds one of these is a scene's root


def scene_root(manifest: Path, root: Path | None = None) -> Path:
    """The folder above which a manifest's paths may not climb, resolved.

    The nearest folder at or above the manifest's own that holds `stroke_sets/` or `scenes/`, else the
    manifest's own; or `root`, where it is given.

    Raises:
        InputError: the given root is no folder, or does not hold the manifest.
    """
    folder = manifest.parent.resolve()
    if root is None:
        marked = (up for up in (folder, *folder.parents) if any((up / mark).is_dir() for mark in ROOT_MARKS))
        return next(marked, folder)
    if not root.is_dir():
        raise InputError(f"--root {root}: expected a folder, but there is none of that name")
    if not folder.is_relative_to(root.resolve()):
        raise InputError(f"--root {root}: expected a folder that holds {manifest}, but it lies elsewhere")
    return root.resolve()


@dataclass(frozen=True)
class Location:
    """Where a manifest stands: what its relative paths start from, and where they must stay."""

    folder: Path  # the manifest's, as the user gave it
    root: Path  # resolved

    def file(self, text: str, where: str, what: str) -> Path:
        """The file that a manifest's path names. `where` begins the message: file, tree and key.

        Raises:
            InputError: the path is absolute, climbs above the root, or there is no such file.
        """
        target = self._below_root(text, where)
        if fault := file_fault(self.folder / text, what):
            hint = "; write paths with forward slashes" if "\\" in text else ""
            raise InputError(f"{where}: {quoted(text)}: {fault}{hint}")
        return Path(os.path.normpath(self.folder / text)) if self._is_plain(text) else target

    def directory(self, text: str, where: str) -> Path:
        """The folder that a manifest's path names, resolved.

        Raises:
            InputError: the path is absolute, climbs above the root, or there is no such folder.
        """
        target = self._below_root(text, where)
        try:
            is_there = target.is_dir()
        except OSError:  # a name no folder can have
            is_there = False
        if not is_there:
            raise InputError(f"{where}: {quoted(text)}: expected a folder, but there is none; check the path")
        return target

    def _below_root(self, text: str, where: str) -> Path:
        """What a manifest's path names, resolved; InputError where that lies outside of the root."""
        as_windows = PureWindowsPath(text)
        if not text or PurePosixPath(text).is_absolute() or as_windows.is_absolute() or as_windows.drive:
            raise InputError(f"{where}: expected a path relative to the manifest, came {quoted(text)}")
        if "\0" in text:
            raise InputError(f"{where}: expected a path, but {quoted(text)} holds a zero character")
        folder = self.folder.resolve()
        depth = len(folder.relative_to(self.root).parts)
        for part in PurePosixPath(text).parts:
            depth += -1 if part == ".." else 1
            if depth < 0:
                raise self._leaves(text, where)
        try:
            target = (folder / text).resolve()
        except (OSError, RuntimeError) as error:  # links in a ring
            raise InputError(f"{where}: {quoted(text)} cannot be followed: {error}") from error
        if not target.is_relative_to(self.root):
            raise self._leaves(text, where)
        return target

    def shown(self, path: Path) -> str:
        """A path below the root, relative to it, for what is written to files."""
        full = Path(os.path.normpath(path.absolute()))
        for candidate in (full, path.resolve()):
            if self.root != Path(self.root.anchor) and candidate.is_relative_to(self.root):
                return candidate.relative_to(self.root).as_posix()
        return path.name

    def _is_plain(self, text: str) -> bool:
        """Whether `a/../b` means b: no link stands before a `..`."""
        return Path(os.path.normpath(self.folder / text)).resolve() == (self.folder / text).resolve()

    def _leaves(self, text: str, where: str) -> InputError:
        return InputError(
            f"{where}: {quoted(text)} leads out of the scene's root {self.root};"
            " move the file below it, or widen it with --root"
        )
