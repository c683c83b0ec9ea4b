"""Fixtures shared by all tests."""

import gc
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from tests.support.extras import HAS_PR2, WITHOUT_PR2

# no test is timed; continuous integration tries the same examples each time, everybody else new ones
settings.register_profile(
    "planlang",
    max_examples=100 if "PLANLANG_EXAMPLES" in os.environ else 30,
    deadline=None,
    derandomize="CI" in os.environ,
    print_blob=True,
)
settings.load_profile("planlang")

# a shell lets what it runs in the background ignore Ctrl-C, and so would the processes that tests interrupt
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

TESTS = Path(__file__).resolve().parent
CORPUS = Path(__file__).resolve().parents[2] / "shared" / "corpus"


@pytest.fixture(scope="session")
def corpus() -> Path:
    """The folder of real OWL files; the test is skipped where it is absent."""
    if not CORPUS.is_dir():
        pytest.skip("the corpus of real OWL files is not beside this checkout")
    return CORPUS


# what libraries and worlds leave is looked through less often: a tenth of the suite's time
gc.set_threshold(20_000, 10, 10)

COSTLY = ("native", "reachability", "spheres")
"""Kinds of cached things that take seconds to make and are named by what they depend on."""


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory, pytestconfig: pytest.Config) -> Iterator[None]:
    """Tests, and the processes that they start, have a cache of their own; what is costly is kept between sessions."""
    before = os.environ.get("XDG_CACHE_HOME")
    folder = tmp_path_factory.mktemp("cache")
    provider = getattr(pytestconfig, "cache", None)  # there is none with -p no:cacheprovider
    if provider is not None:
        kept = provider.mkdir("planlang")
        for kind in COSTLY:
            (kept / kind).mkdir(exist_ok=True)
            (folder / "planlang").mkdir(exist_ok=True)
            (folder / "planlang" / kind).symlink_to(kept / kind)
    os.environ["XDG_CACHE_HOME"] = str(folder)
    yield
    if before is None:
        del os.environ["XDG_CACHE_HOME"]
    else:
        os.environ["XDG_CACHE_HOME"] = before


@pytest.fixture(scope="session", autouse=True)
def no_certificates(tmp_path_factory: pytest.TempPathFactory) -> None:
    """No test asks a server by HTTPS, and each client would read all certificates of authorities, 25 ms."""
    os.environ["SSL_CERT_DIR"] = str(tmp_path_factory.mktemp("certificates"))


LONGEST = (
    "repository/test_documentation.py",
    "executive/test_locate.py",
    "executive/library/test_functions.py",
    "executive/test_resuming.py",
    "executive/report/test_page_in_browser.py",
    "executive/pictures/test_recording.py",
    "diagnostics/test_diagnostic_files.py",
    "executive/cli/test_show.py",
    "executive/modules/test_containers.py",
    "planlang/recipe/test_fixes.py",
    "executive/modules/test_grasping.py",
    "executive/robots/test_matching.py",
    "executive/serving/test_commands.py",
    "executive/test_running.py",
    "executive/locations/test_base_places.py",
    "executive/serving/test_page.py",
    "executive/enabling/test_alternatives.py",
)
"""Files that take longest: begun first, so that at the end no worker waits for another."""


def pytest_configure(config: pytest.Config) -> None:
    """Files are handed out in our order, not by the number of their tests."""
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files first; what needs the PR2 is skipped where its URDF is not there."""
    ranks = {TESTS / name: rank for rank, name in enumerate(LONGEST)}
    items.sort(key=lambda item: ranks.get(item.path, len(ranks)))
    if not HAS_PR2:
        for item in items:
            if item.get_closest_marker("pr2") is not None:
                item.add_marker(pytest.mark.skip(reason=WITHOUT_PR2))


WHOLE_HEAP = ("kernel", "language", "testing")
"""Folders of tests of what a run leaves in memory: there all of it is looked through, what was imported, too."""


class Frozen:
    """Whether collections of garbage pass over what was there before: counting the objects would take long."""

    now = False


@pytest.fixture(scope="module", autouse=True)
def own_garbage(request: pytest.FixtureRequest) -> None:
    """Elsewhere collections of garbage pass over what was there before: tests, libraries, and what they hold."""
    whole = request.path.is_relative_to(TESTS / "planlang") and request.path.parent.name in WHOLE_HEAP
    if whole and Frozen.now:
        gc.unfreeze()
    elif not whole and not Frozen.now:
        gc.freeze()
    Frozen.now = not whole
