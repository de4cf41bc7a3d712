"""Where compiled laws are kept between runs: the user's cache folder, which may be emptied at any time."""

from __future__ import annotations

import shutil

KEPT_MAX = 4
"""Versions of the laws of which the compiled form is kept."""


def keep_compiled() -> None:
    """Keep compiled laws in the user's cache folder; a folder that cannot be written to keeps none."""
    from platformdirs import user_cache_path

    from ahgateway.core.kept import keep_in

    folder = user_cache_path("ahgateway", appauthor=False) / "laws"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        versions = sorted(folder.iterdir(), key=lambda each: each.stat().st_mtime)
    except OSError:
        return
    for old in versions[: -2 * KEPT_MAX]:
        shutil.rmtree(old, ignore_errors=True)
    keep_in(str(folder))
