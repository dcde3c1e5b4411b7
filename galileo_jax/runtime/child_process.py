"""A process that ends with the one that started it, however that ends."""

import multiprocessing
import os
import threading


def end_with_parent() -> None:
    """Ends this process, without waiting for its work, as soon as its parent has ended."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
