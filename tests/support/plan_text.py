"""The text of a compiled plan without its layout."""

import ast


def unbroken(source: str) -> str:
    """Each statement on one line as ``ast.unparse`` writes it: strings in single quotes, no comments."""
    return ast.unparse(ast.parse(source))
