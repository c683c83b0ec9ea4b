"""Needs of a task and offers of a knowledge base for them: the graph that the search explores.

A task needs a recipe. A recipe needs the requirements that matching it with the robot finds, recognition models of the
things that its steps handle, and a map with the things that it refers to. An entry needs the dependencies of its class.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cache, partial
from itertools import chain
from pathlib import Path

from executive.enabling.parameters import class_of, handled_by, things_of
from executive.enabling.search import Combination, Need, Offer, combine
from executive.enabling.stock import MODELS, Stock, unusable
from executive.maps.recognition_models import is_anything, needs_model
from executive.robots.matching import Matcher, Possessions
from executive.robots.requirements import NEEDED, WORDS, Availability, Finding, FindingKind, Requirement
from executive.robots.tasks import HARDWARE, UNKNOWN_STEP, match
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Span, has_errors
from planlang.knowledge.answers import Found, Links
from planlang.knowledge.entries import UNRATED, Kind
from planlang.ontology import Ontology, expand, load, load_apart
from planlang.ontology.expressions import Expression
from planlang.ontology.terms import OWL
from planlang.recipe import Actions, Thing, read_recipe
from planlang.records import dataclass
from planlang.spelling import similar

FOR = "\n"
"""Separates a need from its preferences, in its name: entries downloaded for the part before it are reconsidered."""
MODEL_OF = expand(MODELS)
MOST_SUGGESTIONS = 3


@dataclass(frozen=True, slots=True)
class NeedDetails:
    """What a need asks for, and how to look for it.

    ``has`` is the reason why the robot has it already, ``lacks`` why it has not, and ``own`` are offers of the robot
    itself, each with its dependencies.
    """

    kind: FindingKind
    text: str
    iri: str | None = None
    has: str | None = None
    lacks: str = ""
    is_hardware: bool = False
    """True for hardware, which no knowledge base can provide."""
    own: tuple[Offer, ...] = ()
    search: Callable[[], Iterable[Found]] = tuple
    fits: Callable[[Found], str | None] = lambda found: None
    """Reason why an entry found by ``search`` does not fit after all; None if it fits."""
    rank: Callable[[Found], float] = lambda found: 0
    """Entries are examined in ascending rank."""


@dataclass(slots=True)
class Enabling:
    """The graph of one task, one robot and one knowledge base.

    ``place`` has the room, floor, building, street or city that the map has to show.
    """

    robot: Possessions
    stock: Stock
    performed: frozenset[str] = frozenset()
    own_map: Path | None = None
    """The user's map; if given, no other one is searched for."""
    place: Mapping[str, str] = field(default_factory=dict)
    details: dict[Need, NeedDetails] = field(default_factory=dict)
    refused: dict[Need, dict[str, str]] = field(default_factory=dict)
    """Unsuitable entries for each need: the reason by the entry's identifier."""
    unread: dict[Need, int] = field(default_factory=dict)
    """Number of entries that were not examined because the limit was reached."""
    vocabulary: Ontology = field(init=False)
    _candidates: dict[Need, list[Found]] = field(default_factory=dict)
    _needs: dict[str, tuple[Need, ...]] = field(default_factory=dict)
    _damaged: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        folders = self.stock.folders
        self.vocabulary = load_apart(Path("vocabulary.omn"), folders=folders, content=b"Ontology: <urn:vocabulary>")

    @property
    def url(self) -> str:
        """Address of the knowledge base."""
        return self.stock.shelf.url

    def combination(self, root: Need) -> Combination:
        """Search for a combination of entries that meets a need. Raises BadInput if the knowledge base does not answer.

        If newer revisions of local copies need something that is missing, the copies are kept instead.
        """
        found = self._combination(root)
        if found.unmet and self.stock.renewed:
            self.stock.pass_over()
            for known in (self._candidates, self._needs, self._damaged, self.unread):
                known.clear()
            found = self._combination(root)
        return found

    def _combination(self, root: Need) -> Combination:
        """Search until none of the chosen entries is damaged."""
        while True:
            found = combine([root], lambda need: self.details[need].has, self.offers)
            uids = [one.uid for one in found.offers() if not one.is_own]
            damaged = {uid: reason for uid in uids if (reason := self.stock.damage(uid)) is not None}
            if not damaged:
                return found
            self._damaged |= damaged

    # offers

    def offers(self, need: Need) -> Iterable[Offer]:
        """Offers for a need: those of the robot itself, local copies, then entries of the knowledge base.

        Recipes and maps are downloaded lazily, since their content has to be read before their needs are known.
        """
        details = self.details[need]
        self.refused[need] = {}
        if need not in self._candidates:
            self._candidates[need] = self._find_candidates(need, details)
        candidates = self._candidates[need]
        if details.kind in (FindingKind.RECIPE, FindingKind.MAP):
            return chain(details.own, self._read_offers(need, candidates))
        return [*details.own, *(offer for one in candidates if (offer := self._offer(need, one)) is not None)]

    def _find_candidates(self, need: Need, details: NeedDetails) -> list[Found]:
        """Entries that may meet a need, local copies that were downloaded for it first."""
        offered = {one.entry.uid: self.stock.latest(one) for one in _best_first(details)}
        copies = [one for one in self.stock.folder.kept.values() if _general(need) in map(_general, one.needs)]
        kept = [offered.pop(one.found.entry.uid, one.found) for one in copies]
        return [*sorted(kept, key=details.rank), *offered.values()]

    def _read_offers(self, need: Need, candidates: Sequence[Found]) -> Iterator[Offer]:
        for number, found in enumerate(candidates):
            if not self.stock.may_read(found):
                self.unread[need] = len(candidates) - number
                return
            offer = self._offer(need, found)
            if offer is not None:
                yield offer

    def _offer(self, need: Need, found: Found) -> Offer | None:
        """Make an offer of an entry; None if it is unsuitable, with the reason in ``refused``."""
        uid = found.entry.uid
        self.stock.found[uid] = found
        try:
            reason = self._damaged.get(uid) or self.details[need].fits(found)
            if reason is None:
                return Offer(uid, found.entry.about, self.needs_of(found))
        except BadInput as problem:
            reason = unusable(problem)
        self.refused[need][uid] = reason
        return None

    def needs_of(self, found: Found) -> tuple[Need, ...]:
        """Needs of an entry: a recipe's requirements, or else the dependencies of its classes."""
        uid = found.entry.uid
        if uid not in self._needs and found.entry.kind is Kind.RECIPE:
            self._needs[uid] = self.of_recipe(self.stock.content(found), found.entry.about)
        elif uid not in self._needs:
            needs = (self._dependency(prop, target) for prop, target in self._dependencies(found.links))
            self._needs[uid] = tuple(dict.fromkeys(needs))
        return self._needs[uid]

    # needs

    def task(self, name: str) -> Need:
        """Add the need of a recipe for a task, which is named by an action class, or a recipe's identifier or label."""

        def search() -> Iterator[Found]:
            recipes = {one.entry.uid: one for text in _spellings(name) for one in self._recipes(label=text)}
            named = [one for one in recipes.values() if _is_called(one, name)]
            found = named or self._recipes(name)
            if not found and (near := self._near(name)):
                self._add(need, replace(self.details[need], lacks=f"{self._none()}; did you mean {' or '.join(near)}?"))
            yield from found

        need = f"recipe {name}"
        return self._add(need, NeedDetails(FindingKind.RECIPE, name, search=search, lacks=self._none()))

    def _near(self, name: str) -> list[str]:
        """Similar names of recipes in the knowledge base: labels, identifiers and action classes."""
        entries = [one.entry for one in self._recipes()]
        names = {text: None for one in entries for text in (one.label, one.uid, local_name(one.about))}
        classes = dict.fromkeys(map(local_name, self.vocabulary.subclasses(expand("PurposefulAction"))))
        matches = similar(local_name(name), [*names, *classes], n=MOST_SUGGESTIONS)
        return [one for one in matches if one in names or self._recipes(one)]

    def given_task(self, recipe: Path, task: str | None) -> Need:
        """Add the need of a recipe file of the user. Raises BadInput if it cannot be compiled."""
        needs = self.of_recipe(load(recipe, folders=self.stock.folders), task)
        own = (Offer(str(recipe), str(recipe), needs, is_own=True),)
        return self._add(f"recipe {recipe}", NeedDetails(FindingKind.RECIPE, str(recipe), own=own))

    def of_recipe(self, ontology: Ontology, task: str | None) -> tuple[Need, ...]:
        """Add the needs of a recipe. Raises BadInput if it cannot be compiled."""
        actions = Actions(ontology)
        reading = read_recipe(actions, task)
        if reading.recipes is None or has_errors(reading.diagnostics):
            raise BadInput([one for one in reading.diagnostics if has_errors([one])])
        matched = match(ontology, reading.recipes, self.robot, performed=self.performed)
        classes = map(class_of, handled_by(actions, reading.recipes))
        models = (self.model(cls, ontology) for cls in classes if needs_model(ontology, [cls]))
        things = [one for one in things_of(actions, reading.recipes) if not is_anything(ontology, class_of(one))]
        maps = [self.map(things, ontology)] if things or self.place or self.own_map is not None else []
        return tuple(dict.fromkeys([*self._of_finding(matched.tree), *models, *maps]))

    def _of_finding(self, finding: Finding) -> Iterator[Need]:
        """Yield the needs in a tree of findings; alternatives of which one is available add none."""
        if finding.kind in NEEDED:
            yield self._of_requirement(finding)
        elif finding.kind is FindingKind.ALTERNATIVES and finding.state is not Availability.AVAILABLE:
            text = f"one of {', '.join(one.text for one in finding.below)}"
            ways = [(one.text, tuple(self._of_finding(one))) for one in finding.below]
            need = f"{text}: {[needs for _, needs in ways]}"
            yield self._add(need, NeedDetails(FindingKind.ALTERNATIVES, text, own=_own(need, ways)))
        elif finding.reason == UNKNOWN_STEP and finding.iri is not None:
            yield self._of_step(finding)
        elif finding.kind is not FindingKind.ALTERNATIVES:
            for below in finding.below:
                yield from self._of_finding(below)

    def _of_requirement(self, finding: Finding) -> Need:
        need = _required(finding)
        if need in self.details:
            return need
        if all(one.state is Availability.AVAILABLE for one, _ in finding.walk()):
            return self._add(need, NeedDetails(finding.kind, finding.text, finding.iri, has=finding.reason))
        self.details[need] = NeedDetails(
            finding.kind, finding.text
        )  # ends the recursion if its dependencies need it in turn
        above = () if finding.iri is None else (finding.iri, *self.vocabulary.ancestors(finding.iri))
        is_disproved = any(local_name(one) in self.robot.lacks for one in above)
        own = () if is_disproved else _own(need, self._ways(finding))
        iri, why = finding.iri, finding.reason
        if finding.state is Availability.AVAILABLE:
            why += ", but a dependency is missing"
        expression = finding.text if iri is None else f"<{iri}>"
        if iri is not None and (is_disproved or self.vocabulary.taxonomy.is_below(iri, HARDWARE)):
            reason = f"{why}; it is or depends on hardware, which no knowledge base has"
            return self._add(need, NeedDetails(finding.kind, finding.text, iri, None, reason, True, own))
        reason = why if own else f"{why}, and {self.url} has none"
        search = partial(self.stock.shelf.search, expression)
        return self._add(need, NeedDetails(finding.kind, finding.text, iri, lacks=reason, own=own, search=search))

    def _ways(self, finding: Finding) -> list[tuple[str, tuple[Need, ...]]]:
        """Ways to meet a requirement by its dependencies: one way, or one for each operand of an "or"."""
        below = tuple(dict.fromkeys(self._of_requirement(one) for one in finding.below))
        is_any = finding.iri is None and " or " in finding.text
        each = [(one,) for one in below] if is_any else [below] if below else []
        return [(finding.text, needs) for needs in each]

    def _of_step(self, finding: Finding) -> Need:
        """Add the need of a recipe for a step that nothing performs; its task has to be exactly the step's class."""
        iri = finding.iri

        def search() -> Iterator[Found]:
            yield from (one for one in self._recipes(f"<{iri}>") if one.entry.about == iri)

        details = NeedDetails(FindingKind.RECIPE, local_name(iri or ""), iri, None, self._none(), search=search)
        return self._add(f"recipe {iri}", details)

    def model(self, cls: str, ontology: Ontology) -> Need:
        """Add the need of a recognition model of a class: a model of it or a subclass, else of a superclass."""
        above = [one for one in ontology.ancestors(cls) if one != cls]
        models = filter(None, (self._recognises(iri, (cls, *above)) for iri in self.robot_models()))
        own = (one for one in (cls, *above) if one in (self.robot.recognises or ()))
        has = next((f"{self.robot.robot} recognises {local_name(one)}" for one in own), None)
        narrow = f"<{expand('ObjectRecognitionModel')}> and <{MODEL_OF}> some <{cls}>"
        wide = " or ".join(f"<{MODEL_OF}> value <{one}>" for one in above)

        def search() -> Iterator[Found]:
            near = self.stock.shelf.search(narrow)
            yield from near
            further = self.stock.shelf.search(f"<{expand('ObjectRecognitionModel')}> and ({wide})") if wide else ()
            uids = {one.entry.uid for one in near}
            yield from (one for one in further if one.entry.uid not in uids)

        details = NeedDetails(
            FindingKind.MODEL, local_name(cls), cls, has or next(models, None), self._none(), search=search
        )
        return self._add(f"model {cls}", details)

    def robot_models(self) -> Iterator[str]:
        """IRIs of the recognition models among the parts of the robot."""
        model = expand("ObjectRecognitionModel")
        yield from (one.iri for one in self.robot.parts if one.iri is not None and model in one.classes)

    def _recognises(self, model: str, classes: Sequence[str]) -> str | None:
        assert self.robot.model is not None
        targets = self.robot.model.ontology.values_below(model, MODEL_OF)
        return f"{local_name(model)} of {self.robot.robot}" if any(one in targets for one in classes) else None

    def map(self, things: Sequence[Thing], ontology: Ontology) -> Need:
        """Add the need of a map with a thing of each class; maps with the individuals themselves are preferred."""
        if self.own_map is not None:
            return self._add("map", NeedDetails(FindingKind.MAP, "", has=f"{self.own_map} is given"))
        classes = tuple(dict.fromkeys(map(class_of, things)))
        individuals = frozenset(one.iri for one in things if one.iri is not None)
        text = ", ".join([*map(local_name, classes), *(f"{level} {name}" for level, name in self.place.items())])

        def fits(found: Found) -> str | None:
            types = self.stock.classes_in(found)
            kinds = {cls for one in types for cls in (one, *ontology.ancestors(one))}
            lacking = [local_name(cls) for cls in classes if cls not in kinds]
            return f"it contains no {', '.join(lacking)}" if lacking else None

        expression = f"<{expand('SemanticEnvironmentMap')}>"
        search = partial(self.stock.shelf.search, expression, kind=Kind.ENVIRONMENT, place=self.place)
        need = f"map {text}{FOR}{' '.join(sorted(individuals))}"
        details = NeedDetails(
            FindingKind.MAP, f"with {text}" if text else "", lacks=self._none(), search=search, fits=fits
        )
        return self._add(need, replace(details, rank=self._map_rank(expression, classes, individuals)))

    def _map_rank(
        self, expression: str, classes: Sequence[str], individuals: Iterable[str]
    ) -> Callable[[Found], float]:
        """Make a rank of maps from the index alone: the classes missing in a map, less the individuals in it."""

        @cache
        def hits() -> Counter[str]:
            queries = (f"{expression} and <{expand('mapOf')}> value <{iri}>" for iri in sorted(individuals))
            return Counter(one.entry.uid for text in queries for one in self.stock.shelf.search(text))

        def rank(found: Found) -> float:
            types = {up for _, cls in found.links for up in (cls, *self.vocabulary.ancestors(cls))}
            return sum(cls not in types for cls in classes) - hits()[found.entry.uid]

        return rank

    def _dependencies(self, links: Links) -> Iterator[tuple[str, str]]:
        """Yield the links that are dependencies, without those implied by a link to a subclass."""
        dependencies = [one for one in links if local_name(one[0]) in WORDS and one[1] != OWL.Thing]
        implied = {(prop, up) for prop, cls in dependencies for up in self.vocabulary.ancestors(cls) if up != cls}
        yield from (one for one in dependencies if one not in implied)

    def _dependency(self, prop: str, target: str) -> Need:
        kind = WORDS[local_name(prop)]
        need = f"{kind.value} {target}"
        if need in self.details:
            return need
        matcher = Matcher(self.vocabulary, self.robot)
        if kind is FindingKind.CAPABILITY:
            return self._of_requirement(matcher.capability(target))
        expression = Expression("name", Span(self.url), term=target)
        return self._of_requirement(matcher.component(Requirement(kind, "some", expression, 1, Span(self.url))))

    def _add(self, need: Need, details: NeedDetails) -> Need:
        self.details[need] = details
        return need

    def _none(self) -> str:
        return f"{self.robot.robot} has none, and {self.url} has none"

    def _recipes(self, expression: str | None = None, label: str | None = None) -> Sequence[Found]:
        return self.stock.shelf.search(expression, label=label, kind=Kind.RECIPE)


def _best_first(details: NeedDetails) -> list[Found]:
    """Sort search results by rank, then entries about the class itself or models of it first, then by rating."""

    def rank(found: Found) -> tuple[float, bool, float]:
        subjects = (found.entry.about, *(target for prop, target in found.links if local_name(prop) == MODELS))
        return (
            details.rank(found),
            details.iri not in subjects,
            -(UNRATED if found.entry.rating is None else found.entry.rating),
        )

    return sorted(details.search(), key=rank)


def _required(finding: Finding) -> Need:
    """Name of a requirement's need: kind, number and IRI, or, for an expression, its text and the IRIs in it."""
    if finding.iri is None:
        return " ".join([finding.kind.value, finding.text, *(one.iri for one in finding.below if one.iri is not None)])
    number = finding.text.rpartition(" ")[0]
    return " ".join(filter(None, (finding.kind.value, number, finding.iri)))


def _own(need: Need, ways: Sequence[tuple[str, tuple[Need, ...]]]) -> tuple[Offer, ...]:
    """Make offers of the robot itself for a need, of names and dependencies; their identifiers are the need's alone."""
    return tuple(Offer(f"own {need} {number}", name, needs, True) for number, (name, needs) in enumerate(ways))


def _general(need: Need) -> Need:
    """Strip a need of its preferences."""
    return need.partition(FOR)[0]


def _normalised(text: str) -> str:
    return "".join(one for one in local_name(text).casefold() if one.isalnum())


def _is_called(found: Found, name: str) -> bool:
    entry = found.entry
    return name in (entry.uid, entry.about) or _normalised(name) in map(_normalised, (entry.about, entry.label))


def _spellings(name: str) -> tuple[str, ...]:
    local = local_name(name)
    return tuple(dict.fromkeys((local.replace("_", " "), _normalised(name.partition(".")[0]), _normalised(name))))
