"""The error of an expectation that cannot be judged."""

from __future__ import annotations


class UnjudgedError(Exception):
    """Why a figure is not available."""
