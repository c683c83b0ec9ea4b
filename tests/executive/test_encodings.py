"""Texts that begin with a byte order mark, as editors on Windows write them, and texts in other encodings."""

from collections.abc import Callable
from pathlib import Path

import pytest
from cli_runs import invoke

from planlang.files import Bundled

URDF = """<robot name="cart"><link name="base">
<collision><geometry><box size="0.4 0.4 0.2"/></geometry></collision></link>
<link name="mast"/><joint name="lift" type="prismatic"><parent link="base"/><child link="mast"/>
<limit lower="0" upper="0.4" effort="10" velocity="0.1"/></joint></robot>"""
SRDF = '<robot name="cart"><group_state name="home" group="all"><joint name="lift" value="0.3"/></group_state></robot>'
TOML = """name = "cart"
urdf = "cart.urdf"
[base]
radius = 0.3
fixed = true
"""
WORLD = """<robot name="flat"><link name="floor"/><link name="table">
<collision><geometry><box size="1 1 0.7"/></geometry></collision></link>
<joint name="j" type="fixed"><parent link="floor"/><child link="table"/></joint></robot>"""
LABELS = '[links.table]\nclass = "CounterTop"\n'
GRID = "image: grid.pgm\nresolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.2\n"
PLAN = """from planlang import plan, sleep

@plan
async def main() -> None:
    await sleep(1)
"""
MARKED: dict[str, Callable[[str], bytes]] = {
    "UTF-8 with a mark": lambda text: text.encode("utf-8-sig"),
    "UTF-16": lambda text: text.encode("utf-16"),
    "UTF-16, high bytes first": lambda text: b"\xfe\xff" + text.encode("utf-16-be"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the files refer to."""
    place = tmp_path_factory.mktemp("texts")
    (place / "cart.urdf").write_text(URDF)
    (place / "flat.urdf").write_text(WORLD)
    (place / "grid.pgm").write_bytes(b"P5\n4 4\n255\n" + bytes([254] * 12 + [0] * 4))
    return place


def texts(folder: Path) -> dict[str, tuple[str, str, tuple[str, ...]]]:
    """Kind of file -> its name and text, and the command that reads it."""
    room = Bundled.ENVIRONMENT.find("hospital_room").read_text()
    recipe = Bundled.RECIPE.find("serve_a_drink").read_text()
    return {
        "robot": ("cart.toml", TOML, ("show", "cart.toml")),
        "URDF": ("cart.urdf", URDF, ("show", "cart.urdf")),
        "SRDF": ("cart.srdf", SRDF, ("robot", "make", "cart.urdf", "-o", "made.toml", "--force")),
        "world": ("flat.urdf", WORLD, ("show", "flat.urdf")),
        "labels": ("flat.toml", LABELS, ("show", "flat.urdf")),
        "map": ("room.omn", room, ("show", "room.omn")),
        "grid": ("grid.yaml", GRID, ("show", "grid.yaml")),
        "recipe": ("drink.omn", recipe, ("check", "drink.omn")),
    }


KINDS = ("robot", "URDF", "SRDF", "world", "labels", "map", "grid", "recipe")


@pytest.mark.parametrize("encoding", MARKED)
@pytest.mark.parametrize("kind", KINDS)
def test_a_text_with_a_byte_order_mark_is_the_text_without(
    folder: Path, kind: str, encoding: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    name, text, words = texts(folder)[kind]
    results = []
    for content in (text.encode(), MARKED[encoding](text)):
        (folder / name).write_bytes(content)
        results.append(invoke(*words))
    (folder / name).unlink()
    if name in ("cart.urdf", "flat.urdf"):
        (folder / name).write_text(text)
    assert results[0].exit_code == 0, results[0].output
    assert results[1].output == results[0].output


@pytest.mark.parametrize("encoding", MARKED)
def test_a_plan_with_a_byte_order_mark_is_read_or_refused_with_what_to_do(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "wait.py").write_bytes(MARKED[encoding](PLAN))
    checked = invoke("check", tmp_path / "wait.py")
    if encoding.startswith("UTF-8"):
        assert checked.exit_code == 0
    else:
        assert checked.exit_code == 2
        assert "wait.py is in UTF-16\n    help: save it as UTF-8" in checked.output


def test_a_plan_in_another_encoding_is_refused_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "wait.py").write_bytes(f"{PLAN}# caf\xe9\n".encode("latin-1"))
    for command in ("check", "run"):
        assert "wait.py:6:6: error O004 this is not UTF-8 text" in invoke(command, tmp_path / "wait.py").output


def test_a_trace_with_a_byte_order_mark_is_read_or_refused_with_what_to_do(tmp_path: Path) -> None:
    trace = tmp_path / "trace.jsonl"
    assert invoke("run", "push_the_cup", "--trace", trace).exit_code == 0
    text, plain = trace.read_text(), invoke("show", trace)
    for name, marked in MARKED.items():
        trace.write_bytes(marked(text))
        shown = invoke("show", trace)
        if name.startswith("UTF-8"):
            assert (shown.exit_code, shown.output) == (0, plain.output)
        else:
            assert shown.exit_code == 2
            assert "save it as UTF-8" in shown.output
