"""Pages in a real Chromium, with everything that happens in them."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from extras import chromium


@contextmanager
def started_browser(*arguments: str) -> Iterator[Any]:
    """Start a Chromium, with further arguments; the test is skipped where there is none."""
    path = chromium()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=path, args=_words(arguments))
        yield started
        started.close()


@contextmanager
def another_browser(browser: Any, *arguments: str) -> Iterator[Any]:
    """Start one with other arguments beside a browser, whose driver it shares."""
    started = browser.browser_type.launch(executable_path=chromium(), args=_words(arguments))
    yield started
    started.close()


def _words(arguments: tuple[str, ...]) -> list[str]:
    sandbox = ["--no-sandbox"] if os.geteuid() == 0 else []  # Chromium refuses its sandbox to root
    return [*sandbox, *arguments]


class Watched:
    """A page of a browser, and everything that its console said; drivers of graphics that are slow do not count."""

    def __init__(self, browser: Any, url: str | None = None, **options: Any) -> None:
        self.said: list[str] = []
        self.asked: list[str] = []
        """Addresses that the page has asked for, but for files."""
        self.page = browser.new_context(base_url=url, **options).new_page()
        self.page.set_default_timeout(60_000)  # what is waited for comes, also on a busy machine
        self.page.on("console", lambda message: self._hear(message.text))
        self.page.on("pageerror", lambda problem: self.said.append(str(problem)))
        self.page.on("request", lambda request: self._ask(request.url))

    def _hear(self, text: str) -> None:
        if "GL Driver Message" not in text:
            self.said.append(text)

    def _ask(self, url: str) -> None:
        if not url.startswith("file:"):
            self.asked.append(url)

    def findings(self) -> list[str]:
        """Return what axe-core finds wrong with what is shown."""
        from axe_playwright_python.sync_playwright import Axe

        violations = Axe().run(self.page).response["violations"]
        return [f"{one['impact']} {one['id']}: {node['html']}" for one in violations for node in one["nodes"]]
