"""What is raised where an expectation cannot be judged."""

from __future__ import annotations


class UnjudgedError(Exception):
    """Why a figure could not be had."""
