"""Real time by the wall clock: how late steps are, and how long a thread's post takes to reach the plan.

The one measurement that needs a real clock; takes about five seconds. Tests use clocks of their own.
"""

from __future__ import annotations

import statistics
import threading
import time
from functools import partial

from planlang import Fluent, RealTimeHost, pursue, run, sleep, wait_for

POSTS = 200


def main() -> None:
    """Print medians and maxima in microseconds."""
    late: list[float] = []

    async def ticks() -> None:
        start = time.monotonic()
        for tick in range(1, 481):
            await sleep(1 / 240)
            late.append(time.monotonic() - start - tick / 240)

    run(ticks, host=RealTimeHost())

    host = RealTimeHost()
    value = Fluent(0)
    sent: list[float] = []
    heard: list[float] = []

    def feed() -> None:
        with host.source("thread") as source:
            for number in range(1, POSTS + 1):
                time.sleep(0.01)
                sent.append(time.monotonic())
                source.post(value.set, number)

    async def listens() -> None:
        for number in range(1, POSTS + 1):
            await wait_for(value >= number)
            heard.append(time.monotonic())

    thread = threading.Thread(target=feed)
    thread.start()
    run(partial(pursue, listens, partial(sleep, 60)), host=host)
    thread.join()
    for what, times in (
        ("late per step", late),
        ("thread to plan", [b - a for a, b in zip(sent, heard, strict=True)]),
    ):
        print(f"{what:15} median {statistics.median(times) * 1e6:7.0f} us   max {max(times) * 1e6:7.0f} us")


if __name__ == "__main__":
    main()
