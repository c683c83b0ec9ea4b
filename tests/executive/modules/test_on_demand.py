"""The table of process modules that are imported on demand. Run as a program, this file writes the table."""

import json
from importlib import import_module

from executive.modules.bundled import AT_ONCE, TABLE
from planlang.registry import marked


def table() -> str:
    """Build the table's JSON from the current classes."""
    folder, at_once = TABLE.parent, [module.__name__ for module in AT_ONCE]
    files = (file.relative_to(folder).with_suffix("") for file in folder.rglob("*.py") if file.stem != "__init__")
    names = (f"executive.modules.{'.'.join(file.parts)}" for file in files)
    rows = [
        {
            "place": f"{module.__name__}:{cls.__name__}",
            "name": cls.name,
            "actions": list(cls.actions),
            "failures": [kind.__name__ for kind in cls.failures],
        }
        for module in map(import_module, sorted(name for name in names if name not in at_once))
        for cls in marked(module)
    ]
    return json.dumps(rows, indent=2) + "\n"


def test_the_table_says_what_the_classes_say() -> None:
    assert TABLE.read_text("utf-8") == table(), "python -m tests.executive.modules.test_on_demand writes it"


if __name__ == "__main__":
    TABLE.write_text(table(), encoding="utf-8")
