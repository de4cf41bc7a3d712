"""What is wrong with a file of the user's: collected one by one, reported all together.

Also the one place where pydantic's errors become sentences of ours.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from ahgateway.errors import ProfileError


class Findings:
    """Errors of one file in the order in which they were found; the same sentence about the same key counts once."""

    def __init__(self, file: str) -> None:
        self.file = file
        self._errors: dict[tuple[str, str], ProfileError] = {}

    def add(self, key: str, message: str, hint: str | None = None) -> None:
        """Keep an error about the dotted `key`."""
        self._errors.setdefault((key, message), ProfileError(message, file=self.file, key=key or None, hint=hint))

    def add_all(self, error: ValidationError, form: type[BaseModel]) -> None:
        """Keep every error that pydantic found while it read `form`."""
        for each in error.errors(include_url=False):
            location = each["loc"]
            message, hint = _sentence(each, form)
            self.add(dotted(location), message, hint)

    def has(self, key: str) -> bool:
        """Tell whether something was found at this very key."""
        return any(found == key for found, _ in self._errors)

    def __bool__(self) -> bool:
        return bool(self._errors)

    def __iter__(self) -> Iterator[ProfileError]:
        return iter(self._errors.values())

    def raise_any(self) -> None:
        """Raise what was found: one error as it is, several as one that lists them all."""
        errors = list(self)
        if len(errors) == 1:
            raise errors[0]
        if errors:
            raise joined(self.file, errors)


def joined(file: str, errors: list[ProfileError]) -> ProfileError:
    """Make one error of several: a line each, its hint below it."""
    lines = [f"{len(errors)} errors"]
    for error in errors:
        lines.append(f"  {error.message.removeprefix(f'{file}: ')}")
        if error.hint:
            lines.append(f"    hint: {error.hint}")
    return ProfileError("\n".join(lines), file=file)


def near(name: str, known: Iterable[str]) -> str | None:
    """Return a hint that names the nearest known name, None when none is near."""
    names = {each.lower(): each for each in known}
    found = get_close_matches(name.lower(), names, 1, 0.5)
    return f"did you mean `{names[found[0]]}`?" if found else None


def shown(value: object) -> str:
    """Return a value as TOML writes it."""
    try:
        return json.dumps(value, ensure_ascii=False)
    except (TypeError, ValueError):
        return str(value)


def dotted(location: tuple[int | str, ...]) -> str:
    """Return the dotted path of a key, a list's element by its number from 0."""
    return ".".join(str(part) for part in location)


def _sentence(error: Any, form: type[BaseModel]) -> tuple[str, str | None]:
    kind, value, context = error["type"], error["input"], error.get("ctx", {})
    if kind == "extra_forbidden":
        known = list(_fields(form, error["loc"][:-1]))
        return f"unknown key, known here are {', '.join(known)}", near(str(error["loc"][-1]), known)
    if kind == "missing":
        return "is missing", None
    if kind == "literal_error":
        allowed = context["expected"].replace(" or ", ", ").replace("'", "").split(", ")
        hint = near(value, allowed) if isinstance(value, str) else None
        return f"{shown(value)} is not known, allowed are {', '.join(allowed)}", hint
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        keys = ", ".join(_fields(form, error["loc"]))
        return f"{shown(value)} stands where a table belongs", f"its keys are {keys}" if keys else None
    if kind == "list_type" and isinstance(value, Mapping):
        return "is one table, and a list of tables belongs here", f"head each with [[{_heading(error['loc'])}]]"
    if kind in ("float_type", "int_type") and isinstance(value, str):
        return f"{shown(value)} is text, and a number belongs here", "leave out the quotes, and any unit"
    sentence = str(error["msg"]).removeprefix("Value error, ").removeprefix("Input ")
    return f"{shown(value)} {sentence}", None


def _fields(form: type[BaseModel], location: tuple[int | str, ...]) -> Iterable[str]:
    """Keys of the table at `location`, found by walking the forms."""
    here: Any = form
    for part in location:
        if isinstance(here, type) and issubclass(here, BaseModel):
            named = {field.alias or name: field for name, field in here.model_fields.items()}
            if part not in named:
                return ()
            here = _form_in(named[str(part)].annotation)
        else:
            here = _form_in((get_args(here) or (None,))[-1])
    if not (isinstance(here, type) and issubclass(here, BaseModel)):
        return ()
    return [field.alias or name for name, field in here.model_fields.items()]


def _heading(location: tuple[int | str, ...]) -> str:
    return ".".join(str(part) for part in location if isinstance(part, str))


def _form_in(annotation: Any) -> Any:
    """The form, or the mapping or list of forms, in an annotation that may also allow None."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in get_args(annotation):
        if isinstance(argument, type) and issubclass(argument, BaseModel):
            return argument if annotation_is_optional(annotation) else annotation
    return annotation


def annotation_is_optional(annotation: Any) -> bool:
    """Tell `Form | None` from `dict[str, Form]`."""
    return type(None) in get_args(annotation)


def pruned(data: Mapping[str, Any], error: ValidationError) -> dict[str, Any]:
    """Return the data without what pydantic rejected, so that the rest can be judged too.

    A key that is wrong goes; of a table in which a key is missing the whole entry of `loops` goes.
    """
    copy: dict[str, Any] = json_like(data)
    for each in error.errors(include_url=False):
        location = list(each["loc"])
        if each["type"] == "missing":
            location = location[:2] if location[0] == "loops" else location[:-1]
        _remove(copy, location)
    return copy


def json_like(value: Any) -> Any:
    """Copy tables and lists, keep everything else."""
    if isinstance(value, Mapping):
        return {key: json_like(each) for key, each in value.items()}
    if isinstance(value, list):
        return [json_like(each) for each in value]
    return value


def _remove(data: Any, location: list[int | str]) -> None:
    """Delete the entry at `location`, or the innermost table around it that exists."""
    for part in location[:-1]:
        if isinstance(data, dict) and isinstance(data.get(part), dict):
            data = data[part]
        elif isinstance(data, dict):
            data.pop(part, None)
            return
        else:
            return
    if isinstance(data, dict) and location:
        data.pop(location[-1], None)
