"""Signs for consoles that lack ours: each has a stand-in of the same width that every console can show.

A console of Windows may have the code page 437, 850 or 1252; what its encoding holds stays as it is.
"""

from __future__ import annotations

import codecs
import sys
from functools import lru_cache

UNKNOWN = "?"
HANDLER = "ahgateway-signs"

STAND_INS: dict[str, str] = {
    **dict.fromkeys("│┃║╎╏▏▎▍▌▐▕▊▉╷╵╽╿", "|"),
    **dict.fromkeys("─━═╌╍┄┅▁▔▂╴╶╸╺╼╾⎯–—−", "-"),
    **dict.fromkeys("┌┐└┘├┤┬┴┼╭╮╰╯╔╗╚╝╠╣╦╩╬┏┓┗┛┣┫┳┻╋▗▖▘▝", "+"),
    **dict.fromkeys("█▓▇▆▅▀▄■▪", "#"),
    **dict.fromkeys("░▒▃", "."),
    **dict.fromkeys("•●·∙◆✓", "*"),
    **dict.fromkeys("→»›▶", ">"),
    **dict.fromkeys("←«‹◀", "<"),
    "≠": "!",
    "≈": "~",
    "≤": "<",
    "≥": ">",
    "×": "x",
    "…": "~",
    "°": "o",
    "σ": "s",
    "Δ": "d",
    "τ": "t",
    "µ": "u",
    "μ": "u",
    "²": "2",
    "³": "3",
    "↑": "^",
    "↓": "v",
    "⚠": "!",
    "’": "'",
    "‘": "'",
    "“": '"',
    "”": '"',
    "\u00a0": " ",
    "\u2800": " ",
}
"""Sign to its stand-in; a Braille sign with dots is a `*`."""


def is_legacy(encoding: str) -> bool:
    """Tell whether a console of this encoding cannot show everything."""
    return not encoding.lower().replace("_", "-").startswith(("utf", "cp65001", "u8"))


@lru_cache(4096)
def stand_in(sign: str, encoding: str) -> str:
    """Return a sign that the encoding holds: the sign itself where it does."""
    try:
        sign.encode(encoding)
    except UnicodeEncodeError:
        return STAND_INS.get(sign, "*" if "⠀" < sign <= "⣿" else UNKNOWN)
    return sign


@lru_cache(4096)
def shown_in(text: str, encoding: str) -> str:
    """Return a text with stand-ins for what the encoding lacks; its length stays the same."""
    if text.isascii():
        return text
    return "".join(stand_in(sign, encoding) for sign in text)


def _replaced(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    lacking = error.object[error.start : error.end]
    return "".join(stand_in(sign, error.encoding) for sign in lacking), error.end


def teach_streams() -> None:
    """Let stdout and stderr write stand-ins instead of failing where their encoding lacks a sign."""
    codecs.register_error(HANDLER, _replaced)
    for stream in (sys.stdout, sys.stderr):
        encoding = getattr(stream, "encoding", None)
        if encoding and is_legacy(encoding) and hasattr(stream, "reconfigure"):
            stream.reconfigure(errors=HANDLER)
