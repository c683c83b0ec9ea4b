"""The names that plans import, and the functions of planlang as a library.

A face on top of everything, imported on first use of a name: nothing inside imports a name from here, and whoever needs
one module of planlang, such as ``planlang.geometry``, loads that alone. The names are those of ``planlang.authoring``.
"""

from typing import TYPE_CHECKING

# The library's functions stay out of __all__: `from planlang import *` in a plan would hide Python's own compile.
if TYPE_CHECKING:
    from executive.keywords import check as check
    from executive.keywords import compile as compile
    from executive.keywords import locate as locate
    from executive.keywords import simulate as simulate
    from executive.keywords import sweep as sweep
    from planlang.authoring import *  # noqa: F403  its __all__ is checked
    from planlang.authoring import BadInput as BadInput

    __version__: str
else:  # with a __getattr__ in its sight, mypy would accept any name

    def __getattr__(name: str) -> object:
        if name == "__version__":
            from importlib.metadata import version  # slow to import, and hardly ever asked for

            return version("planlang")
        if name in ("check", "compile", "locate", "simulate", "sweep"):
            import executive.keywords as home  # here and below: nothing is loaded before it is asked for
        else:
            import planlang.authoring as home  # not `from planlang`: that would ask here for authoring
        try:
            return getattr(home, name)
        except AttributeError:
            raise AttributeError(f"module 'planlang' has no attribute {name!r}") from None

    def __dir__() -> list[str]:
        return sorted(
            {*globals(), *__getattr__("__all__"), "BadInput", "check", "compile", "locate", "simulate", "sweep"}
        )
