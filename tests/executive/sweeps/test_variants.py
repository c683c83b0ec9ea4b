"""Variants are products of what varies, or have labels; their options are those of the command line and of Python."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from executive.options.declaring import made
from executive.options.running import SweepOptions
from executive.sweeps.variants import Variant, variants_of
from planlang.diagnostics import BadInput


def variants(**options: Any) -> dict[str, Variant]:
    return {one.name: one for one in variants_of(made(SweepOptions, {"recipe": "serve_a_drink", **options}))}


def test_what_varies_is_combined_in_the_order_in_which_it_is_stated() -> None:
    found = variants(vary=["bottle=bottle1,cup1", "robot=amigo,pr2"])
    assert list(found) == [
        "bottle=bottle1 robot=amigo",
        "bottle=bottle1 robot=pr2",
        "bottle=cup1 robot=amigo",
        "bottle=cup1 robot=pr2",
    ]
    one = found["bottle=cup1 robot=pr2"]
    assert one.settings == {"set": {"bottle": "cup1"}, "robot": "pr2"}
    assert one.columns == {"bottle": "cup1", "robot": "pr2"}
    assert one.key(7) == "bottle=cup1 robot=pr2 7"
    assert found == variants(vary={"bottle": ["bottle1", "cup1"], "robot": ["amigo", "pr2"]})


def test_values_with_commas_are_stated_by_repeating_the_name() -> None:
    found = variants(vary=["start=1,2,0", "start=0,0,1.5"])
    assert [one.settings["start"] for one in found.values()] == [(1.0, 2.0, 0.0), (0.0, 0.0, 1.5)]
    assert list(found) == ["start=1,2,0", "start=0,0,1.5"]
    assert list(variants(vary=["place=near the bed, in reach", "place=near the sink"])) == [
        "place=near the bed, in reach",
        "place=near the sink",
    ]


def test_a_variant_with_a_label_has_the_options_of_its_words() -> None:
    text = "mine: pass_a_drink --robot 'my robot.toml' --set a=b --set c=d --trust-map --modules x.py --modules=y.py"
    found = variants(variant=[text, "as is:"], robot="amigo", set={"a": "z", "e": "f"})
    mine, plain = found.values()
    assert mine.settings == {
        "recipe": "pass_a_drink",
        "robot": "my robot.toml",
        "set": {"a": "b", "c": "d"},
        "trust_map": True,
        "modules": [Path("x.py"), Path("y.py")],
    }
    assert plain.settings == {}
    stated = {"recipe": "serve_a_drink", "robot": "amigo", "trust_map": "false", "a": "z"}
    assert plain.columns == {**stated, "modules": "", "c": ""}
    assert list(plain.columns) == list(mine.columns)
    whole = mine.options(made(SweepOptions, {"recipe": "x", "set": {"a": "z", "e": "f"}, "worlds": 3}))
    assert whole.set == {"a": "b", "e": "f", "c": "d"}
    assert (whole.worlds, whole.variant, whole.vary) == (3, None, None)


def test_labels_in_python_have_options_as_keywords_do() -> None:
    found = variants(variant={"mine": {"robot": "my.toml", "set": {"a": 1}, "start": (1, 2, 3)}, "theirs": {}})
    assert found["mine"].settings == {"robot": "my.toml", "set": {"a": "1"}, "start": (1.0, 2.0, 3.0)}


def test_labels_are_combined_with_what_varies() -> None:
    found = variants(variant=["a: --robot pr2", "b:"], vary=["bottle=x,y"])
    assert list(found) == ["a bottle=x", "a bottle=y", "b bottle=x", "b bottle=y"]
    assert found["a bottle=y"].settings == {"robot": "pr2", "set": {"bottle": "y"}}


def test_files_at_home_are_found_although_the_shell_does_not_expand_their_names(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("HOME", "/home/ada")
    assert variants(variant=["mine: ~/plan.py --robot ~/my.toml"])["mine"].settings == {
        "recipe": "/home/ada/plan.py",
        "robot": "/home/ada/my.toml",
    }
    assert variants(vary=["robot=~/my.toml,amigo"])["robot=/home/ada/my.toml"]


def test_a_parameter_called_like_an_option_or_a_column_is_told_apart() -> None:
    assert variants(vary=["set.robots=r2"])["set.robots=r2"].settings == {"set": {"robots": "r2"}}
    found = variants(vary={"set.robot": ["r2", "d2"], "duration": ["1", "2"]})
    one = found["set.robot=r2 duration=1"]
    assert one.settings == {"set": {"robot": "r2", "duration": "1"}}
    assert one.columns == {"set.robot": "r2", "set.duration": "1"}


def test_flags_and_numbers_vary_by_their_values() -> None:
    found = variants(vary=["trust-map=true,false", "schedule=1,2"])
    assert found["trust-map=true schedule=2"].settings == {"trust_map": True, "schedule": 2}


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"vary": ["robot"]}, "is not NAME=VALUE,VALUE"),
        ({"vary": ["robot=amigo,,pr2"]}, "a value of robot is empty"),
        ({"vary": ["robot=amigo,amigo"]}, "robot=amigo is stated twice"),
        ({"vary": {"robot": "amigo"}}, "as a list"),
        ({"vary": ["seed=1,2"]}, "seeds are those of the worlds"),
        ({"vary": ["worlds=1,2"]}, "no option of which a sweep runs variants"),
        ({"vary": ["start=1,2,3"]}, "repeat the name for values"),
        ({"vary": ["schedule=a,b"]}, "write an integer"),
        ({"vary": ["trust_map=yes,no"]}, "write true or false"),
        ({"vary": {str(n): ["1", "2"] for n in range(6)}}, "64 variants; at most 50"),
        ({"variant": ["mine"]}, "is not LABEL: OPTIONS"),
        ({"variant": ["a: --robot x", "a: --robot y"]}, "two variants are called a"),
        ({"variant": [": --robot x"]}, "cannot be the name of a variant"),
        ({"variant": ["a: --robt x"]}, "there is no option --robt; did you mean --robot?"),
        ({"variant": ["a: --no-recoverys"]}, "there is no option --no-recoverys; did you mean --no-recoveries?"),
        ({"vary": ["robots=amigo,pr2"]}, "did you mean robot? A parameter that is called so is set.robots"),
        ({"variant": ["a: --robot"]}, "--robot needs a value"),
        ({"variant": ["a: --robot x --robot y"]}, "stated twice"),
        ({"variant": ["a: one two"]}, "stated twice"),
        ({"variant": ["a: 'x"]}, "no closing quotation"),
        ({"variant": {"a": {"robt": "x"}}}, "there is no option 'robt'"),
        ({"variant": {"a": "x"}}, "as a dictionary"),
        ({"variant": {"a": {"schedule": "x"}}}, "write an integer"),
        ({"variant": ["a: --set bottle"]}, "is not NAME=THING"),
        ({"vary": {"robot": ["amigo"], "--robot": ["pr2"]}}, "robot and --robot vary the same"),
        ({"variant": ["a: --robot x"], "vary": ["robot=y,z"]}, "variant a sets robot, which"),
        ({"variant": ["a: --set b=c"], "vary": ["b=d"]}, "variant a sets b, which"),
        ({"variant": {"a": {}, "a b": {}}, "vary": {"b": ["1"]}}, ""),
    ],
)
def test_what_makes_no_variants_is_refused_with_the_reason(options: Mapping[str, Any], reason: str) -> None:
    if not reason:
        assert list(variants(**options)) == ["a b=1", "a b b=1"]
        return
    with pytest.raises(BadInput) as refused:
        variants(**options)
    assert reason in str(refused.value)
