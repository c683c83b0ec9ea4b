"""Proxies and certificates that the environment states: which are used, and what is said of unusable ones."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from planlang.diagnostics import BadInput
from planlang.knowledge.answers import NoAnswer
from planlang.knowledge.client import Client
from planlang.knowledge.network import proxy_of
from planlang.knowledge.refusals import client_of, diagnostics_of
from tests.support.refusals import refusal

VARIABLES = ("http_proxy", "https_proxy", "all_proxy", "no_proxy", "SSL_CERT_FILE", "SSL_CERT_DIR", "SSLKEYLOGFILE")


@pytest.fixture(autouse=True)
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    """No variable of the tester's own."""
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
        monkeypatch.delenv(name.upper(), raising=False)


def closed_port() -> int:
    """A port of this machine where nobody answers."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
    return port


@pytest.mark.parametrize(
    ("variable", "value", "advice"),
    [
        ("ALL_PROXY", "socks://127.0.0.1:1080", "use http://, https:// or socks5://"),
        ("ALL_PROXY", "socks4://127.0.0.1:1080", "use http://, https:// or socks5://"),
        ("http_proxy", "ftp://127.0.0.1:1", "use http://, https:// or socks5://"),
        ("http_proxy", "http://ada:pass#word@127.0.0.1:1", "write # in a password as %23"),
        ("HTTP_PROXY", "http://127.0.0.1:99999", "write it as http://HOST:PORT"),
        ("HTTP_PROXY", "http://[::1", "write it as http://HOST:PORT"),
        ("HTTP_PROXY", "http://", "write it as http://HOST:PORT"),
        ("HTTP_PROXY", "http://a..b:1", "write it as http://HOST:PORT"),
        ("HTTP_PROXY", "http://a b:1", "write it as http://HOST:PORT"),
        ("HTTP_PROXY", "\x1b[31m", "write it as http://HOST:PORT"),
    ],
)
def test_an_unusable_proxy_is_bad_input_that_names_the_variable(
    variable: str, value: str, advice: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(variable, value)
    with pytest.raises(BadInput) as caught:
        client_of("http://kb.example.org")
    (found,) = caught.value.diagnostics
    assert found.code == "K048"
    assert variable in found.message
    assert "word" not in str(found).partition("help:")[0], "a password is not shown"
    assert found.help is not None
    assert found.help.startswith(advice)
    assert "add kb.example.org to NO_PROXY" in found.help


def test_socks_without_its_package_is_bad_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ALL_PROXY", "socks5://127.0.0.1:1080")
    monkeypatch.setattr("planlang.knowledge.network.find_spec", lambda _: None)
    with refusal("K048", naming=("ALL_PROXY", "socksio")):
        client_of("http://kb.example.org")


@pytest.mark.parametrize(
    ("url", "listed"),
    [
        ("http://kb.example.org:8080", "example.org"),
        ("http://kb.example.org", "localhost, .example.org"),
        ("http://kb.example.org", "*.example.org"),
        ("http://kb.example.org:8080", "example.org:8080"),
        ("http://KB.Example.Org.", "kb.example.org"),
        ("http://127.0.0.1:8080", "127.0.0.1"),
        ("http://127.0.0.1:8080", "127.0.0.0/8"),
        ("http://[::1]:8080", "[::1]"),
        ("http://[::1]:8080", "::1"),
        ("http://[::1]:8080", "[::1]:8080"),
        ("http://[fe11::2]:8080", "fe11::/16"),
        ("http://127.0.0.1:8080", "localhost,127.0.0.1,::1,[::1]"),
        ("http://kb.example.org", "*"),
    ],
)
def test_a_listed_host_is_reached_without_the_proxy_however_bad_that_is(url: str, listed: str) -> None:
    assert proxy_of(url, {"ALL_PROXY": "socks://127.0.0.1:1", "NO_PROXY": listed}) is None


@pytest.mark.parametrize(
    ("url", "listed"),
    [
        ("http://kb.example.org", "ample.org"),
        ("http://kb.example.org", "example.org:8080"),
        ("http://10.0.0.1", "127.0.0.0/8"),
        ("http://kb.example.org", ", [::1 ,"),
        ("http://kb.example.org", "[::1]"),
    ],
)
def test_other_hosts_are_reached_through_it(url: str, listed: str) -> None:
    proxy = proxy_of(url, {"http_proxy": "127.0.0.1:3128", "HTTP_PROXY": "http://x:1", "no_proxy": listed})
    assert proxy is not None
    assert (proxy.url, proxy.variable) == ("http://127.0.0.1:3128", "http_proxy")


def test_a_proxy_without_a_scheme_is_one_of_http() -> None:
    proxy = proxy_of("http://kb.example.org", {"ALL_PROXY": "127.0.0.1:7890"})
    assert proxy is not None
    assert proxy.url == "http://127.0.0.1:7890"


def test_a_proxy_that_does_not_answer_is_blamed_and_not_the_server(monkeypatch: pytest.MonkeyPatch) -> None:
    port = closed_port()
    monkeypatch.setenv("HTTP_PROXY", f"http://ada:secret@127.0.0.1:{port}")
    with Client("http://kb.example.org", sleep=lambda _: None) as client, pytest.raises(NoAnswer) as caught:
        client.news(0)
    (found,) = diagnostics_of("http://kb.example.org", caught.value)
    assert found.message.startswith(f"the proxy 127.0.0.1:{port} (HTTP_PROXY) does not answer")
    assert found.help is not None
    assert "NO_PROXY" in found.help


@pytest.mark.parametrize(
    ("variable", "make"),
    [
        ("SSL_CERT_FILE", lambda folder: folder / "absent.pem"),
        ("SSL_CERT_FILE", lambda folder: folder),
        ("SSL_CERT_FILE", lambda folder: folder / "garbage.pem"),
        ("SSL_CERT_FILE", lambda folder: folder / "empty.pem"),
        ("SSL_CERT_DIR", lambda folder: folder / "absent"),
        ("SSL_CERT_DIR", lambda folder: folder / "empty.pem"),
        ("SSLKEYLOGFILE", lambda folder: folder / "absent" / "log"),
    ],
)
def test_unusable_certificates_are_bad_input_for_an_encrypted_server_alone(
    variable: str, make: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "garbage.pem").write_bytes(bytes(range(256)))
    (tmp_path / "empty.pem").write_bytes(b"")
    monkeypatch.setenv(variable, str(make(tmp_path)))  # type: ignore[operator]
    if variable == "SSLKEYLOGFILE":  # read with certificates of one's own only
        monkeypatch.setenv("SSL_CERT_DIR", str(tmp_path))
    client_of("http://kb.example.org").close()
    with pytest.raises(BadInput) as caught:
        client_of("https://kb.example.org")
    (found,) = caught.value.diagnostics
    assert (found.code, variable in found.message) == ("K048", True)


@pytest.mark.parametrize("url", ["http://kb.example.org:99999", "http://kb.example.org:0", "http://a..b", "http://h:x"])
def test_an_address_that_cannot_be_is_bad_input(url: str) -> None:
    with refusal("K030"):
        client_of(url)
