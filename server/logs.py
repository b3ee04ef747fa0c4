"""What the server writes down of its work: lines for a person, or JSON objects for a machine, with job and request."""

from __future__ import annotations

import json
import logging
import sys
from contextvars import ContextVar
from datetime import UTC, datetime

FORMATS = ("text", "json")
LEVELS = ("debug", "info", "warning", "error")

#: The job and the request that the running task works for.
job: ContextVar[str] = ContextVar("job", default="")
request: ContextVar[str] = ContextVar("request", default="")


def write(format: str, level: str) -> None:
    """Write log lines of a level and above to stderr, in one of FORMATS."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(Lines() if format == "json" else Text())
    logging.basicConfig(level=level.upper(), handlers=[handler], force=True)


def _context(record: logging.LogRecord) -> dict[str, str]:
    return {key: value for key, value in (("job", job.get()), ("request", request.get())) if value}


class Text(logging.Formatter):
    """One line a record: time, level, logger, message, then job and request; control characters escaped."""

    def format(self, record: logging.LogRecord) -> str:
        context = "".join(f" {key}={value}" for key, value in _context(record).items())
        message = record.getMessage().encode("unicode_escape").decode("ascii")
        line = f"{_time(record)} {record.levelname} {record.name}: {message}{context}"
        return line + (f"\n{self.formatException(record.exc_info)}" if record.exc_info else "")


class Lines(logging.Formatter):
    """One JSON object a line: time, level, logger, message, job, request, what the record adds, and the traceback."""

    def format(self, record: logging.LogRecord) -> str:
        told: dict[str, object] = {
            "time": _time(record),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        told |= _context(record) | getattr(record, "fields", {})
        if record.exc_info:
            told["traceback"] = self.formatException(record.exc_info)
        return json.dumps(told, default=str)


def _time(record: logging.LogRecord) -> str:
    return datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
