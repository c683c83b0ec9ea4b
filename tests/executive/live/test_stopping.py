"""Stop of the page ends a run wherever it was started."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import threading
from pathlib import Path
from urllib.request import Request, urlopen

import pytest

CHECKOUT = Path(__file__).resolve().parents[3]
IGNORING = """import os, signal, sys
signal.signal({}, signal.SIG_IGN)
os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"""


def _post(address: str, command: str) -> None:
    origin = address.rpartition("/")[0].rpartition("/")[0]
    urlopen(Request(f"{address}command", json.dumps({"command": command}).encode(), {"Origin": origin}), timeout=30)


@pytest.mark.parametrize("ignored", ["signal.SIGINT", "signal.SIGHUP"])
def test_stop_ends_a_run_that_a_script_started_in_the_background(tmp_path: Path, ignored: str) -> None:
    """A shell without job control starts commands in the background with SIGINT ignored, nohup with SIGHUP."""
    command = [sys.executable, "-c", IGNORING.format(ignored), "-m", "executive", "run", "serve_a_drink", "--watch"]
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
    run = subprocess.Popen([*command, "--trace", "run.jsonl"], cwd=tmp_path, env=environment, text=True, stderr=-1)
    try:
        assert run.stderr is not None
        found = re.search(r"http://127\.0\.0\.1:\d+/\S+/", run.stderr.readline())
        assert found is not None
        news = urlopen(f"{found[0]}news", timeout=60)  # the first browser starts the run
        read = threading.Thread(target=news.read, daemon=True)
        read.start()
        _post(found[0], "pause")
        _post(found[0], "stop")
        assert run.wait(120) == 130
    finally:
        run.kill()
        run.communicate()
    records = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    assert "interrupted" in [one["event"] for one in records], "the plan was ended with its cleanups"
    resume = [sys.executable, "-m", "executive", "run", "--resume", "run.jsonl"]
    assert subprocess.run(resume, cwd=tmp_path, env=environment, capture_output=True).returncode == 0
