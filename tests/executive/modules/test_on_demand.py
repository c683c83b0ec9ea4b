"""The table of process modules that are imported on demand."""

from executive.modules.bundled import TABLE, table


def test_the_table_says_what_the_classes_say() -> None:
    assert TABLE.read_text(encoding="utf-8") == table(), "python -m executive.modules.bundled writes it"
