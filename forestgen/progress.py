"""Progress of a build on stderr: bars on a terminal, a line a tree elsewhere."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from forestgen.workers import OnProgress

if TYPE_CHECKING:
    from rich.console import Console

WIDTH = 32  # of a name, in columns


@contextmanager
def shown_progress(names: Sequence[str], steps: Sequence[str], console: Console) -> Iterator[OnProgress]:
    """Show how far each of the named trees is in its steps; gives what is to be called."""
    if console.is_terminal:
        with _bars(names, steps, console) as on_progress:
            yield on_progress
    else:
        yield _lines(names, console)


@contextmanager
def _bars(names: Sequence[str], steps: Sequence[str], console: Console) -> Iterator[OnProgress]:
    """One bar a tree: its name, how far it is, the stage it is in, how long it took."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.table import Column

    columns = (
        TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=True, max_width=WIDTH)),
        BarColumn(bar_width=24),
        TextColumn("{task.fields[stage]}", markup=False, table_column=Column(no_wrap=True, min_width=12)),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console) as progress:
        tasks = [progress.add_task(one_line(name), total=len(steps), stage="waiting", start=False) for name in names]

        def on_progress(index: int, stage: str, done: int, total: int) -> None:
            task = tasks[index]
            progress.start_task(task)
            if stage in steps:
                share = done / total if total else 0.0
                label = f"{stage} {done}/{total}" if total else stage
                progress.update(task, completed=steps.index(stage) + share, stage=label)
            else:
                progress.update(task, completed=len(steps), stage="done")
                progress.stop_task(task)

        yield on_progress


def _lines(names: Sequence[str], console: Console) -> OnProgress:
    """One line when a tree begins, and one when it is done."""
    begun: set[int] = set()
    done: set[int] = set()

    def on_progress(index: int, stage: str, _done: int, _total: int) -> None:
        seen, word = (begun, stage) if stage else (done, "done")
        if index in seen:
            return
        seen.add(index)
        count = f"{len(done)} of {len(names)} done"
        console.print(f"{one_line(names[index])}: {word} ({count})", markup=False, soft_wrap=True)

    return on_progress


def one_line(name: str) -> str:
    """A name without line ends and control characters."""
    return " ".join("".join(c if c.isprintable() else " " for c in name).split()) or "?"
