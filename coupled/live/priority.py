"""The first place on the machine for the thread that flies, where the system grants it.

Other work at a deadline is what makes a frame late. Under Linux a thread of the class SCHED_FIFO
runs before all ordinary ones; root may ask for it, and whoever has a limit `rtprio`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

PRIORITY = 40  # of 1 to 99: before all ordinary work, after the kernel's own interrupts at 50


@contextmanager
def first_place(wanted: bool = True) -> Iterator[bool]:
    """Give this thread real-time priority within, and tell whether the system granted it.

    Threads that it starts meanwhile, as the page's, run as ordinary ones.
    """
    if sys.platform != "linux" or not wanted:
        yield False
        return
    was, parameter = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        own_only = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, own_only, os.sched_param(PRIORITY))
    except OSError:
        yield False
        return
    try:
        yield True
    finally:
        os.sched_setscheduler(0, was, parameter)
