"""Reading what people wrote: a text file, its keys and values, and one clear line when something is wrong."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo

from forestgen.errors import InputError

MAX_BYTES = 50_000_000  # no manifest or stroke set comes near; a film in its place does


class Table(BaseModel):
    """A table of keys in a file. Types are taken at their word, unknown keys are refused.

    Each field's description completes the sentence "expected ..." of its error message.
    """

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


AnyTable = TypeVar("AnyTable", bound=Table)


def require_file(path: Path, what: str) -> None:
    """Raise InputError unless `path` is a file that holds something. `what` names it: "a photo"."""
    if fault := file_fault(path, what):
        raise InputError(f"{shortened(printable(str(path)), 200)}: {fault}")


def file_fault(path: Path, what: str) -> str | None:
    """What keeps a path from being a file that holds something, and what to do; None where it is one."""
    try:
        if path.is_file():
            size = path.stat().st_size
            return None if size else f"expected {what}, but the file is empty (0 bytes); copy it here again"
        if path.is_dir():
            return f"expected {what}, but this is a folder; give the path of the file itself"
        if path.exists():
            return f"expected {what}, but this is no regular file; give the path of a file"
    except (OSError, ValueError, RuntimeError) as error:  # a name no file can have; no permission; links in a ring
        return f"expected {what}, but it cannot be opened: {shortened(one_line(str(error)), 100)}"
    return f"expected {what}, but there is no such file; check the path"


def read_text(path: Path, what: str) -> str:
    """The text of a UTF-8 file; a byte-order mark at its start is dropped."""
    require_file(path, what)
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path}: expected {what}, but the file is larger than {MAX_BYTES // 10**6} MB")
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: expected {what} as UTF-8 text, but byte {error.start} is not UTF-8; save the file as UTF-8"
        ) from error
    except OSError as error:
        raise InputError(f"{path}: expected {what}, but it cannot be read: {error.strerror}") from error


def read_json(path: Path, what: str) -> Any:
    """The content of a JSON file."""
    return _parsed(json.loads, path, what, "JSON")


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """The content of a TOML file."""
    return dict(_parsed(tomllib.loads, path, what, "TOML"))


def _parsed(parse: Callable[[str], Any], path: Path, what: str, language: str) -> Any:
    text = read_text(path, what)
    try:
        return parse(text)
    except RecursionError as error:
        raise InputError(f"{path}: expected {what}, but its brackets are nested too deeply to be one") from error
    except ValueError as error:  # both libraries' syntax errors, and numbers of thousands of digits
        raise InputError(f"{path}: not valid {language}: {one_line(str(error))}; mend it there") from error


def checked(model: type[AnyTable], data: object, where: str) -> AnyTable:
    """Data as a table of the given model.

    Raises:
        InputError: `where: key: expected ..., came ...` for the first thing that is wrong.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        faults = error.errors(include_url=False, include_context=False)
        # A key that is spelled wrong is both unknown and missing: the former says more.
        first, *others = sorted(faults, key=lambda fault: fault["type"] != "extra_forbidden")
        raise InputError(f"{where}: {_complaint(model, data, first)}{_and_more(len(others))}") from None


def _complaint(model: type[Table], data: object, error: Any) -> str:
    loc = error["loc"]
    owner, expected = _described(model, loc)
    if error["type"] == "extra_forbidden":
        owner, _ = _described(model, loc[:-1])
        place = key_path(loc[:-1], data)
        lead = f"{place}: " if place else ""
        return f"{lead}unknown key {quoted(str(loc[-1]))}; {_better_key(owner, str(loc[-1]))}"
    place = key_path(loc, data)
    if error["type"] == "missing":
        return f"{place} is missing: expected {expected}"
    return f"{place + ': ' if place else ''}expected {expected}, came {shown(error['input'])}"


def _described(model: type[Table], loc: tuple[int | str, ...]) -> tuple[type[Table], str]:
    """The innermost table that holds a location, and what is expected there."""
    owner, expected = model, "a table of keys"
    for part in loc:
        field = _keys(owner).get(part)
        if field:
            expected = field.description or expected
            owner = _table_in(field.annotation) or owner
    return owner, expected


def _better_key(owner: type[Table], key: str) -> str:
    """What to write instead of an unknown key: it may be known one table further in."""
    for name, field in _keys(owner).items():
        table = _table_in(field.annotation)
        if table and key in _keys(table):
            return f"it belongs in the table {quoted(str(name))}"
    return suggestion(key, _keys(owner))


def _keys(model: type[Table]) -> dict[int | str, FieldInfo]:
    """The fields of a table by the key that they have in the file."""
    return {field.alias or name: field for name, field in model.model_fields.items()}


def _table_in(annotation: Any) -> type[Table] | None:
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return annotation
    return next((table for part in get_args(annotation) if (table := _table_in(part))), None)


def _and_more(count: int) -> str:
    return f" (and {count} more {'fault' if count == 1 else 'faults'})" if count else ""


def key_path(loc: Iterable[int | str], data: object) -> str:
    """A location as people read it, counted from 1: `tree[2] 'oak': view[1].photo`."""
    text = ""
    for part in loc:
        try:
            data = data[part]  # type: ignore[index]
        except (TypeError, LookupError):
            data = None
        if isinstance(part, str):
            text += (" " if text.endswith(":") else "." if text else "") + shortened(part)
            continue
        text += f"[{part + 1}]"
        if isinstance(data, dict) and isinstance(data.get("name"), str):
            text += f" {quoted(data['name'])}:"
    return text.removesuffix(":")


def suggestion(wrong: str, known: Iterable[object]) -> str:
    """What to do about a word that is not known: `did you mean 'height'?`, or the known words."""
    words = [str(word) for word in known]
    near = get_close_matches(wrong[:80], words, n=1)
    return f"did you mean {quoted(near[0])}?" if near else f"known: {', '.join(words)}"


def shown(value: object) -> str:
    """A value as it stood in the file, on one line and not too long."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list) and len(value) > 4:
        return f"a list of {len(value)}"
    return shortened(one_line(str(value) if isinstance(value, int | float) else repr(value)))


def quoted(word: str) -> str:
    """A word in quotes, on one line and not too long."""
    return f"'{shortened(one_line(word))}'"


def one_line(text: str) -> str:
    """Text without line ends, control characters and runs of blanks."""
    return " ".join(printable(text).split())


def printable(text: str) -> str:
    """Text with a blank for each control character."""
    return "".join(c if c.isprintable() else " " for c in text)


def shortened(text: str, length: int = 60) -> str:
    return text if len(text) <= length else text[: length - 3] + "..."
