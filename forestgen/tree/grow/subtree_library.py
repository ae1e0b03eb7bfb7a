"""Subtree library: the branching patterns that growth puts in the place of branches (Tan et al. 2008, sec. 3.1)."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.errors import InputError
from forestgen.tree.grow.axes import Axis, axes_of
from forestgen.tree.skeleton import Skeleton, is_topological

PREDEFINED = Path(__file__).parent / "subtrees"
MAX_NODES = 160  # of one subtree: what is finer is left to the twigs
TYPES = ("end", "along")  # type I and type II of the paper
FORMS = ("decurrent", "excurrent")
BEARERS = ("any", "trunk", "side")  # what a subtree may be put on


@dataclass(frozen=True, eq=False)
class Subtree:
    """New branches about a supporting branch that runs from (0, 0, 0) to (0, 1, 0). K nodes.

    Lengths are shares of the supporting branch's length; the supporting branch is not stored.
    """

    name: str
    type: str  # "end" (I: the branches start at its end) or "along" (II)
    form: str  # of crown that it is drawn for: "decurrent" or "excurrent"
    on: str  # what it may be put on: "trunk", "side" branches, or "any"
    position: NDArray[np.float64]  # (K, 3)
    parent: NDArray[np.int64]  # (K,) earlier node, -1 where a branch starts on the supporting branch
    at: NDArray[np.float64]  # (K,) where on the supporting branch the node's outermost ancestor starts, 0 to 1
    branch: NDArray[np.int64]  # (K,) which of the new branches the node belongs to

    def __post_init__(self) -> None:
        freeze(
            self,
            position=(np.float64, "K", 3),
            parent=(np.int64, "K"),
            at=(np.float64, "K"),
            branch=(np.int64, "K"),
        )
        if not is_topological(np.concatenate([[-1], self.parent + 1])):
            raise ValueError(f"subtree {self.name}: parents must come before their children")

    def __len__(self) -> int:
        return len(self.parent)


def load_subtrees(folder: Path) -> tuple[Subtree, ...]:
    """Read every subtree file (*.json) of a folder, by name.

    Raises:
        InputError: the folder holds none, or a file does not describe a subtree.
    """
    files = sorted(folder.glob("*.json"))
    if not files:
        raise InputError(f"library: no subtree (*.json) in {folder}; name a folder that holds some, or leave it empty")
    return tuple(_read_subtree(path) for path in files)


def _read_subtree(path: Path) -> Subtree:
    """One file: {"version": 1, "type", "form", "on", "branches": [{"from", "at", "path"}, ...]}.

    `from` is an earlier branch or null for the supporting branch, `at` the share of that branch's
    length at which this one starts (on a path: its nearest point), `path` the points beyond the start.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data["version"] != 1:
            raise ValueError(f"version {data['version']} is not known; expected 1")
        if data["type"] not in TYPES or data["form"] not in FORMS:
            raise ValueError(f"'type' must be one of {TYPES} and 'form' one of {FORMS}")
        if data["on"] not in BEARERS:
            raise ValueError(f"'on' must be one of {BEARERS}")
        return _join(path.stem, data["type"], data["form"], data["on"], data["branches"])
    except (ValueError, KeyError, TypeError, AttributeError, OSError) as error:
        reason = f"'{error.args[0]}' is missing" if isinstance(error, KeyError) else str(error)
        raise InputError(f"{path}: not a subtree: {reason}; see the predefined ones for the form") from error


def _join(name: str, kind: str, form: str, on: str, branches: Sequence[dict[str, Any]]) -> Subtree:
    """String the branches of a file together to one array of nodes."""
    if not branches:
        raise ValueError("'branches' is empty; expected at least one")
    first: list[int] = []  # index of each branch's first node
    position: list[NDArray[np.float64]] = []
    parent: list[int] = []
    at: list[float] = []
    label: list[int] = []
    for index, branch in enumerate(branches):
        path, source, share = np.array(branch["path"], float), branch["from"], float(branch["at"])
        if path.ndim != 2 or path.shape[1] != 3 or not len(path) or not np.isfinite(path).all():
            raise ValueError(f"branch {index}: 'path' must be a list of at least one [x, y, z]")
        if not 0 <= share <= 1:
            raise ValueError(f"branch {index}: 'at' is {share}; expected 0 to 1")
        if source is not None and not 0 <= int(source) < index:
            raise ValueError(f"branch {index}: 'from' is {source}; expected null or an earlier branch")
        start = len(parent)
        if source is None:
            root, foot = -1, share
        else:
            count = len(position[int(source)])
            root = first[int(source)] + int(np.clip(round(share * count) - 1, 0, count - 1))
            foot = at[root]
        first.append(start)
        position.append(path)
        parent += [root, *range(start, start + len(path) - 1)]
        at += [foot] * len(path)
        label += [index] * len(path)
    return Subtree(name, kind, form, on, np.concatenate(position), np.array(parent), np.array(at), np.array(label))


def subtrees_of(skeleton: Skeleton, form: str, stem: int = 0) -> list[Subtree]:
    """All subtrees of the visible branches, one for each that bears others; what repeats is left out."""
    axes = axes_of(skeleton, stem)
    found = []
    for index, axis in enumerate(axes):
        borne = _borne_by(axes, index)
        if borne:
            on = "any" if form == "decurrent" else "trunk" if axis.order == 0 else "side"
            found.append(_as_subtree(f"visible_{index}", form, on, skeleton, axes, axis, borne))
    unique: list[Subtree] = []
    for subtree in found:
        if len(subtree) <= MAX_NODES and all(difference(subtree, other) > 0.02 for other in unique):
            unique.append(subtree)
    return unique


def _borne_by(axes: Sequence[Axis], index: int) -> list[int]:
    """Axes that grow on an axis or on one of these, in rising order."""
    inside, out = {index}, []
    for other in range(index + 1, len(axes)):
        if axes[other].bearer in inside:
            inside.add(other)
            out.append(other)
    return out


def _as_subtree(
    name: str, form: str, on: str, skeleton: Skeleton, axes: Sequence[Axis], support: Axis, borne: list[int]
) -> Subtree:
    """The borne axes in the frame of their supporting branch, whose chord becomes +Y and whose length 1."""
    line = skeleton.position[support.nodes]
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    length = max(float(along[-1]), 1e-9)
    chord = (line[-1] - line[0]) / max(float(np.linalg.norm(line[-1] - line[0])), 1e-9)
    foot = dict(zip(support.nodes.tolist(), support.nodes.tolist(), strict=True))  # node -> where it leaves the support
    index: dict[int, int] = {}
    nodes: list[int] = []
    parent, label = [], []
    for count, which in enumerate(borne):
        above = int(axes[which].nodes[0])
        for node in axes[which].nodes[1:].tolist():
            foot[node] = foot[above]
            index[node] = len(nodes)
            nodes.append(node)
            parent.append(index.get(above, -1))
            label.append(count)
            above = node
    share = dict(zip(support.nodes.tolist(), along / length, strict=True))
    feet = [foot[node] for node in nodes]
    at = np.array([share[node] for node in feet])
    away = (skeleton.position[nodes] - skeleton.position[feet]) @ turn_to_y(chord[None])[0].T / length
    position = away + np.column_stack([np.zeros_like(at), at, np.zeros_like(at)])
    return Subtree(name, "along", form, on, position, np.array(parent), at, np.array(label))


def turn_to_y(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """The smallest rotations (U, 3, 3) that take unit vectors (U, 3) to +Y."""
    x, y, z = direction.T
    bend = 1 / np.maximum(1 + y, 1e-9)
    turn = np.empty((len(direction), 3, 3))
    turn[:, 0] = np.column_stack([1 - x * x * bend, -x, -x * z * bend])
    turn[:, 1] = direction
    turn[:, 2] = np.column_stack([-x * z * bend, -z, 1 - z * z * bend])
    turn[y < -1 + 1e-9] = np.diag([1.0, -1.0, -1.0])
    return turn


def difference(a: Subtree, b: Subtree) -> float:
    """How unlike two subtrees are: mean distance of nearest nodes both ways in (height, distance from the support)."""
    flat_a = np.column_stack([a.position[:, 1], np.hypot(a.position[:, 0], a.position[:, 2])])
    flat_b = np.column_stack([b.position[:, 1], np.hypot(b.position[:, 0], b.position[:, 2])])
    apart = np.linalg.norm(flat_a[:, None] - flat_b[None], axis=2)
    return float((apart.min(axis=1).mean() + apart.min(axis=0).mean()) / 2)


def choose_diverse(subtrees: Sequence[Subtree], count: int) -> tuple[Subtree, ...]:
    """At most `count` of the subtrees: the first, then each time the one most unlike those chosen."""
    chosen = list(subtrees[:1])
    rest = list(subtrees[1:])
    while rest and len(chosen) < count:
        gap = [min(difference(one, other) for other in chosen) for one in rest]
        chosen.append(rest.pop(int(np.argmax(gap))))
    return tuple(chosen)
