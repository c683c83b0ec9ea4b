"""Try public robots: draft them from their URDFs, compare that with what their makers say, let them bring a bottle.

    python -m tests.benchmarks.robots_tried FOLDER [--truth FILE] [--only NAME,...] [--until draft]
        [--docs PAGE] [--pictures FOLDER]

FOLDER holds the unpacked packages. Of the robots of ``truth.toml`` those are tried that lie there; with ``--truth ''``,
every URDF below FOLDER. Each stage has a process with limits: drafting (180 s of CPU, 2 GB), bringing a bottle from a
table of 0.75 m to a person (``--seconds``), and inspecting; what exceeds them is a line. ``--docs`` writes the tables
into a page and the picture of all robots beside it. ``--pictures FOLDER`` keeps one picture of each robot and of its
reach, its robot file and its row: what was found there by the same code is not tried again.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image, ImageDraw

from executive.processes.workers import Limits
from executive.sweeps import run as sweep
from executive.sweeps.records import Done
from tests.benchmarks.homes.table import documented
from tests.benchmarks.robots_tried.kept import Kept
from tests.benchmarks.robots_tried.table import BEGIN, END, page
from tests.benchmarks.robots_tried.trial import OPENS, SIZE

TRUTH = Path(__file__).with_name("truth.toml")
DRAFTING = Limits(seconds=180, memory=2_000_000_000, wall=1800.0)
INSPECTING = Limits(seconds=180, memory=3_000_000_000, wall=1800.0)
STAGES = ("draft", "bring", "inspect")
COLUMNS = 9
"""Robots in a row of the picture of all."""
Robots = Mapping[str, Mapping[str, Any]]


def robots_in(folder: Path, truth: Path | None, only: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return what is known of the robots to be tried, by name; ``urdf`` is a path."""
    if truth is not None:
        known = tomllib.loads(truth.read_text(encoding="utf-8"))
        found = {name: table | {"urdf": str(folder / table["urdf"])} for name, table in known.items()}
        for name in [name for name, table in found.items() if not Path(table["urdf"]).is_file()]:
            print(f"{name}: {found.pop(name)['urdf']} is not there")
    else:
        files = sorted(folder.rglob("*.urdf"))
        found = {path.relative_to(folder).with_suffix("").as_posix(): {"urdf": str(path)} for path in files}
    return {name: table for name, table in found.items() if not only or name in only}


def tried(
    robots: Robots,
    folder: Path,
    jobs: int,
    seconds: int,
    pictures: Path | None,
    *,
    reused: bool = False,
    until: str = STAGES[-1],
) -> list[dict[str, Any]]:
    """Try robots, in three stages; return a row for each. ``folder`` receives robot files, pictures, and rows.

    With ``reused``, stages are not repeated whose results lie there, found by the same code with the same limits.
    ``until`` is the last stage; of later ones, only such results are taken.
    """
    rows: dict[str, dict[str, Any]] = {name: {"world": name, "truth": dict(one)} for name, one in robots.items()}
    worlds = {name: _world(name, one, folder, pictures) for name, one in robots.items()}
    kept = Kept(f"{seconds}" if reused else None)

    def stage(job: str, limits: Limits, names: Sequence[str]) -> None:
        def added(name: str, found: dict[str, Any]) -> None:
            rows[name].update({"unreached": found} if job == "inspect" and "reach" not in found else found)

        def told(done: Done) -> None:
            name = done.row["world"]
            found = {key: value for key, value in done.row.items() if key not in ("world", "repeat")}
            if found.get("outcome") == "crashed":
                found = {"crashed": found.get("message", "its process ended")}
            added(name, found)
            kept.keep(worlds[name], job, found)
            print(f"{job} {name}: {done.seconds:.0f} s {_short(found)}", flush=True)

        there = {name: found for name in names if (found := kept.found(worlds[name], job)) is not None}
        for name, found in there.items():
            added(name, found)
        is_late = STAGES.index(job) > STAGES.index(until)
        missing = [] if is_late else [name for name in names if name not in there]
        chosen = [worlds[name] | {key: rows[name].get(key) for key in ("fixed", "camera", "arms")} for name in missing]
        sweep(chosen, f"tests.benchmarks.robots_tried.trial:{job}_job", processes=jobs, limits=limits, told=told)

    stage("draft", DRAFTING, list(rows))
    able = [
        name for name, row in rows.items() if any((a["opening"] or 0) > OPENS for a in row.get("arms", {}).values())
    ]
    stage("bring", Limits(seconds=seconds, memory=4_000_000_000, wall=20.0 * seconds), able)
    stage("inspect", INSPECTING, [name for name, row in rows.items() if "cpu" in row])
    return list(rows.values())


def _world(name: str, truth: Mapping[str, Any], folder: Path, pictures: Path | None) -> dict[str, Any]:
    stem = name.replace("/", "-")
    reach = str(pictures / f"{stem}_reach.png") if pictures else ""
    picture = str((pictures or folder) / f"{stem}.png")
    return {
        "world": name, "urdf": truth["urdf"], "file": str(folder / f"{stem}.toml"), "truth": dict(truth),
        "picture": picture, "reach": reach,
    }  # fmt: skip


def _short(found: Mapping[str, Any]) -> str:
    for key in ("crashed", "internal", "refused", "differs"):
        if found.get(key):
            return f"{key}: {found[key]}"[:300]
    return "brings it" if found.get("reached") else str(found.get("message", ""))[:300]


def sheet_of(rows: Sequence[Mapping[str, Any]], folder: Path) -> Image.Image:
    """Return one picture of all robots that could be drawn, with their names."""
    drawn = [(row["world"], folder / f"{row['world'].replace('/', '-')}.png") for row in rows]
    drawn = [(name, path) for name, path in drawn if path.is_file()]
    wide, tall = SIZE[0], SIZE[1] + 14
    sheet = Image.new("RGB", (wide * COLUMNS, tall * -(-max(1, len(drawn)) // COLUMNS)), "white")
    for number, (name, path) in enumerate(drawn):
        row, column = divmod(number, COLUMNS)
        sheet.paste(Image.open(path), (wide * column, tall * row))
        ImageDraw.Draw(sheet).text((wide * column + 4, tall * row + SIZE[1]), name, fill="black")
    return sheet


def main() -> int:
    """Try what was asked for, and print or write the page."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--truth", default=str(TRUTH), help="what the robots are; '': try every URDF of the folder")
    parser.add_argument("--only", default="", help="names of robots, with commas between")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seconds", type=int, default=120, help="CPU time for bringing the bottle [s]")
    parser.add_argument("--until", choices=STAGES, default=STAGES[-1], help="last stage (default: %(default)s)")
    parser.add_argument("--docs", type=Path, default=None, help="page that receives the tables")
    parser.add_argument("--pictures", type=Path, default=None, help="folder that keeps pictures, robot files and rows")
    given = parser.parse_args()
    only = [name for name in given.only.split(",") if name]
    robots = robots_in(given.folder, Path(given.truth) if given.truth else None, only)
    with TemporaryDirectory() as name:
        folder = given.pictures or Path(name)
        folder.mkdir(parents=True, exist_ok=True)
        pictures = given.pictures and folder.resolve()
        rows = tried(
            robots, folder.resolve(), given.jobs, given.seconds, pictures, reused=bool(pictures), until=given.until
        )
        text = "\n".join(page(rows))
        if given.docs is None:
            print(text)
        else:
            given.docs.write_text(
                documented(given.docs.read_text(encoding="utf-8"), text, BEGIN, END), encoding="utf-8"
            )
            images = given.docs.parent.parent / "images"
            sheet_of(rows, folder).save(images / f"{given.docs.stem}.webp", quality=70)
    return 0


if __name__ == "__main__":
    sys.exit(main())
