"""The server: this machine only, behind the guard, with the page, the frames and uploads."""

import asyncio
import contextlib
import secrets
import signal
import socket
import webbrowser
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

from galileo_jax.clip.file_kinds import is_film, is_track, is_yaml
from galileo_jax.runtime.errors import InputError
from galileo_jax.studio import results
from galileo_jax.studio.guard import Guard
from galileo_jax.studio.session import Session
from galileo_jax.studio.upload import UPLOAD, receive

HOST = "127.0.0.1"
FIRST_PORT, NUM_PORTS = 8642, 20


def serve(
    source: Path, *, port: int | None, browser: bool, announce: Callable[[str], object]
) -> None:
    """Serves the studio until it is interrupted; `announce` is given the address when it listens.

    `source`: a clip, or a folder with clips. `port`: None: the first free one from 8642 on.

    Raises:
      InputError: there is no such file or folder, the port is taken, or NiceGUI is missing.
    """
    root, clip = _source(source)
    listening = _listening(port)
    number = listening.getsockname()[1]
    token = secrets.token_urlsafe(24)
    app, session = _app(root, clip, number, token)
    import uvicorn

    config = uvicorn.Config(
        app, log_level="warning", ws="wsproto",
        timeout_graceful_shutdown=2, access_log=False, server_header=False,
    )  # fmt: skip
    address = f"http://{HOST}:{number}/?token={token}"

    class Server(uvicorn.Server):
        async def startup(self, sockets: list[socket.socket] | None = None) -> None:
            await super().startup(sockets)
            announce(address)
            if browser:
                await asyncio.get_running_loop().run_in_executor(None, webbrowser.open, address)

    def stop(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, stop)  # so that the worker is ended in any case
    try:
        with contextlib.suppress(KeyboardInterrupt):
            Server(config).run(sockets=[listening])
    finally:
        session.close()


def _app(root: Path, clip: str | None, port: int, token: str) -> tuple[Guard, Session]:
    """The guarded application, and what its page shows."""
    try:
        from fastapi import FastAPI, Request
        from nicegui import core, ui
        from starlette.responses import PlainTextResponse, Response
    except ImportError as error:
        raise InputError(
            f"galileo studio needs NiceGUI ({error}); pip install 'galileo-jax[studio]'"
        ) from None
    from galileo_jax.studio.page import build_page

    core.sio.eio.cors_allowed_origins = [f"http://{HOST}:{port}", f"http://localhost:{port}"]
    session = Session(root, clip)
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)

    def answer(what: str, content: bytes | str | None, kind: str, **headers: str) -> Response:
        named = {key.replace("_", "-"): value for key, value in headers.items()}
        if content is None:
            return PlainTextResponse(f"no such {what}", 404)
        return Response(content, media_type=kind, headers=named)

    @app.get("/frame/{name}/{index}")
    def frame(name: str, index: int) -> Response:
        kept = "private, max-age=3600"
        return answer("frame", session.picture(name, index), "image/jpeg", cache_control=kept)

    @app.get("/still/{name}")
    def still(name: str) -> Response:
        """The first and the last frame of a clip's prediction."""
        picture = results.still(session.trials, name)
        return answer("picture", picture, "image/png", cache_control="no-store")

    @app.get("/report/{name}")
    def report(name: str) -> Response:
        """A clip's page, to be kept."""
        kept = f"attachment; filename*=utf-8''{quote(name)}.html"
        page = results.kept_page(session.trials, name)
        return answer("report", page, "text/html", content_disposition=kept)

    @app.put(UPLOAD + "{name}")
    async def upload(name: str, request: Request) -> Response:
        try:
            path = await receive(session.root, name, request.stream())
        except InputError as error:
            return PlainTextResponse(f"{error}\n", 422)
        session.add(path)
        return PlainTextResponse(f"{path.name} is there\n")

    ui.page("/")(lambda: build_page(session))
    ui.run_with(
        app, title="galileo studio", dark=None,
        storage_secret=None, show_welcome_message=False, reconnect_timeout=10.0, tailwind=False,
    )  # fmt: skip
    return Guard(app, port=port, token=token), session


def _source(path: Path) -> tuple[Path, str | None]:
    """The folder to open, and the name of the clip in it, of a table with its suffix."""
    if path.is_dir():
        return path.resolve(), None
    if not path.exists():
        raise InputError(f"{path}: no such file or folder")
    if is_yaml(path) or is_film(path):
        return path.parent.resolve(), path.stem
    if is_track(path):
        return path.parent.resolve(), path.name
    raise InputError(f"{path}: a film, a table, its yaml or a folder with films expected")


def _listening(port: int | None) -> socket.socket:
    """A socket of this machine alone.

    Raises:
      InputError: the port is taken.
    """
    tried = [port] if port is not None else range(FIRST_PORT, FIRST_PORT + NUM_PORTS)
    for number in tried:
        listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((HOST, number))
            listening.listen()  # until then another studio may be bound to it, too
        except (OSError, OverflowError):
            listening.close()
            continue
        return listening
    taken = f"{tried[0]}" if port is not None else f"{FIRST_PORT} to {FIRST_PORT + NUM_PORTS - 1}"
    raise InputError(f"--port: {taken} is in use or not a port; give another")
