"""The names that plans import, and the functions of planlang as a library.

A face on top of everything, imported on first use of a name: nothing inside imports a name from here, and whoever needs
one module of planlang, such as ``planlang.geometry``, loads that alone. The names are those of ``planlang.authoring``.
"""

from typing import TYPE_CHECKING

# The library's functions stay out of __all__: `from planlang import *` in a plan would hide Python's own compile.
if TYPE_CHECKING:
    from executive.keywords import check as check
    from executive.keywords import compare as compare
    from executive.keywords import compile as compile
    from executive.keywords import locate as locate
    from executive.keywords import simulate as simulate
    from executive.keywords import sweep as sweep
    from planlang.authoring import *  # noqa: F403

    __version__: str
else:  # with a __getattr__ in its sight, mypy would accept any name
    from importlib import import_module

    _FUNCTIONS = ("check", "compare", "compile", "locate", "simulate", "sweep")
    _HOMES = {"__version__": "importlib.metadata", **dict.fromkeys(_FUNCTIONS, "executive.keywords")}

    def __getattr__(name: str) -> object:
        home = import_module(_HOMES.get(name, "planlang.authoring"))  # nothing is loaded before it is asked for
        if name == "__version__":
            return home.version("planlang")
        if name == "__all__":
            return [one for one in vars(home) if not one.startswith("_") and one != "BadInput"]
        try:
            return getattr(home, name)
        except AttributeError:
            raise AttributeError(f"module 'planlang' has no attribute {name!r}") from None

    def __dir__() -> list[str]:
        return sorted({*globals(), *__getattr__("__all__"), "BadInput", *_FUNCTIONS})
