"""What no later step needs is searched for within a share."""

from __future__ import annotations

from collections.abc import Iterator

from executive.ahead.spent import AT_FIRST, MOST_BATCHES, Share


def batches() -> Iterator[str | None]:
    """A search without end that finds something in each batch."""
    while True:
        yield "path"
        yield None


def test_a_share_is_used_up_by_batches_and_by_the_starts_of_searches_until_it_is_renewed() -> None:
    share = Share()
    assert list(share.within(iter(["path"]))) == ["path"]
    assert list(share.within(batches())).count(None) == MOST_BATCHES - 2 * AT_FIRST
    assert share.is_used_up
    assert list(share.within(batches())) == []
    share.renew()
    assert not share.is_used_up
