"""Phrases and locations are told by each other without loss; what is no phrase is refused at its place."""

from __future__ import annotations

from pathlib import Path
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.designators import (
    GRASPS,
    Device,
    Location,
    Object,
    Person,
    Relation,
    a_device,
    a_location,
    a_person,
    a_posture,
    an_object,
    label_iris,
)
from planlang.diagnostics import BadInput, Diagnostic
from planlang.files import bundled
from planlang.ontology import load
from planlang.phrases import Lexicon, read_location, read_thing, write_location
from planlang.phrases.lexicon import DEVICES, GRASP_FORMS, plain
from planlang.phrases.reading import SPOKEN, parser
from planlang.relations import RELATIONS
from tests.support.codes import CODES

WARD = "http://example.org/ward.owl#"
THINGS = {
    "patient1": Person("Patient", WARD + "patient1"),
    "bottle1": Object("DrinkingBottle", WARD + "bottle1"),
    "cabinet2": Object("Cabinet-PieceOfFurniture", WARD + "cabinet2"),
    "coffee1": Object("CoffeeBeverage", WARD + "coffee1"),
    "tea1": Object("TeaBeverage", WARD + "tea1"),
    "and": Object("Bed-PieceOfFurniture", WARD + "and"),
    "bed": Object("Chair-PieceOfFurniture", WARD + "bed"),
}
"""The last two have names that are words of phrases."""
LEXICON = Lexicon.of(load(bundled("ontologies") / "environments" / "hospital_room.omn"), THINGS)
BED, PATIENT, RIGHT_ARM = an_object("Bed-PieceOfFurniture"), a_person("Patient"), a_device("RightArm")

names = st.text("aBz09-_/:#.%é", min_size=1, max_size=8)
CLASSES = list(LEXICON.classes.values())
classes = st.integers(0, len(CLASSES) - 1).map(CLASSES.__getitem__)
SOME_WORDS = (
    *("in", "reach", "of", "the", "a", "place", "patient", "bed", "with", "right", "arm", "from", "top", "and", "not"),
    *("within", "30", "cm", "(", ")", ",", "near", "to", "at", "called", "<X>"),
)
objects = (
    st.sampled_from(list(THINGS.values()))
    | classes
    | st.builds(lambda what, iri: type(what)(what.type, iri), classes, names)
    | st.builds(lambda kind, *told: kind(*told), st.sampled_from([Object, Person, Device]), names, st.none() | names)
)
devices = st.sampled_from(list(DEVICES.values())) | st.builds(Device, names, st.none() | names)
lengths = st.floats(0.0, 1e9) | st.integers(0, 500).map(lambda centimetres: centimetres / 100)


@st.composite
def relations(draw: st.DrawFn, depth: int = 0) -> Relation:
    """Any relation, bounded only where it has a distance, to a thing or to a place."""
    name = draw(st.sampled_from(list(RELATIONS)))
    least, most = None, None
    if RELATIONS[name].measured:
        least, most = draw(st.none() | lengths), draw(st.none() | lengths)
        if least is not None and most is not None:
            least, most = sorted((least, most))
    references = []
    for _ in range(RELATIONS[name].arity):
        is_place = depth < 2 and draw(st.integers(0, 4)) == 0
        references.append(draw(locations(depth + 1)) if is_place else draw(objects))
    return Relation(name, tuple(references), most, least, draw(st.booleans()))


@st.composite
def locations(draw: st.DrawFn, depth: int = 0) -> Location:
    """Any location."""
    several = draw(st.lists(relations(depth), min_size=1, max_size=3, unique=True))
    grasp = draw(st.none() | st.sampled_from(GRASPS))
    return Location(tuple(several), device=draw(st.none() | devices), grasp=grasp)


def assert_told(location: Location) -> None:
    """Phrase and location tell each other."""
    phrase = write_location(location, LEXICON)
    read = read_location(phrase, LEXICON)
    assert read == location
    assert write_location(read, LEXICON) == phrase


def any_location(rng: Random, depth: int = 0) -> Location:
    """Any location, as :func:`locations` draws them, eight times as fast and without making a failure smaller."""
    several = {any_relation(rng, depth): None for _ in range(rng.randint(1, 3))}
    device = rng.choice((None, rng.choice(list(DEVICES.values())), Device(any_name(rng), any_name(rng))))
    return Location(tuple(several), device=device, grasp=rng.choice((None, *GRASPS)))


def any_relation(rng: Random, depth: int) -> Relation:
    """Any relation."""
    name = rng.choice(list(RELATIONS))
    least, most = None, None
    if RELATIONS[name].measured:
        lengths = sorted(
            rng.choice((rng.uniform(0, 5), rng.randint(0, 500) / 100, 10 ** rng.uniform(-9, 9))) for _ in "ab"
        )
        least, most = (rng.choice((None, length)) for length in lengths)
    references = tuple(any_reference(rng, depth) for _ in range(RELATIONS[name].arity))
    return Relation(name, references, most, least, rng.random() < 0.5)


def any_reference(rng: Random, depth: int) -> Object | Location:
    """Any thing or place."""
    if depth < 2 and rng.random() < 0.2:
        return any_location(rng, depth + 1)
    known = rng.choice(list(THINGS.values())), rng.choice(CLASSES)
    kind = rng.choice((Object, Person, Device))
    made = kind(any_name(rng), rng.choice((None, any_name(rng)))), type(known[1])(known[1].type, any_name(rng))
    return rng.choice((*known, *made))


def any_name(rng: Random) -> str:
    """A name with whatever IRIs have."""
    return "".join(rng.choice("aBz09-_/:#.%é") for _ in range(rng.randint(1, 8)))


def test_a_thousand_random_locations_are_told_by_their_phrases_and_the_phrases_by_them() -> None:
    found = {any_location(Random(seed)) for seed in range(1000)}
    assert len(found) > 990, "they differ"
    for location in found:
        assert_told(location)


@given(location=locations())
def test_a_location_is_told_by_its_phrase_and_the_phrase_by_its_location(location: Location) -> None:
    assert_told(location)


@given(location=locations())
def test_without_a_lexicon_nothing_is_lost_either(location: Location) -> None:
    assert read_location(write_location(location)) == location


@given(location=locations(), upper=st.booleans())
def test_case_and_space_between_words_mean_nothing(location: Location, upper: bool) -> None:
    words = write_location(location).split(" ")
    loud = [
        word.upper() if upper and "<" not in word and word.isalpha() and word not in ("cm", "m") else word
        for word in words
    ]
    assert read_location("  \n".join(loud)) == location


@given(text=st.text(max_size=60) | st.lists(st.sampled_from(SOME_WORDS), max_size=14).map(" ".join))
def test_any_text_is_a_location_or_has_a_diagnostic_at_a_place_inside_it(text: str) -> None:
    try:
        location = read_location(text, LEXICON)
    except BadInput as bad:
        for found in bad.diagnostics:
            assert found.code in CODES
            assert found.span is not None
            assert 1 <= found.span.column <= max(map(len, text.split("\n"))) + 1
    else:
        assert read_location(write_location(location, LEXICON), LEXICON) == location


@pytest.mark.parametrize("relation", RELATIONS)
def test_every_form_of_a_relation_is_read_as_it(relation: str) -> None:
    things = (BED, PATIENT)[: RELATIONS[relation].arity]
    said = ("the bed", "the bed and the patient")[len(things) - 1]
    for form in RELATIONS[relation].forms:
        assert read_location(f"{form} {said}", LEXICON).relations == (Relation(relation, things),)


def test_every_form_of_a_grasp_is_read_as_it() -> None:
    for grasp, forms in GRASP_FORMS.items():
        for form in forms:
            assert read_location(f"in reach of the bed {form}", LEXICON).grasp == grasp


@pytest.mark.parametrize(
    ("phrase", "location"),
    [
        (
            "in reach of the patient with the right arm and not blocking the door",
            a_location(in_reach_of=PATIENT, clear_of=an_object("Door"), using=RIGHT_ARM),
        ),
        ("in reach of a place above the bed", a_location(in_reach_of=a_location(above=BED))),
        (
            "in reach of a place (above the bed and within 30 cm of patient1) from the top",
            a_location(
                in_reach_of=a_location(above=BED) & a_location(near=THINGS["patient1"], within="30 cm"), grasp="top"
            ),
        ),
        ("within 30 cm of the bed", a_location(near=BED, within=0.3)),
        ("at most 30 cm from the bed", a_location(near=BED, within=0.3)),
        ("more than 2 m from the bed", a_location(far_from=BED, beyond=2.0)),
        ("1 ft to 1 m in front of the bed", a_location(in_front_of=BED, beyond="1 ft", within=1.0)),
        (
            "not near the bed, visible from the bottle",
            a_location(not_=a_location(near=BED)) & a_location(visible=an_object("Bottle")),
        ),
        ("not within 1 m of the bed", a_location(not_=a_location(near=BED, within=1))),
        ("blocking the bed", a_location(not_=a_location(clear_of=BED))),
        ("between the bed and the patient", a_location(between=(BED, PATIENT))),
        (
            "near the bed and not in between the patient and the bed and facing patient1",
            a_location(near=BED)
            & a_location(not_=a_location(between=(PATIENT, BED)))
            & a_location(facing=THINGS["patient1"]),
        ),
        (
            "in reach of a place (above the bed and between the patient and the bed) with the right arm",
            a_location(in_reach_of=a_location(above=BED, between=(PATIENT, BED)), using=RIGHT_ARM),
        ),
    ],
)
def test_what_phrases_mean(phrase: str, location: Location) -> None:
    assert read_location(phrase, LEXICON) == location


def only(phrase: str) -> Diagnostic:
    """The one diagnostic of a phrase."""
    with pytest.raises(BadInput) as caught:
        read_location(phrase, LEXICON)
    (found,) = caught.value.diagnostics
    return found


@pytest.mark.parametrize(
    ("phrase", "code", "column", "help"),
    [
        ("in raech of the patient", "P001", 1, "did you mean 'in reach of'"),
        ("in reach of the bed and nera the patient", "P001", 25, "did you mean 'near'"),
        ("in reach of the bed and nonsense the patient", "P001", 25, "relations: in reach of, above"),
        ("in reach of the patiant", "P002", 17, "did you mean 'patient'? there are: patient1, bottle1"),
        ("in reach of the unicorn", "P002", 17, "there are: patient1, bottle1"),
        ("in reach of the patient near the bed", "P003", 30, None),
        ("in reach of the patient with the rigth arm", "P002", 34, "did you mean 'right arm'"),
        ("in reach of", "P003", 12, "for example"),
        ("", "P003", 1, "relations: in reach of"),
        ("near the bed (", "P003", 14, None),
        ("within 3 parsecs of the bed", "P004", 8, 'write "30 cm"'),
        ("within 30 of the bed", "P004", 8, 'write "30 cm"'),
        ("3 m to 1 m left of the bed", "P004", 1, None),
        ("in reach of the bed with the left arm and near patient1 with the right arm", "P005", 57, None),
        ("at most 3 m visible from the bed", "P006", 13, "relations with a distance: above, in front of"),
        ("at most 3 m between the bed and the patient", "P006", 13, "relations with a distance: above, in front of"),
        ("between the bed and the patiant", "P002", 25, "did you mean 'patient'?"),
        ("betwen the bed and the patient", "P001", 1, "did you mean 'between'"),
        ("between the bed", "P003", 16, "for example: between the bed and the table"),
    ],
)  # fmt: skip
def test_a_mistake_is_told_at_its_column_with_what_would_be_valid(
    phrase: str, code: str, column: int, help: str | None
) -> None:
    found = only(phrase)
    assert (found.code, found.span and found.span.column) == (code, column), found
    assert help is None or help in (found.help or ""), found


@pytest.mark.parametrize(
    ("phrase", "expected"),
    [
        ("in reach of the person called patient1", "unexpected 'patient1' where a name in <...> is expected"),
        ("near the bed called", "the phrase ends where a name in <...> is expected"),
        ("near the bed (", "unexpected '(' where 'and', 'with' or the end is expected"),
        ("near the bed ?", "unexpected '?' where 'and', 'with' or the end is expected"),
        ("in reach of a place (near the bed ?", "unexpected '?' where 'and', 'with' or ')' is expected"),
        ("in reach of a place (near the <a(b> ?", "unexpected '?' where 'and', 'with' or ')' is expected"),
        ("in reach of a place (near the bed", "the phrase ends where ')' is expected"),
        ("in reach of the bed with the", "the phrase ends where an arm is expected"),
        ("near a", "the phrase ends where a thing is expected"),
        ("blocking", "the phrase ends where a thing or a place is expected"),
        ("beyond 2 m", "the phrase ends where 'of' or 'from' is expected"),
        ("1 m left of the bed", "unexpected 'left' where 'to' is expected"),
        ("at most", "the phrase ends where a length is expected"),
        ("between the bed, the door", "unexpected ',' where 'and' is expected"),
        ("between the bed and", "the phrase ends where a thing or a place is expected"),
        ("between the bed and the", "the phrase ends where a thing is expected"),
    ],
)
def test_what_is_expected_is_said_in_the_words_of_phrases(phrase: str, expected: str) -> None:
    assert only(phrase).message == expected


def test_every_terminal_of_the_grammar_is_something_to_whoever_writes_a_phrase() -> None:
    assert {terminal.name for terminal in parser().terminals if not terminal.name.startswith("_")} <= SPOKEN.keys()


@given(words=st.lists(st.sampled_from((*SOME_WORDS, "at most", "1 m", "beyond", "blocking", "?", "<")), max_size=9))
def test_no_message_has_a_name_of_the_grammar(words: list[str]) -> None:
    try:
        read_location(" ".join(words), LEXICON)
    except BadInput as bad:
        told = " ".join(found.message for found in bad.diagnostics)
        names = ("exact", "word", "article", "lpar", "rpar", "comma", "length", "limit", "relation", "grasp", "$end")
        assert not [name for name in names if f"'{name}'" in told]


def test_a_noun_that_several_classes_of_the_map_end_with_is_not_guessed() -> None:
    lexicon = Lexicon.from_classes(
        {"WineBottle": Object, "DrinkingBottle": Object},
        {"w": Object("WineBottle", WARD + "w"), "d": Object("DrinkingBottle", WARD + "d")},
    )
    with pytest.raises(BadInput) as caught:
        read_location("in reach of the bottle", lexicon)
    assert caught.value.diagnostics[0].code == "P007"
    assert "wine bottle, drinking bottle" in str(caught.value)


@pytest.mark.parametrize(
    ("noun", "guess"), [("milk1", None), ("the patiant", "patient"), ("the piece of furnitur", "piece")]
)
def test_of_a_map_rather_what_is_in_it_is_guessed(noun: str, guess: str | None) -> None:
    help = only(f"in reach of {noun}").help or ""
    assert help.startswith(f"did you mean '{guess}" if guess else "there are: patient1, bottle1")
    assert Lexicon.from_classes({"Milk": Object}).similar("milk1") == "milk"


def test_all_mistakes_of_a_phrase_are_told_in_one_go() -> None:
    with pytest.raises(BadInput) as caught:
        read_location("within 1 parsec of the bed and near the unicorn with the tail", LEXICON)
    assert [found.code for found in caught.value.diagnostics] == ["P004", "P002", "P002"]


def test_places_within_places_are_bounded() -> None:
    assert only("near a place " * 30 + "near the bed").code == "P003"
    assert only("near the bed and " * 2000 + "near the bed").code == "P003"


@pytest.mark.parametrize(
    ("noun", "thing"),
    [("the bottle", Object("Bottle")), ("bottle1", THINGS["bottle1"]), ("a patient", Person("Patient"))],
)
def test_a_noun_alone_tells_a_thing(noun: str, thing: Object) -> None:
    assert read_thing(noun, LEXICON) == thing


@pytest.mark.parametrize(("noun", "code"), [("the unicorn", "P002"), ("the bottle near the bed", "P003"), ("", "P003")])
def test_what_is_no_noun_tells_no_thing(noun: str, code: str) -> None:
    with pytest.raises(BadInput) as caught:
        read_thing(noun, LEXICON)
    assert [found.code for found in caught.value.diagnostics] == [code]


def test_a_posture_is_no_place_that_a_phrase_could_tell() -> None:
    with pytest.raises(ValueError, match="has no relations"):
        write_location(a_posture("carrying"))


HERE = Path(__file__).parents[2] / "diagnostics"
FILES = sorted(path for path in HERE.glob("P0*.phrase"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_file_has_its_diagnostic_at_its_line(path: Path) -> None:
    with pytest.raises(BadInput) as caught:
        read_location(path.read_text(encoding="utf-8"), LEXICON, file=str(path))
    (found,) = caught.value.diagnostics
    assert found.code == path.name.split("_")[0]
    assert found.span is not None
    assert (found.span.file, found.span.line) == (str(path), 3)


def test_every_code_about_phrases_has_a_file() -> None:
    about_maps = {"P008", "P009", "P010", "P011", "P012"}
    assert {path.name.split("_")[0] for path in FILES} == {code for code in CODES if code[0] == "P"} - about_maps


def test_words_are_lower_case_with_one_space_between() -> None:
    assert all(
        form == plain(form)
        for forms in (*(one.forms for one in RELATIONS.values()), *GRASP_FORMS.values())
        for form in forms
    )


def test_things_are_told_by_labels_and_by_what_people_call_their_class(tmp_path: Path) -> None:
    file = tmp_path / "home.omn"
    file.write_text(
        "Prefix: : <http://example.org/my-home.owl#>\nPrefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>\n"
        "Prefix: rdfs: <http://www.w3.org/2000/01/rdf-schema#>\nOntology: <http://example.org/my-home.owl>\n"
        "Import: <http://knowrob.org/kb/knowrob.owl>\n"
        'Class: OB_0001\n    Annotations: rdfs:label "juice box"\n    SubClassOf: knowrob:Container\n'
        'Individual: thing8\n    Types: knowrob:EatingTable\n    Annotations: rdfs:label "Potting table"\n'
    )
    home = "http://example.org/my-home.owl#"
    box, bench = Object(home + "OB_0001", home + "thing7"), Object("EatingTable", home + "thing8")
    milk, fridge = Object("CowsMilk-Product", home + "milk1"), Object("Refrigerator", home + "f1")
    lexicon = Lexicon.of(load(file), {"thing7": box, "thing8": bench, "milk1": milk, "f1": fridge})
    told = {"the juice box": box, "the fridge": fridge, "the milk carton": milk, "the carton": milk, "the milk": milk}
    for noun, what in told.items():
        assert read_thing(noun, lexicon) == Object(what.type), noun
    assert read_thing("the potting table", lexicon) == bench
    assert read_thing("the milk", LEXICON) == Object("Milk")  # nothing of the map is called so


OPAQUE = f"{WARD}R7mKpW4hYn7rTz0cXlMaD3q"


@pytest.mark.parametrize(
    "noun", ["blue_mug", "blue mug", "R7mKpW4hYn7rTz0cXlMaD3q", OPAQUE, f"<{OPAQUE}>", f"the thing <{OPAQUE}>"]
)
def test_a_thing_with_an_opaque_name_is_called_by_its_label_its_name_and_its_iri(noun: str) -> None:
    label_iris({OPAQUE: "blue_mug"})
    mug = Object("Mug", OPAQUE)
    lexicon = Lexicon.from_classes({"Mug": Object}, {"blue_mug": mug})
    near, _ = read_location(f"near {noun}, and clear of the mug # where it is free", lexicon).relations
    assert near.references[0] == mug
