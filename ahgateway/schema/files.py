"""Where the files stand that a person writes or that we ship, and how their text becomes tables."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from ahgateway.errors import ProfileError
from ahgateway.schema.findings import near

_PLACE = re.compile(r"(.*?)\s*\(at (?:line (\d+), column (\d+)|end of document)\)$", re.DOTALL)


def shipped() -> Path:
    """Directory of the shipped profiles: inside the package when installed, beside it in a checkout."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "profiles"
    return inside if inside.is_dir() else package.parent / "profiles"


def names(folder: Path) -> list[str]:
    """Names of the TOML files in a folder, sorted."""
    return sorted(path.stem for path in folder.glob("*.toml"))


def find(name_or_path: str, folder: Path, what: str, beside: Path | None = None) -> Path:
    """Return the file that a person means.

    Args:
        name_or_path: Path of a file, or the bare name of a shipped one; a path wins.
        folder: Where the shipped ones stand.
        what: What it is, for the message.
        beside: Directory to which a relative path refers; None: the working directory.

    Raises:
        ProfileError: There is neither; the message lists what is shipped.
    """
    path = Path(name_or_path) if beside is None else beside / name_or_path
    if path.is_file():
        return path
    known = names(folder)
    if name_or_path in known:
        return folder / f"{name_or_path}.toml"
    reason = "is a directory" if path.is_dir() else "is no file and no shipped name"
    raise ProfileError(
        f"`{name_or_path}` {reason}; shipped {what}: {', '.join(known)}",
        hint=near(Path(name_or_path).stem, known),
    )


def read(path: Path, file: str) -> str:
    """Return the text of a file; a byte order mark, as Windows editors write it, is taken off.

    Raises:
        ProfileError: It cannot be read, or is no UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ProfileError(
            f"byte {error.start} is no UTF-8", file=file, hint="save the file with the encoding UTF-8"
        ) from error
    except OSError as error:
        raise ProfileError(f"cannot be read: {error.strerror}", file=file) from error


def tables(text: str, file: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Raises:
        ProfileError: It is no TOML; the message starts with file, line and column.
    """
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        match = _PLACE.match(str(error))
        message = match[1] if match else str(error)
        line, column = (match[2], match[3]) if match and match[2] else (len(text.splitlines()), 1)
        raise ProfileError(
            f"{message[:1].lower()}{message[1:]}",
            file=f"{file}:{line}:{column}",
            hint="this line, or the one before it, is no TOML",
        ) from error
