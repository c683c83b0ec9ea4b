"""Many clients of one server at a time, who read and write as they like; what was accepted is remembered."""

from __future__ import annotations

import random
import threading
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field

import httpx

from planlang.files import Bundled

RECIPE = Bundled.RECIPE.find("serve_a_drink").read_text()
LABEL = '"serve a drink"'
QUESTION = {"expression": "ServingFoodOrDrink and subAction some Reaching", "limit": 20}


@dataclass
class Traffic:
    """Requests of clients, and their answers."""

    answers: Counter[tuple[str, int]] = field(default_factory=Counter)
    """Call and status -> how often."""
    times: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    """Call -> seconds of each, sorted at the end."""
    written: dict[str, str] = field(default_factory=dict)
    """Address of an entry -> its content as it was last accepted."""

    @property
    def failures(self) -> dict[tuple[str, int], int]:
        """Answers that no client should ever be given."""
        return {asked: number for asked, number in self.answers.items() if asked[1] >= 500 or asked[1] in (400, 404)}

    def lost(self, url: str) -> list[str]:
        """Return the addresses of entries that a server does not give as they were accepted."""
        with httpx.Client(base_url=url) as client:
            found = ((path, client.get(f"{path}/content").text) for path in self.written)
            return [path for path, text in found if text != self.written[path]]


def traffic(url: str, key: str, clients: int, seconds: float, seed: int = 0) -> Traffic:
    """Let a number of clients ask a server for some time, each one question after the other."""
    whole, lock = Traffic(), threading.Lock()
    until = time.monotonic() + seconds

    def ask(number: int) -> None:
        chance = random.Random(seed * 1000 + number)
        headers = {"Authorization": f"Bearer {key}"}
        with httpx.Client(base_url=url, headers=headers, timeout=120) as client:
            one = _Client(client, number, chance, whole, lock)
            while time.monotonic() < until:
                one.ask()

    threads = [threading.Thread(target=ask, args=(number,)) for number in range(clients)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for times in whole.times.values():
        times.sort()
    return whole


class _Client:
    def __init__(
        self, client: httpx.Client, number: int, chance: random.Random, whole: Traffic, lock: threading.Lock
    ) -> None:
        self._client, self._number, self._chance = client, number, chance
        self._whole, self._lock = whole, lock
        self._own: list[str] = []

    def ask(self) -> None:
        calls = {self._create: 10, self._change: 10, self._rate: 5, self._search: 35, self._read: 20, self._news: 20}
        call = self._chance.choices(list(calls), list(calls.values()))[0] if self._own else self._create
        start = time.monotonic()
        status = call().status_code
        with self._lock:
            self._whole.answers[call.__name__[1:], status] += 1
            self._whole.times[call.__name__[1:]].append(time.monotonic() - start)

    def _text(self) -> str:
        return RECIPE.replace(LABEL, f'"serve drink {self._chance.random()}"')

    def _create(self) -> httpx.Response:
        name, text = f"c{self._number}n{len(self._own)}", self._text()
        answer = self._client.post("/v1/recipes", params={"name": name}, content=text)
        if answer.status_code == 201:
            self._own.append(answer.headers["Location"])
            self._whole.written[self._own[-1]] = text
        return answer

    def _change(self) -> httpx.Response:
        path, text = self._chance.choice(self._own), self._text()
        tag = self._client.get(path).headers["ETag"]
        answer = self._client.put(f"{path}/content", content=text, headers={"If-Match": tag})
        if answer.status_code == 200:
            self._whole.written[path] = text
        return answer

    def _rate(self) -> httpx.Response:
        path = self._chance.choice(list(self._whole.written))
        return self._client.put(f"{path}/rating", json={"rating": self._chance.randrange(11)})

    def _search(self) -> httpx.Response:
        return self._client.get("/v1/search", params=QUESTION)

    def _read(self) -> httpx.Response:
        return self._client.get(f"{self._chance.choice(list(self._whole.written))}/content")

    def _news(self) -> httpx.Response:
        return self._client.get("/v1/news", params={"after": self._chance.randrange(100), "limit": 20})
