"""Many clients at a time: nobody is failed, and what was accepted is there."""

from __future__ import annotations

from pathlib import Path

import pytest
from many_clients import traffic

from tests.support.servers import running_server


@pytest.mark.long
def test_many_clients_are_answered_and_what_was_accepted_is_readable(tmp_path: Path) -> None:
    with running_server(tmp_path / "kb.sqlite") as server:
        found = traffic(server.url, server.key("ada"), clients=12, seconds=2.0)
        assert found.failures == {}
        assert found.written  # on a busy machine some are told to come back later
        assert found.lost(server.url) == []
    with running_server(tmp_path / "kb.sqlite") as again:
        assert found.lost(again.url) == []
