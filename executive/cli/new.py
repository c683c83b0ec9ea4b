"""``planlang new``: files to start from, which run as they are. Their templates are in ``executive/templates``."""

from __future__ import annotations

import re
from pathlib import Path

from executive.cli.authoring_arguments import NewArguments
from executive.commands.answers import Answer
from executive.commands.inputs import refuse
from planlang.diagnostics import BadInput, error
from planlang.outputs import check_outputs, write_text
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
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name):
        proposal = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "my_task"
        help = f"use lower-case letters, digits and _, for example {proposal}"
        raise BadInput([error("C034", f"{name!r} cannot name files, classes and functions", help=help)])
    folder = arguments.folder / name if kind == "project" else arguments.folder
    texts = {folder / path: text for path, text in _filled(kind, name)}
    if kind == "project":
        texts |= {folder / path: text for path, text in _filled("map", MAP_OF_A_PROJECT)}
    for path in texts:
        path.parent.mkdir(parents=True, exist_ok=True)
    refuse(check_outputs({f"planlang new {kind}": path for path in texts}, {}, force=arguments.force))
    for path, text in texts.items():
        write_text(path, text)
    written = [path.as_posix() for path in texts]
    step = _next(kind, arguments.folder, name)
    return Answer(text="\n".join([*written, f"next: {step}"]), data={"files": written, "next": step})


def _next(kind: str, folder: Path, name: str) -> str:
    """What to do with a new template, as a command line."""
    words = NEXT[kind].split(" ")
    return " ".join(quoted(Path(word.format(path=folder, name=name))) if "{path}" in word else word for word in words)


def _filled(kind: str, name: str) -> list[tuple[Path, str]]:
    """Files of a template and their texts, with the name filled in in all its forms."""
    words = name.replace("_", " ")
    forms = {"template_name": name, "TemplateName": words.title().replace(" ", ""), "template name": words}
    filled = []
    for source in sorted((TEMPLATES / kind).rglob("*")):
        if source.is_file() and "__pycache__" not in source.parts:
            text, path = source.read_text(encoding="utf-8"), source.relative_to(TEMPLATES / kind).as_posix()
            for form, value in forms.items():
                text, path = text.replace(form, value), path.replace(form, value)
            filled.append((Path(path), text))
    return filled
