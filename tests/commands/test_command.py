"""What every command does when it ends."""

import subprocess
import sys

TALKS = """
import sys
from galileo_jax.commands import command
sys.exit(command.run(lambda _: print("line\\n" * 100_000), []))
"""


def test_a_reader_who_leaves_is_no_error():
    with subprocess.Popen(
        [sys.executable, "-c", TALKS], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        assert process.stdout.readline() == "line\n"
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 141
