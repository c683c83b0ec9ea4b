"""``planlang new``: files to start from, which run as they are. Their templates are in ``executive/templates``."""

from __future__ import annotations

import builtins
import keyword
import re
import sys
from pathlib import Path

from executive.cli.authoring_arguments import NewArguments
from executive.cli.console import Answer
from executive.runs.files import refuse
from planlang.diagnostics import BadInput, error
from planlang.outputs import check_outputs, make_folder, write_text
from planlang.shell import quoted

TEMPLATES = Path(__file__).resolve().parents[1] / "templates"
MAP_OF_A_PROJECT = "room"

NEXT = {
    "recipe": "planlang run {path}/{name}.omn --robot amigo --environment kitchenette",
    "map": 'planlang locate "in reach of cup1" --robot amigo --environment {path}/{name}.omn',
    "plan": "planlang run {path}/{name}.py --robot amigo --environment hospital_room",
    "module": "planlang run RECIPE --modules {path}/{name}.py",
    "robot": "planlang run serve_a_drink --robot {path}/{name}.toml --trust-map",
    "project": "cd {path}/{name} && make test run",
}
"""What to do next with each kind of template."""


def command(arguments: NewArguments) -> Answer:
    """Write the files of a template; raises BadInput."""
    name, kind = arguments.name, arguments.kind.value
    _check_name(kind, name)
    folder = arguments.folder / name if kind == "project" else arguments.folder
    texts = {folder / path: text for path, text in _filled(kind, name)}
    if kind == "project":
        texts |= {folder / path: text for path, text in _filled("map", MAP_OF_A_PROJECT)}
    for path in texts:
        make_folder(path.parent)
    refuse(check_outputs({f"planlang new {kind}": path for path in texts}, {}, force=arguments.force))
    for path, text in texts.items():
        write_text(path, text)
    written = [path.as_posix() for path in texts]
    words = [
        quoted(Path(word.format(path=arguments.folder, name=name))) if "{path}" in word else word
        for word in NEXT[kind].split(" ")
    ]
    step = " ".join(words)
    return Answer(text="\n".join([*written, f"next: {step}"]), data={"files": written, "next": step})


def _check_name(kind: str, name: str) -> None:
    """Raise BadInput for a name that cannot be that of files, of an OWL class and of a Python function alike."""
    reason, proposal = "cannot name files, classes and functions", f"my_{name}"
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        words = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
        proposal = words if words[:1].isalpha() else f"my_{words or 'task'}"
    elif keyword.iskeyword(name) or name in _RESERVED:
        reason = "is a word of Python or of Manchester syntax"
    elif name in vars(builtins):
        reason = "is a function of Python, which it would hide"
    elif name in sys.stdlib_module_names or name in _PACKAGES:
        reason = "is a module of Python or planlang, which a file of this name would hide"
    elif not {name, _class_name(name)}.isdisjoint(_declared(kind)):
        reason = f"is already a name in what planlang new {kind} writes"
    else:
        return
    help = f"use lower-case letters, digits and _, for example {proposal[:_LONGEST]}"
    raise BadInput([error("C034", f"{name[:_LONGEST]!r} {reason}", help=help)])


_LONGEST = 60
"""Characters of a name in a message."""
_RESERVED = frozenset(["some", "only", "value", "min", "max", "exactly", "self", "that", "inverse", "true", "false"])
"""Words of Manchester syntax that are none of Python."""
_PACKAGES = frozenset(("planlang", "planlang_command", "executive", "sim", "pytest", "conftest"))
_DECLARED = re.compile(r"^(?:Class|Individual): (\w+)|^ *(?:async def|def|class) (\w+)|^(\w+) = ", re.MULTILINE)
_IMPORTED = re.compile(r"^(?:from \S+ )?import (.+)$", re.MULTILINE)


def _declared(kind: str) -> set[str]:
    """Names that the files of a template declare or import."""
    texts = [path.read_text(encoding="utf-8") for path in (TEMPLATES / kind).iterdir() if path.is_file()]
    names = {one for text in texts for found in _DECLARED.findall(text) for one in found}
    return names | {one.strip() for text in texts for found in _IMPORTED.findall(text) for one in found.split(",")}


def _class_name(name: str) -> str:
    return name.replace("_", " ").title().replace(" ", "")


def _filled(kind: str, name: str) -> list[tuple[Path, str]]:
    """Files of a template and their texts, with the name filled in in all its forms."""
    words = name.replace("_", " ")
    forms = {"template_name": name, "TemplateName": _class_name(name), "template name": words}
    filled = []
    for source in sorted((TEMPLATES / kind).rglob("*")):
        if source.is_file() and "__pycache__" not in source.parts:
            text, path = source.read_text(encoding="utf-8"), source.relative_to(TEMPLATES / kind).as_posix()
            for form, value in forms.items():
                text, path = text.replace(form, value), path.replace(form, value)
            filled.append((Path(path), text))
    return filled
