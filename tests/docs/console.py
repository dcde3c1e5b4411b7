"""The commands shown in a page, with what they print: read, run, compared and brought up to date.

    python -m tests.docs.console docs/tutorial/find_what_is_missing.md

runs every command of the page in a temporary folder and writes what it prints into the page.
"""

import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

BLOCK = re.compile(r"^```console\n\$ (?P<command>.*)\n(?P<printed>(?:.*\n)*?)```$", re.MULTILINE)
NUMBER = re.compile(r"(?<![A-Za-z_])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
# No digit is shown below the Monte Carlo error, and processors differ by less
# (docs/explanation/posterior.md): enough to round one last digit otherwise, not two. The tutorial
# is the same to the letter under SSE4_2 and AVX2.
LAST_DIGITS = 1


@dataclass(frozen=True)
class Shown:
    """A command and what the page says that it prints."""

    command: str
    printed: str


def shown_commands(page: str) -> list[Shown]:
    """The console blocks of a page, in order."""
    return [
        Shown(found["command"], found["printed"].rstrip("\n")) for found in BLOCK.finditer(page)
    ]


def run(command: str, folder: Path) -> str:
    """What a shell prints to stdout for a command, with this package's `galileo` on its PATH.

    Raises:
      subprocess.CalledProcessError: the exit code is not 0.
    """
    root = Path(__file__).resolve().parents[2]
    programs = folder / ".bin"
    programs.mkdir(exist_ok=True)
    galileo = programs / "galileo"
    galileo.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m galileo_jax "$@"\n')
    galileo.chmod(0o755)
    environment = os.environ | {
        "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(root),
        "COLUMNS": "100",
    }
    done = subprocess.run(
        command, shell=True, cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout.rstrip("\n")


def differences(expected: str, printed: str) -> list[str]:
    """Lines that differ in words, or in a number by more than a last digit."""
    said, found = expected.splitlines(), printed.splitlines()
    if len(said) != len(found):
        return [f"{len(said)} lines on the page, {len(found)} printed:\n{printed}"]
    return [
        f"page:    {one}\nprinted: {other}"
        for one, other in zip(said, found, strict=True)
        if not _is_alike(one, other)
    ]


def _is_alike(one: str, other: str) -> bool:
    words, numbers = taken_apart(one)
    other_words, other_numbers = taken_apart(other)
    return words == other_words and all(
        abs(float(a) - float(b)) <= 1.001 * _tolerance(a)  # decimals are not exact
        for a, b in zip(numbers, other_numbers, strict=True)
    )


def taken_apart(line: str) -> tuple[list[str], list[str]]:
    """Words, with a mark where a number is, and the numbers."""
    return NUMBER.sub("#", line).split(), NUMBER.findall(line)


def _tolerance(text: str) -> float:
    """One of a number's last digit; whole numbers must agree."""
    mantissa, _, exponent = text.partition("e")
    decimals = len(mantissa.partition(".")[2])
    return LAST_DIGITS * 10.0 ** (int(exponent or 0) - decimals) if decimals else 0.0


def main(path: str) -> None:
    """Writes what the commands of a page print into the page."""
    page = Path(path)
    text = page.read_text()
    with tempfile.TemporaryDirectory() as folder:
        for shown in shown_commands(text):
            printed = run(shown.command, Path(folder))
            print(f"$ {shown.command}\n{printed}")
            before = f"```console\n$ {shown.command}\n{shown.printed}\n```"
            text = text.replace(before, f"```console\n$ {shown.command}\n{printed}\n```")
    page.write_text(text)


if __name__ == "__main__":
    main(sys.argv[1])
