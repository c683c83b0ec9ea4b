"""How Sphinx builds the documentation: ``make docs``."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "extensions"))

PROJECT = tomllib.loads((HERE.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]

project = PROJECT["name"]
author = PROJECT["authors"][0]["name"]
version = release = PROJECT["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.intersphinx", "manchester"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["examples", "extensions"]

html_theme = "furo"
html_title = f"planlang {version}"
html_show_copyright = False
html_copy_source = False

myst_enable_extensions = ["attrs_block", "colon_fence", "deflist"]
myst_heading_anchors = 4

# Docstrings name parameters in double backticks, and give types by annotations alone.
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
# Functions of the library show the options of a command, which are not in their own source: autodoc looks there for
# the text of defaults.
autodoc_preserve_defaults = False
python_use_unqualified_type_names = True

# Fetching inventories needs a network; links to Python's documentation are for builds that have one.
intersphinx_mapping = {}
nitpicky = True
# Types in signatures that are not public, or stand in the documentation of Python. What prose names has to be there.
nitpick_ignore_regex = [
    ("py:class", r"(collections|enum|executive|os|pathlib|random|typing)\..*|(dict|tuple)\[.*"),
    ("py:class", r"planlang\.\w+\..+|[A-Z]\w*"),
]
