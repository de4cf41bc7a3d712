"""What a person means by a moment of a recording: seconds from its start, or a date and time."""

from __future__ import annotations

from datetime import UTC, datetime

from ahgateway.clock import SECOND
from ahgateway.errors import ProfileError


def moment_ns(text: str, option: str, start_ns: int) -> int:
    """Return the moment in ns UTC.

    Args:
        text: `12.5` seconds from the start, or `2026-11-22T03:04:05.250`, UTC unless it says otherwise.
        option: Its name in messages.
        start_ns: UTC of the recording's first row.

    Raises:
        ProfileError: It is neither.
    """
    try:
        return start_ns + round(float(text) * SECOND)
    except (ValueError, OverflowError):
        pass
    try:
        return utc_ns(datetime.fromisoformat(text))
    except ValueError:
        raise ProfileError(
            f"`{text}` is no moment",
            key=option,
            hint="seconds from the start, 12.5, or UTC, 2026-11-22T03:04:05",
        ) from None


def utc_ns(moment: datetime) -> int:
    """Return a date and time in ns since 1970, to the microsecond; without a zone it is UTC."""
    aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    span = aware - datetime(1970, 1, 1, tzinfo=UTC)
    return (span.days * 86_400 + span.seconds) * SECOND + span.microseconds * 1000
