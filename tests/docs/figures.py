"""What README, tutorial and gallery print and draw, made again in a folder; what differs.

    python -m tests.docs.figures build/figures    # make figures

Words have to be the same; numbers may differ by a last digit, places in a picture by a pixel. The
gallery is made from the journal of `python -m benchmarks people`, and what this lacks from
../shared/data; where that is absent too, it is left out, and a line says so.
"""

import difflib
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

from benchmarks import people
from tests.docs import console
from tests.docs.pages import ROOT

TUTORIAL = Path("docs") / "tutorial" / "find_what_is_missing.md"
GALLERY = Path("docs") / "explanation" / "gallery.md"
DEMO = "galileo simulate --seed 7 --out demo/clip.mp4"
FIT = "galileo fit demo/clip.mp4 --method grad --out demo/grad"
FITTED = re.compile(r"((?:    .*\n)+)(?=\n`k1` and `k2` are)")
SECONDS = re.compile(r" \d+ \|$", re.MULTILINE)  # of the gallery: a busy machine is slower
PIXEL = 1.0


def main(folder: str) -> int:
    """Makes all of it, prints what differs, and returns whether anything does."""
    made = Path(folder).resolve()
    shutil.rmtree(made, ignore_errors=True)
    shutil.copytree(ROOT / "docs", made / "docs", ignore=shutil.ignore_patterns("notebooks"))
    shutil.copy(ROOT / "README.md", made)
    make_readme(made)
    make_tutorial(made)
    make_gallery(made)
    found = [*changed_pages(made), *changed_pictures(made)]
    print("\n".join(found) or "Nothing differs.")
    return int(bool(found))


def make_readme(made: Path) -> None:
    """The demo's block, and the two pictures of its velocities."""
    console.run(DEMO, made)
    lines = console.run(FIT, made).splitlines()
    page = made / "README.md"
    page.write_text(
        FITTED.sub(lambda _: "".join(f"    {one}\n" for one in lines), page.read_text())
    )
    console.run("galileo export demo/grad --to svg --out demo/plots", made)
    for name in ("velocity_object1", "velocity_object2"):
        shutil.copy(made / f"demo/plots/{name}_x.svg", made / f"docs/images/{name}.svg")


def make_tutorial(made: Path) -> None:
    """What the tutorial's commands print, and its picture."""
    console.main(str(made / TUTORIAL))
    simulate, _, diagnose, *_ = console.shown_commands((made / TUTORIAL).read_text())
    console.run(simulate.command, made)
    console.run(f"{diagnose.command} --svg --out drag", made)
    plot = made / "drag" / "plots" / "before_after_drag_object1_air_drag.svg"
    shutil.copy(plot, made / "docs" / "images" / "before_after.svg")


def make_gallery(made: Path) -> None:
    """The gallery's table and pictures."""
    if people.JOURNAL.is_file() or people.FOLDER.is_dir():
        people.main("gallery", docs=made / "docs")
    else:
        print(f"gallery: left out; neither {people.JOURNAL} nor {people.FOLDER} is there")


def changed_pages(made: Path) -> Iterator[str]:
    """A unified diff of each page that says something else."""
    for path in (Path("README.md"), TUTORIAL, GALLERY):
        old, new = (SECONDS.sub("", (at / path).read_text()) for at in (ROOT, made))
        if console.differences(old, new):
            lines = difflib.unified_diff(
                old.splitlines(),
                new.splitlines(),
                f"{path} as it is",
                "made again",
                lineterm="",
                n=0,
            )
            yield "\n".join(lines)


def changed_pictures(made: Path) -> Iterator[str]:
    """A line for each SVG that shows something else."""
    for path in sorted((made / "docs" / "images").rglob("*.svg")):
        old = ROOT / path.relative_to(made)
        if not old.is_file() or not is_alike(old.read_text(), path.read_text()):
            yield f"{path.relative_to(made)}: another picture"


def is_alike(old: str, new: str) -> bool:
    """Whether two SVGs have the same words and their numbers are within a pixel."""
    plain = [re.sub(r'(?<=[#"(])[pm][0-9a-f]{10}', "", one) for one in (old, new)]  # ids: hashes
    (words, numbers), (other_words, other_numbers) = map(console.taken_apart, plain)
    return words == other_words and all(
        abs(float(a) - float(b)) <= PIXEL for a, b in zip(numbers, other_numbers, strict=True)
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
