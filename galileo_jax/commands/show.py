"""Shows a picture to whoever sits at the terminal, where there is a display."""

import contextlib
import os
import sys
import threading
import webbrowser
from pathlib import Path


def has_display() -> bool:
    """Whether a window can be opened here."""
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def show(picture: Path) -> None:
    """Opens a picture where there is a display; never waits for it, and never fails."""
    if not has_display():
        return

    def open_it() -> None:
        with contextlib.suppress(Exception):  # whatever a desktop does: the path has been said
            webbrowser.open(picture.resolve().as_uri())

    threading.Thread(target=open_it, daemon=True).start()
