"""Attacks on whole commands: broken files, odd environments, arguments and limits, each in a process of its own.

A case is drawn from a seed and a number alone. What it may end in: exit 0, 1, 2, 3 or 130; 71 where its environment or
limits lack something, and the signal of a limit of time that it has.
"""

from __future__ import annotations

import contextlib
import os
import random
import re
import resource
import shlex
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import nasty

ROOT = Path(__file__).resolve().parents[2]
PARTS = ("files", "arguments", "environments", "limits")
_SHARES = (50, 25, 13, 12)
SECONDS = 20.0
"""Of computing without a word, or three times as long by the clock, until a command counts as hung."""
LONG = 40.0
"""Seconds of computing after which a command that says what it does is interrupted, and has to end then."""
MEGABYTES = 1500
_ADDRESSES = 6_000_000_000
"""Address space of a case without limits [bytes], so that it does not take the machine with it."""
_WRITING = ("convert", "merge")
"""Commands that write a file to stdout, which keeps its characters."""
_WAITING = ("serve", "watch", "--watch", "--gui")
_HIDDEN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff]")

LINES = """
compile {recipe}
compile {recipe} -o out.py --graph out.svg --scopes
compile {recipe} --graph out.dot --dataflow
compile {recipe} --graph out.mmd --modules stirring.py --trust
check {recipe}
check {recipe} --fix -o out.omn
check {recipe} --json
convert {recipe} --to turtle
convert {recipe} --to manchester -o out.omn
show {recipe}
show {recipe} -o out.svg
match {recipe} --robot amigo
match drink.omn --robot {robot}
run {recipe} --trace out.jsonl --robot amigo --environment room.omn
run {plan} --robot amigo --environment room.omn
run {plan} --set @bindings.txt --robot amigo --environment room.omn
run drink.omn --modules stirring.py --trust --robot amigo --environment room.omn
run drink.omn --resume {trace} --trace out.jsonl --robot amigo --environment room.omn
run drink.omn --robot amigo --environment {map}
run drink.omn --robot amigo --environment room.omn --world {map}
run drink.omn --robot amigo --environment room.omn --faults faults.toml
show {plan}
check {plan}
check {map}
check {map} --verbose
show {map}
show {map} -o out.png --view top
merge room.omn {map} -o out.omn
merge {map}
convert {map} --to manchester
locate near_the_table --environment {map} --robot own.toml
check {robot}
show {robot}
show {robot} -o out.png
robot inspect {robot}
robot make {urdf}
robot make {urdf} --srdf own.srdf -o out.toml
locate in_reach_of_the_bottle --robot {robot} --environment room.omn
run drink.omn --robot {robot} --environment room.omn
show {trace}
show {trace} -o out.html
report {trace} drink.omn --output out.html --robot amigo --environment room.omn
replay {trace} drink.omn
export {trace} --to neem -o out
export drink.jsonl --to neem --poses poses.jsonl -o out
sweep-table {sweep} --csv out.csv
sweep-merge {sweep} --out out.jsonl
sweep drink.omn --worlds 2 --processes 1 --out {sweep} --robot amigo --environment room.omn
sweep-table {sweep} sweep.jsonl --plot out.svg --report out.html --junit out.xml
compare drink.omn --worlds 1 --processes 1 --vary robot=amigo,own.toml --environment room.omn
why {trace} drink.omn --budget 1 --processes 1 --robot amigo --environment room.omn
serve --store {store} --new-key bob
serve --store {store} --drop-keys ada
enable drink.omn --robot amigo --from {store} --dry
enable ServingADrink --robot amigo --from {store} --store out
push {recipe} --kind recipe --name ward --to http://127.0.0.1:1 --key-file author.key
check stirring.py
"""
"""Command lines; words in braces are files of a kind, _ is a space."""

CHEAP = """
list robots
list classes bottle
list relations
faults gripper
new project out
new robot out --folder out
new plan out
search ServingFoodOrDrink --from http://127.0.0.1:1
pull drink.ward -o out --from http://127.0.0.1:1
rate drink.ward 8 --to http://127.0.0.1:1 --key-file author.key
delete drink.ward --from http://127.0.0.1:1 --key-file author.key
watch drink.ward --once --from http://127.0.0.1:1 --key-file author.key
serve --store out.sqlite --port 0
serve --store kb.sqlite --port 0 --access-log out.log
backup kb.sqlite out.sqlite
enable drink.omn --robot amigo --from http://127.0.0.1:1 --dry
run drink.omn --watch-tree --robot amigo --environment room.omn
run drink.omn --watch --robot amigo --environment room.omn
sweep drink.omn --worlds 1 --processes 1 --robot amigo --environment room.omn
run drink.omn --picture out.png --report out.html --seed 3 --robot amigo --environment room.omn
"""

KINDS: dict[str, tuple[str, ...]] = {
    "recipe": ("drink.omn", "drink.owl", "drink.ttl", "drink.nt", "drink.ofn", "fetch.owx", "soup.omn", "wipe.omn",
               "cabinet.omn"),
    "map": ("room.omn", "room.owl", "kitchen.omn", "world.urdf", "grid.yaml", "cloud.pcd", "binary.pcd", "cloud.ply",
            "cloud.xyz", "tree.bt"),
    "robot": ("own.toml", "own.toml", "amigo.toml"),
    "urdf": ("own.urdf", "amigo.urdf", "world.urdf"),
    "plan": ("drink.py",),
    "trace": ("drink.jsonl", "failed.jsonl"),
    "sweep": ("sweep.jsonl",),
    "store": ("kb.sqlite",),
}  # fmt: skip
BELOW: Mapping[str, tuple[str, ...]] = {
    "own.toml": ("own.toml", "own.urdf", "own.urdf", "own.urdf", "arm.stl"),
    "amigo.toml": ("amigo.toml", "amigo.urdf", "amigo.omn"),
    "world.urdf": ("world.urdf", "world.urdf", "world.toml", "lamp.obj"),
    "grid.yaml": ("grid.yaml", "grid.pgm"),
    "own.srdf": ("own.srdf",),
    "fetch.owx": ("fetch.owx", "fetch.owx", "catalog-v001.xml", "words.ofn"),
}
"""Files that are read for a file; one of them is broken."""


@dataclass(frozen=True)
class Case:
    """What is done: a command line in a folder of files, of which some are broken."""

    part: str
    seed: int
    number: int
    words: tuple[str, ...]
    files: Mapping[str, bytes] = field(default_factory=dict)
    steps: tuple[str, ...] = ()
    environment: Mapping[str, str | None] = field(default_factory=dict)
    limits: Mapping[str, int] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return f"{self.part}:{self.seed}:{self.number}"

    @property
    def waits(self) -> bool:
        """True if the command waits for others until it is interrupted."""
        return any(word in _WAITING for word in self.words)

    def line(self) -> str:
        """The command as a shell takes it, in the folder of the case."""
        unset = "".join(f"-u {name} " for name, value in self.environment.items() if value is None)
        stated = "".join(f"{n}={_quoted(v)} " for n, v in self.environment.items() if v is not None)
        limits = "".join(f"ulimit -{name} {value}; " for name, value in self.limits.items())
        words = " ".join(map(_quoted, self.words))
        return f"{limits}{f'env {unset}{stated}' if unset or stated else ''}planlang {words}"


def _quoted(text: str) -> str:
    if text.isprintable() and len(text) < 400:
        return shlex.quote(text)
    return f"$(python3 -c 'print({text!r})')" if len(text) < 400 else f"'{text[:60]!r} and {len(text) - 60} more'"


def case_of(part: str, seed: int, number: int, sources: Path) -> Case:
    """The case with this seed and number, whatever came before it."""
    draw = random.Random(f"{part}:{seed}:{number}")
    lines = LINES.split("\n")[1:-1]
    if part != "files":
        lines += CHEAP.split("\n")[1:-1]
    if part == "files":  # each kind as often as another, however many commands read it
        kind = f"{{{draw.choice(list(KINDS))}}}"
        lines = [line for line in lines if kind in line]
    words = [word.replace("_", " ") if word.count("_") > 1 else word for word in draw.choice(lines).split()]
    named = [draw.choice(KINDS[word[1:-1]]) if word.startswith("{") else word for word in words]
    if part == "files":
        return _broken_file(draw, seed, number, words, named, sources)
    if part == "arguments":
        return Case(part, seed, number, tuple(_arguments(draw, named)))
    if part == "environments":
        variables = draw.sample(list(nasty.ENVIRONMENTS), draw.choice((1, 1, 2, 3)))
        return Case(
            part, seed, number, tuple(named), environment={v: draw.choice(nasty.ENVIRONMENTS[v]) for v in variables}
        )
    limit = draw.choice(list(nasty.LIMITS))
    return Case(part, seed, number, tuple(named), limits={limit: draw.choice(nasty.LIMITS[limit])})


def _broken_file(draw: nasty.Random, seed: int, number: int, words: list[str], named: list[str], sources: Path) -> Case:
    of_a_kind = [name for word, name in zip(words, named, strict=True) if word.startswith("{")]
    others = [name for name in named if "." in name and (sources / name).is_file()]
    name = draw.choice(of_a_kind or others)
    if draw.random() < 0.1:
        name = draw.choice(others)
    name = draw.choice(BELOW.get(name, (name,)))
    other = (sources / draw.choice(sorted(path.name for path in sources.iterdir() if path.is_file()))).read_bytes()
    content, steps = nasty.broken(draw, (sources / name).read_bytes(), other)
    return Case("files", seed, number, tuple(named), {name: content}, (name, *steps))


def _arguments(draw: nasty.Random, words: list[str]) -> Iterator[str]:
    """The words with some replaced, and options of the command added."""
    from options import options_of

    options = options_of(words)
    given = list(words)
    kind = draw.random()
    places = [at for at in range(1, len(given)) if not given[at].startswith("-")]
    if kind < 0.35 and places:
        given[draw.choice(places)] = draw.choice(draw.choice((nasty.TEXTS, nasty.PATHS)))
    elif kind < 0.4 and places:
        del given[draw.choice(places)]
    for _ in range(draw.choice((0, 1, 1, 2, 3)) if kind < 0.4 else draw.choice((1, 1, 2, 3))):
        name, metavar, is_flag = draw.choice(options)
        if name in ("--help", "-h", "--gui"):
            continue
        given.append(name)
        if not is_flag:
            given.append(_value(draw, metavar))
    yield from (word.replace("\0", "\x01") for word in given)


def _value(draw: nasty.Random, metavar: str) -> str:
    pool = draw.random()
    if pool < 0.15:
        return draw.choice(draw.choice((nasty.TEXTS, nasty.PATHS, nasty.NUMBERS)))
    if any(word in metavar for word in ("FILE", "FOLDER", "DIR", "STORE", "MAP", "ROBOT", "URDF", "URL")):
        return draw.choice(nasty.PATHS)
    if "|" in metavar and pool < 0.7:
        return draw.choice(metavar.strip("<>[]{}").split("|"))
    return draw.choice(nasty.NUMBERS if metavar in ("N", "S", "MB", "K") or "x" in metavar else nasty.TEXTS)


@dataclass
class Running:
    """A case that runs: its process, since when, and when it was heard last."""

    case: Case
    folder: Path
    began: float
    heard: float
    said: int = 0
    used_when_heard: float = 0.0
    interrupted: float | None = None
    problem: str | None = None


@dataclass(frozen=True)
class Outcome:
    case: Case
    problem: str | None
    seconds: float
    megabytes: int
    said: str


class Runner:
    """Starts cases in processes forked from this one, which has imported the commands; watches and judges them."""

    def __init__(self, sources: Path, folder: Path) -> None:
        self.sources, self.folder = sources, folder
        self._running: dict[int, Running] = {}

    def __len__(self) -> int:
        return len(self._running)

    def prepare(self, case: Case) -> Path:
        """Make the folder of a case; returns it."""
        folder = self.folder / case.name.replace(":", "-")
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self.sources, folder, symlinks=True, ignore=lambda *_: ["socket"])
        for name, content in case.files.items():
            (folder / name).write_bytes(content)
        return folder

    def start(self, case: Case) -> None:
        folder = self.prepare(case)
        for stream in ("out", "err"):
            Path(f"{folder}.{stream}").write_bytes(b"")
        sys.stdout.flush()
        sys.stderr.flush()
        process = os.fork()
        if process == 0:
            _child(case, folder, self.folder / "cache")
        now = time.monotonic()
        self._running[process] = Running(case, folder, now, now)

    def prepared(self, line: str) -> None:
        """Run a command line in the folder of the sources, which has to end well."""
        process = os.fork()
        if process == 0:
            _child(Case("sources", 0, 0, tuple(line.split())), self.sources, self.folder / "cache")
        _, status = os.waitpid(process, 0)
        said = Path(f"{self.sources}.err").read_text()
        if os.waitstatus_to_exitcode(status) != 0:
            raise RuntimeError(f"planlang {line}: {said}")

    def wait(self) -> Outcome:
        """Watch what runs until one of the cases has ended."""
        while True:
            for process, one in list(self._running.items()):
                ended, status, used = os.wait4(process, os.WNOHANG)
                if ended == 0:
                    self._watch(process, one)
                    continue
                del self._running[process]
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.killpg(process, signal.SIGKILL)  # what it left behind
                return _judged(one, status, used)
            time.sleep(0.02)

    def _watch(self, process: int, one: Running) -> None:
        now, used = time.monotonic(), _cpu_time(process)
        said = sum(os.path.getsize(f"{one.folder}.{stream}") for stream in ("out", "err"))
        if said != one.said:
            one.heard, one.said, one.used_when_heard = now, said, used
        if one.interrupted is not None:
            if now - one.interrupted > 3 * SECONDS:
                one.problem = one.problem or "it does not end when it is interrupted"
                os.killpg(process, signal.SIGKILL)
        elif used - one.used_when_heard > SECONDS or (now - one.heard > 3 * SECONDS and not one.case.waits):
            one.problem = f"hang: {used:.0f} s of computing, {now - one.began:.0f} s by the clock"
            os.killpg(process, signal.SIGKILL)
        elif used > LONG or (one.case.waits and now - one.began > 5 and used < 0.5 * (now - one.began)):
            one.interrupted = now
            os.kill(process, signal.SIGINT)


def _cpu_time(process: int) -> float:
    """Seconds of computing of a process and its children that have ended."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def _child(case: Case, folder: Path, cache: Path) -> None:
    """Become the process of a case; does not return."""
    try:
        os.setsid()
        os.chdir(folder)
        for number, stream in ((1, "out"), (2, "err")):
            os.dup2(os.open(f"{folder}.{stream}", os.O_WRONLY | os.O_CREAT | os.O_APPEND), number)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        environment = {"PATH": "/usr/bin:/bin", "HOME": str(folder), "LANG": "C.UTF-8", "XDG_CACHE_HOME": str(cache)}
        environment |= {
            name: value.format(folder=folder) for name, value in case.environment.items() if value is not None
        }
        environment = {name: value for name, value in environment.items() if case.environment.get(name, "") is not None}
        _limit(case.limits)
        environment["PYTHONPATH"] = os.pathsep.join((str(ROOT), environment.get("PYTHONPATH", "")))
        environment["PYTHONDONTWRITEBYTECODE"] = "1"  # a limit would cut compiled files off
        if case.environment or case.limits:
            words = [sys.executable, str(ROOT / "planlang_command.py"), *case.words]
            os.execve(sys.executable, [os.fsencode(word) for word in words], environment)
        os.environ.clear()
        os.environ.update(environment)
        sys.argv = ["planlang", *case.words]
        import planlang_command

        planlang_command.main()
    except SystemExit as end:
        with contextlib.suppress(OSError, ValueError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(end.code if isinstance(end.code, int) else 0 if end.code is None else 1)
    except BaseException:
        import traceback

        os.write(2, traceback.format_exc().encode(errors="replace"))
    finally:
        os._exit(1)


def _limit(limits: Mapping[str, int]) -> None:
    kinds = {"v": resource.RLIMIT_AS, "t": resource.RLIMIT_CPU, "n": resource.RLIMIT_NOFILE}
    kinds |= {"f": resource.RLIMIT_FSIZE, "s": resource.RLIMIT_STACK, "u": resource.RLIMIT_NPROC}
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESSES, _ADDRESSES))
    for name, value in limits.items():
        amount = value * 1024 if name in "vfs" else value
        resource.setrlimit(kinds[name], (amount, amount))


def _judged(one: Running, status: int, used: resource.struct_rusage) -> Outcome:
    case = one.case
    texts = []
    for stream in ("out", "err"):
        path = Path(f"{one.folder}.{stream}")
        texts.append(path.read_bytes().decode(errors="surrogateescape"))
        path.unlink()
    shutil.rmtree(one.folder, ignore_errors=True)
    said = "\n".join(texts)
    problem = one.problem or problem_of(case, status, said, texts[1], interrupted=one.interrupted is not None)
    megabytes = used.ru_maxrss // 1024
    if problem is None and megabytes > MEGABYTES:
        problem = f"memory: {megabytes} MB"
    return Outcome(case, problem, used.ru_utime + used.ru_stime, megabytes, texts[1][-3000:])


def problem_of(case: Case, status: int, said: str, errors: str, *, interrupted: bool) -> str | None:
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        if "t" in case.limits and number in (signal.SIGXCPU, signal.SIGKILL):
            return None
        return f"signal {signal.Signals(number).name}"
    code = os.WEXITSTATUS(status)
    if found := re.search(r"internal error in .*", said):
        return found[0]
    if "Traceback (most recent call last)" in said:
        return f"traceback: {said.strip().splitlines()[-1][:200]}"
    allowed = {0, 1, 2, 3} | ({71} if case.limits or case.environment else set()) | ({130} if interrupted else set())
    allowed |= {128 + signal.SIGXCPU} if "t" in case.limits else set()
    if code not in allowed:
        last = said.strip().splitlines()[-1:] or [""]
        return f"exit {code}: {last[0][:200]}"
    if "FORCE_COLOR" not in case.environment and (
        hidden := _HIDDEN.search(errors if case.words[0] in _WRITING else said)
    ):
        return f"printed raw: U+{ord(hidden[0]):04X}"
    return None


def signature(case: Case, problem: str) -> str:
    """What two offenders of one cause have in common."""
    command = " ".join(case.words[:2]) if case.words[0] == "robot" else case.words[0]
    if problem.startswith("internal error"):
        return re.sub(r"[\d.]+", "N", problem.partition(": ")[0] + problem.partition("): ")[2].partition(":")[0])
    return re.sub(r"\d+", "N", f"{command}: {problem}")[:120]


def attack(cases: Iterator[Case], runner: Runner, jobs: int, tell: Callable[[Outcome], None]) -> None:
    """Run cases, so many at once; ``tell`` hears how each ended."""
    cases = iter(cases)
    is_over = False
    while not is_over or len(runner):
        while not is_over and len(runner) < jobs:
            case = next(cases, None)
            is_over = case is None
            if case is not None:
                runner.start(case)
        if len(runner):
            tell(runner.wait())


def drawn(seed: int, first: int, count: int, parts: tuple[str, ...], sources: Path) -> Iterator[Case]:
    """Yield so many cases."""
    shares = [share for part, share in zip(PARTS, _SHARES, strict=True) if part in parts]
    for number in range(first, first + count):
        part = random.Random(f"{seed}:{number}").choices(parts, shares)[0]
        yield case_of(part, seed, number, sources)
