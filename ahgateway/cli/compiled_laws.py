"""Compiled laws kept from one run to the next, so that a law is compiled once on a machine and not at every start.

This file alone decides where they are kept, the user's cache folder, which may be emptied at any time, and when a kept
one may be used again: what is compiled, and every constant of the core that it can name, must be the same to the last
character.
"""

from __future__ import annotations

import hashlib
import shutil
import types
from collections.abc import Iterable, Iterator
from functools import lru_cache, partial
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from pickle import PickleError
from typing import Any

KEPT_MAX = 4
"""Versions of the laws of which the compiled form is kept."""

WITHOUT_ARITHMETIC = ("dialect_axes.py",)
"""Files of the core that decide no bit of a law."""

DAMAGED = (OSError, EOFError, ValueError, TypeError, LookupError, AttributeError, ImportError, PickleError)
"""What reading a file that was cut or written by something else can raise."""


def keep_compiled() -> None:
    """Keep compiled laws in the user's cache folder; a folder that cannot be written to keeps none."""
    from platformdirs import user_cache_path

    from ahgateway.core.compiling import keep_with

    folder = user_cache_path("ahgateway", appauthor=False) / "laws"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        versions = sorted(folder.iterdir(), key=lambda each: each.stat().st_mtime)
    except OSError:
        return
    for old in versions[: -2 * KEPT_MAX]:
        shutil.rmtree(old, ignore_errors=True)
    keep_with(partial(keep, folder))


def keep(folder: Path, dispatcher: Any, functions: Iterable[Any]) -> None:
    """Let a function that numba compiles be kept, if the folder can be written to.

    Args:
        folder: Where compiled laws are kept.
        dispatcher: What numba's `njit` gave, not compiled yet.
        functions: Every function that is compiled with it, as it stands in Python.
    """
    import numba
    from numba.core import caching

    # numba says little of its types.
    config: Any = numba.config
    base: Any = caching.FunctionCache

    class Kept(base):  # type: ignore[misc]
        """A cache that is never the reason why something fails."""

        def load_overload(self, sig: Any, target_context: Any) -> Any:
            try:
                return super().load_overload(sig, target_context)
            except DAMAGED:
                # The law is compiled anew.
                return None

        def save_overload(self, sig: Any, data: Any) -> None:
            try:
                super().save_overload(sig, data)
            except OSError:
                # A full or write-protected disk costs time alone.
                return

    place = folder / _fingerprint(functions)
    before = config.CACHE_DIR
    config.CACHE_DIR = str(place)
    try:
        place.mkdir(parents=True, exist_ok=True)
        cache: Any = Kept
        kept = cache(dispatcher.py_func)
    except (OSError, RuntimeError):
        # No folder that can be written to.
        return
    finally:
        config.CACHE_DIR = before
    # Where numba cannot write it looks for a place of its own, in which one law would be taken for another.
    if Path(kept.cache_path).is_relative_to(place):
        dispatcher._cache = kept


def _fingerprint(functions: Iterable[Any]) -> str:
    """What these functions are, constants included: another law, or another version of it, has another."""
    digest = hashlib.sha256(_sources())
    for function in sorted(functions, key=lambda each: (each.__module__, each.__qualname__)):
        digest.update(repr(_shape(function.__code__)).encode())
    return digest.hexdigest()[:20]


def _shape(code: types.CodeType) -> tuple[Any, ...]:
    """A function's code but for where it stands."""
    consts = [_shape(each) if isinstance(each, types.CodeType) else repr(each) for each in code.co_consts]
    return code.co_code, code.co_names, code.co_varnames, consts


@lru_cache(maxsize=1)
def _sources() -> bytes:
    """The text of the whole core."""
    return b"\n".join(_texts(files("ahgateway.core")))


def _texts(folder: Traversable) -> Iterator[bytes]:
    for each in sorted(folder.iterdir(), key=lambda each: each.name):
        if each.is_dir():
            yield from _texts(each)
        elif each.name.endswith(".py") and each.name not in WITHOUT_ARITHMETIC:
            yield each.name.encode() + each.read_bytes()
