"""Real-time priority for the flight's thread, if the system grants it.

Other work of the machine delays frames. Under Linux a thread of the class SCHED_FIFO runs before
all ordinary ones; root and users with a limit `rtprio` may request it.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

PRIORITY = 40  # of 1 to 99: above all ordinary work, below the kernel's interrupts at 50


@contextmanager
def real_time_priority(wanted: bool = True) -> Iterator[bool]:
    """Give this thread real-time priority in the context; yield whether the system granted it.

    Threads started in the context, such as the page's, run with ordinary priority.
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
