"""Numbers of random examples that tests try: two fifths in the suite, all of them by ``make test-long``."""

import os


def examples(number: int) -> int:
    """Return how many are tried where the long form tries ``number``; ten at least."""
    return max(min(number, 10), number * int(os.environ.get("PLANLANG_EXAMPLES", "2000")) // 5000)
