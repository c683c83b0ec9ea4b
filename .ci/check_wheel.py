"""Check what is in the wheel: the packages and all of their data, and nothing of the repository besides."""

import sys
import zipfile
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
PACKAGES = ("planlang", "executive", "sim")
ENTRY_POINT = "planlang_command.py"
DATA = ("ontologies", "recipes")

names = {name for name in zipfile.ZipFile(sys.argv[1]).namelist() if ".dist-info/" not in name}
expected = (
    {
        path.relative_to(CHECKOUT).as_posix()
        for package in PACKAGES
        for path in (CHECKOUT / package).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    | {ENTRY_POINT}
    | {
        f"planlang/data/{path.relative_to(CHECKOUT).as_posix()}"
        for folder in DATA
        for path in (CHECKOUT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
)
missing, superfluous = sorted(expected - names), sorted(names - expected)
if missing or superfluous:
    sys.exit(f"wheel: missing {missing}; superfluous {superfluous}")
print(f"{len(names)} files in the wheel")
