"""`galileo studio`: a film or table explained, and its parts, in one page on this machine."""

from collections.abc import Sequence
from pathlib import Path

from galileo_jax.commands import command
from galileo_jax.commands.options import VerbParser, whole_number


def main(argv: Sequence[str]) -> None:
    """Serves the page until Ctrl-C; prints its address."""
    call = _parser().parse_args(argv)
    from galileo_jax.studio.server import serve

    def announce(address: str) -> None:
        print(address, flush=True)
        command.say("Only this address opens it; Ctrl-C ends it. Everything is saved at once.")

    serve(call.source, port=call.port, browser=call.browser, announce=announce)


def _parser() -> VerbParser:
    parser = VerbParser(
        "studio",
        __doc__,
        "galileo studio clip.mp4                               one film, or a table",
        "galileo studio trials/ --no-browser                   a folder of trials",
    )
    parser.add_argument(
        "source",
        nargs="?",
        default=Path("."),
        type=Path,
        metavar="FILE|FOLDER",
        help="a film, a table, or a folder with films (default: this folder)",
    )
    parser.add_argument(
        "--port",
        type=whole_number(1),
        default=None,
        metavar="N",
        help="of this machine (default: the first free one from 8642 on)",
    )
    parser.add_argument(
        "--no-browser",
        dest="browser",
        action="store_false",
        default=True,
        help="print the address, open no browser (default: off)",
    )
    return parser
