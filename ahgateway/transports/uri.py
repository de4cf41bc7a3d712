"""What a target is: one URI that holds every parameter of a link, and the link that it names.

    modbus+tcp://192.0.2.10:502?unit=1
    modbus+rtu:///dev/ttyUSB0?baud=115200&parity=E     modbus+rtu://COM3?baud=19200
    modbus+ascii:///dev/ttyUSB0                        (Delta's factory setting: 9600 7E1)
    modbus+rtu+tcp://192.0.2.20:4001                   modbus+ascii+tcp://192.0.2.20:4001
    canopen://socketcan/can0?node=3                    fake://PROFILE   replay://FILE

Source: MANUAL serial defaults, spec ah500 §3.4; RTU's own default of 8E1 is the Modbus serial line guide's, §3.3.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl, unquote, urlsplit

from ahgateway.clock import Clock
from ahgateway.codec.can_objects import CanMap
from ahgateway.codec.station import Pacing
from ahgateway.errors import ProfileError, StateError
from ahgateway.transports.base import Link, Tap

if TYPE_CHECKING:
    from ahgateway.transports.line import Line

MODBUS_TCP_PORT = 502
SPEED_MAX = 1e6
"""Fastest replay that is still paced."""


@dataclass(frozen=True, slots=True)
class Target:
    """A parsed target.

    Attributes:
        text: The URI as the user gave it.
        scheme: In lower case, `modbus+tcp`.
        host: Host or CAN interface, empty where the scheme has none.
        port: TCP port, None where the scheme has none.
        path: Serial port, CAN channel, profile or recording, empty where the scheme has none.
        options: The rest, checked: every name is one that the scheme knows.
    """

    text: str
    scheme: str
    host: str = ""
    port: int | None = None
    path: str = ""
    options: Mapping[str, str] = field(default_factory=dict)

    @property
    def unit(self) -> int | None:
        """Modbus station number of `?unit=`, None when it is not given."""
        return int(self.options["unit"]) if "unit" in self.options else None

    def whole(self, name: str, default: int) -> int:
        """Return option `name` as the whole number that `parse_uri` has checked."""
        return int(self.options.get(name, default))


@dataclass(frozen=True, slots=True)
class _Scheme:
    shape: str
    has_host: bool = False
    has_path: bool = False
    port: int | None = None
    wants_port: bool = False
    options: Mapping[str, Callable[[str], str]] = field(default_factory=dict)


def _whole(minimum: int, maximum: int) -> Callable[[str], str]:
    def check(text: str) -> str:
        if not text.isascii() or not text.isdigit() or not minimum <= int(text) <= maximum:
            return f"a whole number {minimum}…{maximum}"
        return ""

    return check


def _one_of(*names: str) -> Callable[[str], str]:
    def check(text: str) -> str:
        return "" if text.upper() in names else "one of " + ", ".join(names)

    return check


def _speed(text: str) -> str:
    try:
        is_legal = 0.0 < float(text) <= SPEED_MAX
    except ValueError:
        is_legal = False
    return "" if is_legal else f"a number above 0, at most {SPEED_MAX:g}; without it as fast as it goes"


_LINE = {
    "unit": _whole(1, 247),
    "baud": _whole(300, 4_000_000),
    "parity": _one_of("N", "E", "O"),
    "bits": _one_of("7", "8"),
    "stop": _one_of("1", "2"),
}
_CONVERTER = {"unit": _whole(1, 247)}
_SCHEMES = {
    "modbus+tcp": _Scheme(
        "modbus+tcp://HOST[:PORT][?unit=N]", has_host=True, port=MODBUS_TCP_PORT, options={"unit": _whole(0, 255)}
    ),
    "modbus+rtu": _Scheme("modbus+rtu:///dev/ttyUSB0?baud=115200&parity=E", has_path=True, options=_LINE),
    "modbus+ascii": _Scheme("modbus+ascii://COM3?baud=9600&parity=E&bits=7", has_path=True, options=_LINE),
    "modbus+rtu+tcp": _Scheme("modbus+rtu+tcp://HOST:PORT", has_host=True, wants_port=True, options=_CONVERTER),
    "modbus+ascii+tcp": _Scheme("modbus+ascii+tcp://HOST:PORT", has_host=True, wants_port=True, options=_CONVERTER),
    "canopen": _Scheme(
        "canopen://INTERFACE/CHANNEL?node=N",
        has_host=True,
        has_path=True,
        options={
            "node": _whole(1, 127),
            "bitrate": _whole(10_000, 1_000_000),
            "settle_ms": _whole(0, 10_000),
            "pdo": _whole(0, 1),
        },
    ),
    "fake": _Scheme("fake://PROFILE", has_path=True),
    "replay": _Scheme("replay://FILE[?speed=N]", has_path=True, options={"speed": _speed}),
}


def parse_uri(text: str) -> Target:
    """Return the parts of a target.

    Raises:
        ProfileError: With key `target`: what is wrong, what is allowed, the nearest legal name.
    """
    scheme_name, colon, rest = text.partition("://")
    scheme_name = scheme_name.lower()
    if not colon:
        raise _wrong(f"`{text}` has no scheme", "a target looks like modbus+tcp://192.0.2.10:502?unit=1")
    scheme = _SCHEMES.get(scheme_name)
    if scheme is None:
        raise _wrong(
            f"scheme `{scheme_name}` in `{text}` is not one of {', '.join(_SCHEMES)}", _nearest(scheme_name, _SCHEMES)
        )
    if not scheme.has_host:
        path, _, query = rest.partition("?")
        target = Target(text, scheme_name, path=unquote(path), options=_options(text, scheme_name, scheme, query))
        if not target.path:
            raise _wrong(f"`{text}` names nothing behind ://", f"it looks like {scheme.shape}")
        return target
    host, port, path, query = _authority(text, scheme)
    if scheme.has_path and not path:
        raise _wrong(f"`{text}` has no channel", f"it looks like {scheme.shape}")
    if path and not scheme.has_path:
        raise _wrong(
            f"`{text}` has a path `/{path}`, which {scheme_name} does not know", f"it looks like {scheme.shape}"
        )
    return Target(text, scheme_name, host, port, path, _options(text, scheme_name, scheme, query))


def _authority(text: str, scheme: _Scheme) -> tuple[str, int | None, str, str]:
    try:
        parts = urlsplit(text)
        port = parts.port
    except ValueError as error:
        raise _wrong(f"`{text}`: {error}", f"it looks like {scheme.shape}") from error
    if not parts.hostname:
        raise _wrong(f"`{text}` has no host", f"it looks like {scheme.shape}")
    if scheme.wants_port and port is None:
        raise _wrong(f"`{text}` has no port", "converters have no usual one; see the converter's settings")
    if port == 0:
        raise _wrong(f"`{text}`: port 0 cannot be connected to", "ports are 1…65535")
    return parts.hostname, port if port is not None else scheme.port, unquote(parts.path.lstrip("/")), parts.query


def _options(text: str, name: str, scheme: _Scheme, query: str) -> dict[str, str]:
    options: dict[str, str] = {}
    for key, value in parse_qsl(query, keep_blank_values=True):
        check = scheme.options.get(key)
        if check is None:
            allowed = ", ".join(scheme.options) or "none"
            raise _wrong(
                f"option `{key}` in `{text}` is not known to {name}, which has {allowed}", _nearest(key, scheme.options)
            )
        if key in options:
            raise _wrong(f"option `{key}` stands twice in `{text}`", "say it once")
        wanted = check(value)
        if wanted:
            raise _wrong(f"option `{key}` in `{text}` is `{value}`, wanted {wanted}", None)
        options[key] = value.upper() if key == "parity" else value
    if name == "modbus+rtu" and options.get("bits") == "7":
        raise _wrong(f"`{text}` asks for 7 data bits, RTU needs 8", "a line with 7E1 speaks ASCII: modbus+ascii://…")
    return options


def _nearest(name: str, names: Mapping[str, object]) -> str | None:
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    return f"did you mean `{near[0]}`?" if near else None


def _wrong(message: str, hint: str | None) -> ProfileError:
    return ProfileError(message, key="target", hint=hint)


def open_link(
    target: Target, clock: Clock, pacing: Pacing | None = None, tap: Tap | None = None, *, can: CanMap | None = None
) -> Link:
    """Return the link that `target` names; it connects when it is first used.

    Args:
        target: What to open.
        clock: Times of replies.
        pacing: How politely.
        tap: Gets every frame.
        can: Which CANopen object holds which devices; only canopen needs it.

    Raises:
        StateError: The scheme is known, but this program has no link of that kind to open.
    """
    pacing = pacing or Pacing()
    if target.scheme == "modbus+tcp":
        from ahgateway.transports.tcp import TcpLink

        return TcpLink(target.host, target.port or MODBUS_TCP_PORT, clock=clock, pacing=pacing, tap=tap)
    if target.scheme in ("modbus+rtu+tcp", "modbus+ascii+tcp"):
        return _converter_link(target, clock, pacing, tap)
    if target.scheme in ("modbus+rtu", "modbus+ascii"):
        return _serial_link(target, clock, pacing, tap)
    if target.scheme == "canopen":
        from ahgateway.transports.can.opening import can_link

        return can_link(target, can, clock, pacing, tap)
    raise StateError(
        f"`{target.text}`: {target.scheme} links are not part of this version",
        hint="give a target of another kind, such as modbus+tcp:// or modbus+rtu://",
    )


def _converter_link(target: Target, clock: Clock, pacing: Pacing, tap: Tap | None) -> Link:
    from ahgateway.transports.ascii import AsciiReplies
    from ahgateway.transports.rtu import RtuReplies
    from ahgateway.transports.tcp import TcpLink

    framing = RtuReplies if target.scheme == "modbus+rtu+tcp" else AsciiReplies
    return TcpLink(
        target.host, target.port or 0, clock=clock, pacing=pacing, tap=tap, framing=framing, scheme=target.scheme
    )


def _serial_link(target: Target, clock: Clock, pacing: Pacing, tap: Tap | None) -> Link:
    from ahgateway.transports.ascii import AsciiReplies
    from ahgateway.transports.rtu import RtuReplies
    from ahgateway.transports.serial_link import SerialLink

    framing = RtuReplies if target.scheme == "modbus+rtu" else AsciiReplies
    return SerialLink(line_of(target), clock=clock, pacing=pacing, tap=tap, framing=framing, scheme=target.scheme)


def line_of(target: Target) -> Line:
    """Return port and settings of a `modbus+rtu://` or `modbus+ascii://` target, defaults filled in."""
    from ahgateway.transports.line import Line

    return Line(
        target.path,
        baud=target.whole("baud", 9600),
        parity=target.options.get("parity", "E"),
        bits=target.whole("bits", 8 if target.scheme == "modbus+rtu" else 7),
        stop=target.whole("stop", 1),
    )
