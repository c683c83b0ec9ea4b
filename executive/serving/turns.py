"""Turns at what takes long to compute: checks of uploads, conversions, comparisons with robots.

Python computes one thing at a time: the more of these share its time, the longer everybody waits who only reads.
"""

from __future__ import annotations

import threading

TURNS = threading.Semaphore(2)
"""Held while something long is computed."""
MOST_THREADS = 200
"""Requests that are worked on at a time, those among them that wait for their turn."""
