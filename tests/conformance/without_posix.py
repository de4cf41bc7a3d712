"""Run `ahgateway` as on a system without POSIX modules: `python without_posix.py COMMAND …`; `--walk`; `--import NAME`.

Nothing of ours may import what Windows lacks, and each of our modules sees `sys.platform` as it is there. The other
half of pyserial and `msvcrt`, which Windows has, are stand-ins here.
"""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import importlib.util
import os
import pkgutil
import sys
import types
from collections.abc import Sequence

MISSING = frozenset({"fcntl", "termios", "grp", "pwd", "resource", "tty", "pty", "syslog", "posix_ipc"})
STAND_INS = {
    "serial.serialposix": """
from serial.serialutil import SerialException

class Serial:
    def __init__(self, port, **settings):
        self.port = port

    def open(self):
        reason = "FileNotFoundError(2, 'The system cannot find the file specified.', None, 2)"
        raise SerialException(f"could not open port {self.port!r}: {reason}")

class PosixPollSerial(Serial):
    pass

class VTIMESerial(Serial):
    pass
"""
}
"""Source of what stands in for a module; a machine without serial ports."""
LINUX = sys.platform


class WindowsSys(types.ModuleType):
    """`sys` with another platform."""

    platform = "win32"

    def __getattr__(self, name: str) -> object:
        return getattr(sys, name)


class Loader(importlib.abc.Loader):
    """Runs a module of ours with the platform of Windows, any other with that of this machine."""

    def __init__(self, inner: importlib.abc.Loader, name: str) -> None:
        self._inner = inner
        self._is_ours = name.split(".")[0] == "ahgateway"

    def __getattr__(self, name: str) -> object:
        return getattr(self._inner, name)

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> types.ModuleType | None:
        return self._inner.create_module(spec)

    def exec_module(self, module: types.ModuleType) -> None:
        before, sys.platform = sys.platform, "win32" if self._is_ours else LINUX
        try:
            self._inner.exec_module(module)
        finally:
            sys.platform = before
        if self._is_ours and module.__dict__.get("sys") is sys:
            module.__dict__["sys"] = WindowsSys("sys")


class Finder(importlib.abc.MetaPathFinder):
    """Finds what Windows has, and nothing else."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: types.ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        if name in MISSING:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        if name in STAND_INS:
            return importlib.util.spec_from_loader(name, StandIn(STAND_INS[name]))
        spec = importlib.machinery.PathFinder.find_spec(name, path, target)
        if spec is not None and isinstance(spec.loader, importlib.machinery.SourceFileLoader):
            spec.loader = Loader(spec.loader, name)
        return spec


class StandIn(importlib.abc.Loader):
    """A module whose source stands above."""

    def __init__(self, source: str) -> None:
        self._source = source

    def exec_module(self, module: types.ModuleType) -> None:
        exec(self._source, module.__dict__)


def install() -> None:
    """Take away what Windows lacks; what the interpreter itself has loaded already stays with the interpreter."""
    import asyncio  # noqa: F401  its own half for this system
    import subprocess  # noqa: F401

    msvcrt = types.ModuleType("msvcrt")
    msvcrt.LK_NBLCK = 2  # type: ignore[attr-defined]
    msvcrt.locking = lambda descriptor, mode, count: None  # type: ignore[attr-defined]
    sys.modules["msvcrt"] = msvcrt
    for name in MISSING:
        sys.modules.pop(name, None)
    sys.meta_path.insert(0, Finder())


def walk() -> int:
    """Import every module of ours; return how many there are."""
    import ahgateway

    names = [found.name for found in pkgutil.walk_packages(ahgateway.__path__, "ahgateway.")]
    for name in names:
        if not name.endswith("__main__"):
            __import__(name)
    return len(names)


def main() -> None:
    sys.path[0] = os.getcwd()
    install()
    if sys.argv[1:] == ["--walk"]:
        sys.stdout.write(f"{walk()} modules\n")
        return
    if sys.argv[1:2] == ["--import"]:
        __import__(sys.argv[2])
        return
    from ahgateway.cli.main import main as run

    run()


if __name__ == "__main__":
    main()
