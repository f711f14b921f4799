"""Collected warnings of the libraries that read logs, for a line to the user or a refusal."""

from __future__ import annotations

import contextlib
import io
import logging
import warnings
from collections.abc import Iterator

# Warnings about code, not about the file.
OF_CODE = (DeprecationWarning, PendingDeprecationWarning, FutureWarning, ResourceWarning)


class _Kept(logging.Handler):
    """Collects a library's log messages from level warning on."""

    def __init__(self, notes: list[str]) -> None:
        super().__init__(logging.WARNING)
        self.notes = notes

    def emit(self, record: logging.LogRecord) -> None:
        self.notes.append(record.getMessage())


@contextlib.contextmanager
def kept_warnings(notes: list[str]) -> Iterator[None]:
    """Collect in `notes` all that libraries warn of, log or print in the context, a line each.

    Warnings about code, such as deprecations, are left out.
    """
    said, keeper = io.StringIO(), _Kept(notes)
    loggers = [logging.getLogger(), *map(logging.getLogger, logging.root.manager.loggerDict)]
    before = [each.handlers for each in loggers]
    for logger in loggers:  # instead of their own handlers, which may write to the terminal
        logger.handlers = [keeper] if logger is loggers[0] or not logger.propagate else []
    try:
        with (
            warnings.catch_warnings(record=True, action="always") as caught,
            contextlib.redirect_stdout(said),
            contextlib.redirect_stderr(said),
        ):
            yield
    finally:
        for logger, handlers in zip(loggers, before, strict=True):
            logger.handlers = handlers
        notes += [str(each.message) for each in caught if not issubclass(each.category, OF_CODE)]
        notes += said.getvalue().splitlines()
