"""NEEMs, records of episodes, are maps: objects have the poses that they had last."""

import json
import struct
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from executive.maps import read_map
from planlang.diagnostics import BadInput
from planlang.geometry import Pose
from planlang.ontology import load
from tests.support.refusals import refusal

TRIPLES: list[dict[str, Any]] = [
    {"s": "http://a.b/k#table1", "p": "http://www.w3.org/1999/02/22-rdf-syntax-ns#type", "o": "soma:Table"},
    {"s": "http://a.b/k#table1", "p": "soma:hasShape", "o": "http://a.b/k#shape1"},
    {"s": "http://a.b/k#shape1", "p": "http://www.ontologydesignpatterns.org/ont/dul/DUL.owl#hasRegion", "o": "_:r"},
    {"s": "_:r", "p": "soma:hasDepth", "o": 0.8},
    {"s": "_:r", "p": "soma:hasWidth", "o": 1.2},
    {"s": "_:r", "p": "soma:hasHeight", "o": 0.7, "since": 0.0},
    {"s": "http://a.b/k#cup1", "p": "http://www.w3.org/1999/02/22-rdf-syntax-ns#type", "o": "soma:Cup"},
    {"s": "http://a.b/k#cup1", "p": "soma:hasShape", "o": "_:s"},
    {"s": "_:s", "p": "soma:hasRadius", "o": 0.04},
    {"s": "_:s", "p": "soma:hasLength", "o": 0.1},
]


def transform(child: str, parent: str, at: tuple[float, float, float], when: str) -> dict[str, Any]:
    return {
        "header": {"seq": 0, "stamp": {"$date": when}, "frame_id": parent},
        "child_frame_id": child,
        "transform": {
            "translation": dict(zip("xyz", at, strict=True)),
            "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        },
    }


TF = [
    transform("table1", "map", (9.0, 9.0, 9.0), "2020-07-21T06:54:25.000Z"),
    transform("cup1", "table1", (0.1, 0.0, 0.4), "2020-07-21T06:54:26.000Z"),
    transform("table1", "/map", (2.0, 0.0, 0.35), "2020-07-21T06:54:27.000Z"),
]


def full(value: Any) -> Any:
    return value.replace("soma:", "http://www.ease-crc.org/ont/SOMA.owl#") if isinstance(value, str) else value


def bson(value: Any) -> bytes:
    """A document of MongoDB in BSON (bsonspec.org)."""
    kinds = {float: (1, "<d"), int: (16, "<i")}
    fields = b""
    for name, one in value.items():
        if isinstance(one, dict):
            kind, content = 3, bson(one)
        elif isinstance(one, str):
            text = one.encode() + b"\0"
            kind, content = 2, struct.pack("<i", len(text)) + text
        else:
            kind, form = kinds[type(one)]
            content = struct.pack(form, one)
        fields += bytes([kind]) + name.encode() + b"\0" + content
    return struct.pack("<i", len(fields) + 5) + fields + b"\0"


@pytest.mark.parametrize("form", ["array", "lines", "dump"])
def test_a_neem_is_a_map_of_its_objects_where_they_were_last(form: str, tmp_path: Path) -> None:
    triples = [{key: full(value) for key, value in one.items()} for one in TRIPLES]
    path = tmp_path / "triples.json"
    if form == "dump":
        path = tmp_path / "triples" / "roslog" / "triples.bson"
        for name, documents in (("triples", triples), ("tf", TF)):
            (tmp_path / name / "roslog").mkdir(parents=True)
            (tmp_path / name / "roslog" / f"{name}.bson").write_bytes(b"".join(map(bson, documents)))
    else:
        path.write_text(json.dumps(triples) if form == "array" else "\n".join(map(json.dumps, triples)))
        (tmp_path / "tf.json").write_text("\n".join(map(json.dumps, TF)))
    table, cup = read_map(load(path)).objects
    assert (table.size, cup.size) == ((0.8, 1.2, 0.7), (0.08, 0.08, 0.1))
    assert table.pose == Pose((2.0, 0.0, 0.35))
    assert cup.pose is not None
    assert cup.pose.position == pytest.approx((2.1, 0.0, 0.75))
    converted = CliRunner().invoke(app, ["convert", str(path), "--syntax", "turtle"])
    assert (converted.exit_code, converted.stderr) == (0, "")
    assert "<http://a.b/k#cup1> a <http://www.ease-crc.org/ont/SOMA.owl#Cup>" in converted.stdout


def test_a_neem_without_its_transforms_says_which_file_has_the_poses(tmp_path: Path) -> None:
    path = tmp_path / "triples.json"
    path.write_text(json.dumps([{key: full(value) for key, value in one.items()} for one in TRIPLES], indent=1))
    refused = CliRunner().invoke(app, ["check", str(path)])
    assert refused.exit_code == 2
    assert "triples.json:7:1: error M033 2 objects of this NEEM, such as table1, have a shape" in refused.stderr
    assert "as tf.json" in refused.stderr
    (tmp_path / "tf.json").write_text("\n".join(map(json.dumps, TF)))
    alone = CliRunner().invoke(app, ["check", str(tmp_path / "tf.json")])
    assert "put this file beside them, as tf.json" in alone.stderr


@pytest.mark.parametrize("content", [b'[{"s": 1, "p": "q", "o": 2}]', b'[{"s": "a", "p": "b", "o"', bson({"s": "a"})])
def test_a_damaged_neem_is_bad_input(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "triples.json").write_bytes(content)
    with pytest.raises(BadInput) as bad:
        load(tmp_path / "triples.json")
    assert [one.code for one in bad.value.diagnostics] == ["O020"]


@pytest.mark.parametrize("rotation", [{}, {"x": {}, "y": 0, "z": 0, "w": 1}, dict.fromkeys("xyzw", 0), "upright"])
def test_a_damaged_transform_of_a_neem_is_bad_input_with_its_line(rotation: Any, tmp_path: Path) -> None:
    (tmp_path / "triples.json").write_text(json.dumps([{key: full(value) for key, value in TRIPLES[0].items()}]))
    damaged = {**TF[1], "transform": {**TF[1]["transform"], "rotation": rotation}}
    (tmp_path / "tf.json").write_text("\n".join(map(json.dumps, (TF[0], damaged))))
    with refusal("O020", naming="tf.json:2:1"):
        load(tmp_path / "triples.json")
