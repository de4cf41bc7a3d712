"""The whole exception tree. A difference between PLC and reference is a verdict, never an exception.

AhGatewayError
├── ProfileError                      a file of the user's: which file, which key
├── TransportError
│   ├── LinkError (ConnectionError)       nothing there, or it went away
│   ├── ReplyTimeoutError (TimeoutError)  the line is there, the answer is not
│   └── FrameError                        bytes that are no legal frame
├── PlcRefusedError                   the PLC answered no: Modbus exception or SDO abort
├── CodecError (ValueError)           words that are no legal value, a device outside the map
└── StateError                        asked for something that this state does not allow
"""

from __future__ import annotations


class AhGatewayError(Exception):
    """Anything that can go wrong outside our own code.

    Args:
        message: One sentence without a full stop: where, what, both values, the limit.
        hint: What the reader can do about it, or nothing.
    """

    def __init__(self, message: str, *, hint: str | None = None) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def add(self, text: str) -> None:
        """Say also what came of it."""
        self.message = f"{self.message}; {text}"
        self.args = (self.message,)


class ProfileError(AhGatewayError):
    """A file of the user's is wrong.

    Args:
        message: What is wrong, with the value found and what is allowed.
        file: Path of the file as the user gave it.
        key: Dotted path of the table and key, `loops.TIC101.operands.SV`.
        hint: What to do.
    """

    def __init__(
        self, message: str, *, file: str | None = None, key: str | None = None, hint: str | None = None
    ) -> None:
        where = ": ".join(part for part in (file, key) if part)
        super().__init__(f"{where}: {message}" if where else message, hint=hint)
        self.file = file
        self.key = key


class TransportError(AhGatewayError):
    """The way to the PLC failed; the target stands in the message."""


class LinkError(TransportError, ConnectionError):
    """Nothing there, or it went away: refused, reset, closed, unplugged."""


class ReplyTimeoutError(TransportError, TimeoutError):
    """No answer within the deadline."""


class FrameError(TransportError):
    """Bytes that are no legal frame, or a frame that is not the answer to our request."""


class PlcRefusedError(AhGatewayError):
    """The PLC answered no.

    Args:
        message: Which request, where.
        code: The exception or abort code.
        hint: What this code usually means here.
    """

    def __init__(self, message: str, *, code: int, hint: str | None = None) -> None:
        super().__init__(message, hint=hint)
        self.code = code


class CodecError(AhGatewayError, ValueError):
    """Words that are no legal value, or a device that the map does not have."""


class StateError(AhGatewayError):
    """Asked for something that this state does not allow; the state stays as it is."""
