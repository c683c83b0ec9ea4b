"""What the README says of diagnostic codes and of the command is what the program says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from planlang.diagnostics import CODES

CHECKOUT = Path(__file__).resolve().parents[2]
README = (CHECKOUT / "README.md").read_text(encoding="utf-8")


def test_the_table_of_codes_is_the_programs() -> None:
    rows = re.findall(r"^\| `([A-Z]\d{3})` \| (.+?) \|$", README, flags=re.MULTILINE)
    wanted = "\n".join(f"| `{code}` | {meaning} |" for code, meaning in sorted(CODES.items()))
    assert rows == sorted(CODES.items()), f"the README's table of codes should be:\n{wanted}"


@pytest.mark.parametrize("code", sorted(CODES))
def test_a_code_is_used_and_its_meaning_fits_in_a_line(code: str) -> None:
    assert re.fullmatch(r"[A-Z]\d{3}", code)
    assert CODES[code]
    assert "\n" not in CODES[code]
    sources = [path for package in ("planlang", "executive", "sim") for path in (CHECKOUT / package).rglob("*.py")]
    uses = [path for path in sources if path.name != "diagnostics.py" and f'"{code}"' in path.read_text("utf-8")]
    assert uses, f"nothing in the program says {code}"


def test_every_folder_that_the_readme_lists_is_there() -> None:
    listed = re.findall(r"^([a-z_]+/[a-z_/]*) {2,}", README, flags=re.MULTILINE)
    assert listed
    assert [folder for folder in listed if not (CHECKOUT / folder).is_dir()] == []
