"""What strangers send besides broken files: values of options, environments, limits of the shell, odd texts."""

from __future__ import annotations

import random
import re
from collections.abc import Callable

from mutations import BYTES

Random = random.Random

TEXTS = (
    *("", " ", "-", "--", "-1", "0", "1e3", "nan", "inf", "1e400", "9" * 40, "0x10", "\u0663", "1_0", "true", "null"),
    *(
        "a=b",
        "=",
        "=x",
        "x=",
        "a=b=c",
        "@",
        "@absent",
        "@.",
        ",",
        ",,",
        "1,2",
        "1,2,3",
        "nan,0,0",
        "1e30,0,0",
        ";",
        "'",
    ),
    *(
        '"',
        "\\",
        "$(x)",
        "`x`",
        "%s",
        "{0}",
        "{",
        "*",
        "?",
        "[",
        "~",
        "~nobody/x",
        "#",
        "é",
        "\u65e5\u672c",
        "\U0001f600",
    ),
    *("a\nb", "a\tb", "a\rb", "\x1b[31mred", "\x1b]0;title\x07", "\x7f", "\x85", "\x9b31m", "\u202eabc", "\u2066a"),
    *("a\u200bb", "\u2028", "\u2029", "\ufeff", "\u0301", "\udcff", "\udce9t\udce9", "a\u0000b".replace("\0", "\x01")),
    *(
        "x" * 300,
        "y" * 5000,
        "(" * 3000,
        "not " * 2000,
        "a and " * 3000 + "a",
        "class",
        "None",
        "__import__",
        "../..",
        ".",
    ),
    *("http://example.org/x#y", "knowrob:Cup", "knowrob:", ":", "::", "<", "<http://", "near", "in reach of", "all"),
)
PATHS = (
    *("absent", "absent/absent.omn", ".", "..", "/", "", "-", "folder", "folder/", "empty", "/dev/null", "/dev/full"),
    *(
        "loop",
        "dangling",
        "n" * 255,
        "n" * 256,
        "n" * 300 + ".omn",
        "/".join(["d" * 200] * 30),
        "a\nb.omn",
        "\x1b[31m.omn",
    ),
    *(
        "\u202etxt.omn",
        "\udcff.omn",
        "é.omn",
        " .omn",
        "drink.omn/",
        "drink.omn/x",
        "http://example.org/x.owl",
        "file:///x",
    ),
    *("/proc/self/mem", "/proc/self/maps", "socket", "text.txt", "noise.bin", "zeros.bin", "deep.json", "bom.omn"),
    *(
        "utf16.omn",
        "latin1.omn",
        "drink.omn",
        "drink.owl",
        "room.omn",
        "world.urdf",
        "own.toml",
        "drink.py",
        "drink.jsonl",
    ),
    *(
        "sweep.jsonl",
        "kb.sqlite",
        "grid.yaml",
        "cloud.pcd",
        "own.urdf",
        "arm.stl",
        "out.png",
        "out.txt",
        "out",
        "out.svg",
    ),
)
NUMBERS = (
    "0",
    "-1",
    "1",
    "2",
    "1e-300",
    "1e-9",
    "1e9",
    "1e308",
    "1e400",
    "-0.0",
    "nan",
    "inf",
    "-inf",
    "",
    "x",
    "9" * 25,
)

ENVIRONMENTS: dict[str, tuple[str | None, ...]] = {
    "HOME": (None, "", "/proc/absent", "relative", "/dev/null", "{folder}/empty", "/proc", "\udcff"),
    "TMPDIR": ("", "/proc/absent", "/dev/null", "{folder}/empty", "relative", "/proc", "{folder}/\u202e", "\udcff"),
    "XDG_CACHE_HOME": (
        None,
        "",
        "/proc/absent",
        "/dev/null",
        "{folder}/empty",
        "relative",
        "/proc",
        "{folder}/" + "n" * 300,
    ),
    "XDG_CONFIG_HOME": ("/proc/absent", "/dev/null", ""),
    "XDG_RUNTIME_DIR": ("/proc/absent", ""),
    "LANG": (None, "", "C", "POSIX", "de_DE.UTF-8", "ja_JP.eucJP", "absent", "\udcff"),
    "LC_ALL": (None, "", "C", "POSIX", "C.UTF-8", "de_DE.UTF-8", "absent", "tr_TR"),
    "LC_NUMERIC": ("de_DE.UTF-8", "absent"),
    "LANGUAGE": ("de:fr", "\udcff"),
    "TZ": ("", "absent", "UTC-25", ":/dev/null"),
    "TERM": ("", "dumb", "absent", "xterm-256color", "\x1b"),
    "COLUMNS": ("", "0", "1", "-5", "x", "99999999"),
    "LINES": ("", "0", "1", "-5", "x"),
    "NO_COLOR": ("", "1"),
    "FORCE_COLOR": ("1",),
    "TERMINAL_WIDTH": ("0", "x", "-1"),
    "PYTHONIOENCODING": ("ascii", "latin-1", "utf-16", "utf-8:strict", "ascii:strict"),
    "PYTHONUTF8": ("0", "1"),
    "PYTHONCOERCECLOCALE": ("0",),
    "PYTHONHASHSEED": ("0", "1", "12345"),
    "PYTHONOPTIMIZE": ("1", "2"),
    "PYTHONDONTWRITEBYTECODE": ("1",),
    "PYTHONWARNINGS": ("error::DeprecationWarning", "always", "default"),
    "PYTHONDEVMODE": ("1",),
    "PYTHONUNBUFFERED": ("1",),
    "PYTHONSAFEPATH": ("1",),
    "PYTHONPATH": ("/proc/absent", "{folder}", ""),
    "PYTHONTRACEMALLOC": ("1",),
    "PYTHONNOUSERSITE": ("1",),
    "HTTP_PROXY": (
        "http://127.0.0.1:1",
        "socks5://127.0.0.1:1",
        "socks://127.0.0.1:1",
        "x",
        "http://",
        "http://a:b#c@h:1",
    ),
    "http_proxy": ("http://127.0.0.1:99999", "http://[::1", "ftp://127.0.0.1:1", "127.0.0.1:1", "\x1b"),
    "HTTPS_PROXY": ("http://127.0.0.1:1", "://", "http://u:p@"),
    "ALL_PROXY": ("socks5://127.0.0.1:1", "socks5h://127.0.0.1:1", "socks4://x:1", "socks://127.0.0.1:1", "http://x:y"),
    "NO_PROXY": ("*", "127.0.0.1", "[::1]", "localhost,127.0.0.0/8,::1", "[::1", "\u202e", "a b", ".example.org:80"),
    "SSL_CERT_FILE": ("/proc/absent", "{folder}", "{folder}/noise.bin", "", "/dev/null", "/proc/self/mem"),
    "SSL_CERT_DIR": ("/proc/absent", "{folder}/empty", "{folder}/text.txt", ""),
    "REQUESTS_CA_BUNDLE": ("/proc/absent",),
    "SSLKEYLOGFILE": ("/proc/absent/x", "{folder}"),
    "PLANLANG_SERVER": (
        "",
        "x",
        "http://",
        "http://[::1",
        "http://127.0.0.1:99999",
        "http://ex ample",
        "http://\u202e.org",
    ),
    "PLANLANG_KEY": ("", "x", "a\nb", "\udcff", "k" * 600),
    "OPENBLAS_NUM_THREADS": ("0", "-1", "x", "1000"),
    "OMP_NUM_THREADS": ("0", "x"),
    "PATH": ("", "/proc/absent"),
    "ROS_PACKAGE_PATH": ("/proc/absent", ":", "{folder}"),
    "JAVA_HOME": ("/proc/absent",),
    "BROWSER": ("absent", "/dev/null"),
    "DISPLAY": ("", ":99", "absent"),
}
"""Values of variables; None: the variable is not set. ``{folder}`` stands for the folder of the case."""

LIMITS: dict[str, tuple[int, ...]] = {
    "v": (200_000, 250_000, 320_000, 350_000, 450_000, 600_000, 900_000, 1_500_000),
    "t": (1, 2, 3, 5, 100),
    "n": (10, 12, 16, 20, 24, 32, 64),
    "f": (0, 1, 4, 16, 64, 1024),
    "s": (256, 512, 1024, 4096, 65536),
    "u": (1, 2, 5, 20, 60),
}
"""Options of ``ulimit`` and their values; -f counts blocks of 1,024 bytes here, as bash does."""

_NUMBER = re.compile(rb"-?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][\w.-]*")
_ATTRIBUTE = re.compile(rb"\s[\w:]+\s*=\s*(?:\"[^\"]*\"|'[^']*')")
_VALUE = re.compile(rb"(?<=[=:,\[(\s])(?:\"[^\"\n]*\"|-?\d[\d.eE+-]*|true|false|null)")
_ELEMENT = re.compile(rb"<(\w+)\b[^<>]*(?:/>|>[^<>]*</\1\s*>)")
OTHER = (
    b"null",
    b"true",
    b"[]",
    b"{}",
    b'""',
    b"[1, 2]",
    b'{"a": 1}',
    b"-1",
    b"1e400",
    b'"\\u001b[31m"',
    b"[[[[]]]]",
    b"'",
)


def _replaced(draw: Random, content: bytearray, pattern: re.Pattern[bytes], put: Callable[[bytes], bytes]) -> None:
    found = [match.span() for match in pattern.finditer(bytes(content))]
    if found:
        begin, end = draw.choice(found)
        content[begin:end] = put(bytes(content[begin:end]))


def number(draw: Random, content: bytearray, other: bytes) -> None:
    _replaced(draw, content, _NUMBER, lambda _: draw.choice(NUMBERS).encode())


def word(draw: Random, content: bytearray, other: bytes) -> None:
    words = _WORD.findall(bytes(content))
    if words:
        _replaced(draw, content, _WORD, lambda _: bytes(draw.choice(words)))


def text(draw: Random, content: bytearray, other: bytes) -> None:
    odd = draw.choice(TEXTS).encode(errors="surrogateescape")
    _replaced(draw, content, _WORD, lambda old: old + odd if draw.random() < 0.5 else odd)


def no_attribute(draw: Random, content: bytearray, other: bytes) -> None:
    _replaced(draw, content, _ATTRIBUTE, lambda _: b"")


def no_element(draw: Random, content: bytearray, other: bytes) -> None:
    _replaced(draw, content, _ELEMENT, lambda _: b"")


def two_elements(draw: Random, content: bytearray, other: bytes) -> None:
    _replaced(draw, content, _ELEMENT, lambda old: old * draw.choice((2, 2, 40)))


def other_value(draw: Random, content: bytearray, other: bytes) -> None:
    _replaced(draw, content, _VALUE, lambda _: draw.choice(OTHER))


def no_line(draw: Random, content: bytearray, other: bytes) -> None:
    lines = content.split(b"\n")
    del lines[draw.randrange(len(lines))]
    content[:] = b"\n".join(lines)


def byte_order_mark(draw: Random, content: bytearray, other: bytes) -> None:
    content[0:0] = draw.choice((b"\xef\xbb\xbf", b"\xff\xfe", b"\xfe\xff"))


def other_encoding(draw: Random, content: bytearray, other: bytes) -> None:
    changed = content.decode(errors="replace").encode(draw.choice(("utf-16", "utf-32", "latin-1")), errors="replace")
    content[:] = changed


STRUCTURES = (
    *(number, number, number, word, word, text, text, no_attribute, no_attribute, no_element, no_element, two_elements),
    *(other_value, other_value, other_value, no_line, no_line, byte_order_mark, other_encoding),
)


def broken(draw: Random, content: bytes, other: bytes) -> tuple[bytes, tuple[str, ...]]:
    """A broken version of any file, and the names of what was done to it."""
    changed = bytearray(content)
    steps = [draw.choice(STRUCTURES if draw.random() < 0.75 else BYTES) for _ in range(draw.choice((1, 1, 1, 2, 3)))]
    for step in steps:
        step(draw, changed, other)
    return bytes(changed), tuple(step.__name__ for step in steps)
