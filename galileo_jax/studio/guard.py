"""Who may talk to the studio: the browser on this machine that was given the token, nobody else.

Every request, of the web socket too, passes here before anything else looks at it.

- Host must be this machine under this port, so that a name that somebody else's server resolves to
  127.0.0.1 (DNS rebinding) is refused.
- Origin, where a browser sends one, must be the studio's own; a web socket must send one.
- The token of the address that was printed, once; then a cookie that other sites cannot send.
- A body beyond the limit is refused before it is read, and while it is read.
"""

import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

from galileo_jax.studio.upload import LARGEST_BYTES, UPLOAD

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

LARGEST_BODY = 2_000_000  # of requests that upload nothing
POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self' ws: wss:; frame-ancestors 'none'; base-uri 'none'; form-action 'self'"
)
HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-frame-options", b"DENY"),
    (b"content-security-policy", POLICY.encode()),
)


class _TooLarge(Exception):  # noqa: N818 - an answer, raised through the app that reads
    pass


class Guard:
    """Wraps an ASGI application."""

    def __init__(self, app: App, *, port: int, token: str) -> None:
        self._app, self._token = app, token
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._cookie = f"galileo_studio_{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Lets a request through, or answers it."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {
            key.decode("latin-1").lower(): v.decode("latin-1") for key, v in scope["headers"]
        }
        if why := self._refusal(scope, headers):
            await _refuse(scope, receive, send, 403, why)
        elif scope["type"] == "websocket":
            await self._app(scope, receive, send)
        elif self._is_entrance(scope):
            await self._enter(send)
        else:
            await self._http(scope, headers, receive, send)

    def _refusal(self, scope: Scope, headers: MutableMapping[str, str]) -> str:
        """Why a request is refused; empty where it is not."""
        if headers.get("host", "") not in self._hosts:
            return "another host"
        origin = headers.get("origin")
        if origin is None and scope["type"] == "websocket":
            return "no origin"
        if origin is not None and origin not in {f"http://{host}" for host in self._hosts}:
            return "another origin"
        if self._has_cookie(headers.get("cookie", "")) or self._is_entrance(scope):
            return ""
        return "no token: open the address that galileo studio printed"

    def _is_entrance(self, scope: Scope) -> bool:
        if scope["type"] != "http" or scope["method"] != "GET" or scope["path"] != "/":
            return False
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        return any(self._is_token(one) for one in query.get("token", []))

    def _has_cookie(self, header: str) -> bool:
        try:
            found = SimpleCookie(header).get(self._cookie)
        except CookieError:
            return False
        return found is not None and self._is_token(found.value)

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), self._token.encode())

    async def _enter(self, send: Send) -> None:
        """The token is taken out of the address, so that it stands in no history."""
        cookie = f"{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict"
        headers = [(b"location", b"/"), (b"set-cookie", cookie.encode()), *HEADERS]
        await send({"type": "http.response.start", "status": 303, "headers": headers})
        await send({"type": "http.response.body", "body": b""})

    async def _http(
        self, scope: Scope, headers: MutableMapping[str, str], receive: Receive, send: Send
    ) -> None:
        limit = LARGEST_BYTES if scope["path"].startswith(UPLOAD) else LARGEST_BODY
        too_large = f"larger than {limit // 1_000_000} MB"
        length = headers.get("content-length", "0")
        if not length.isdecimal() or int(length) > limit:
            await _refuse(scope, receive, send, 413, too_large)
            return
        read, has_begun = 0, False

        async def counted() -> MutableMapping[str, Any]:
            nonlocal read
            message = await receive()
            read += len(message.get("body", b""))
            if read > limit:
                raise _TooLarge
            return message

        async def sending(message: MutableMapping[str, Any]) -> None:
            nonlocal has_begun
            if message["type"] == "http.response.start":
                has_begun = True
                message["headers"] = [*message.get("headers", []), *HEADERS]
            await send(message)

        try:
            await self._app(scope, counted, sending)
        except _TooLarge:
            if not has_begun:
                await _refuse(scope, receive, send, 413, too_large)


async def _refuse(scope: Scope, receive: Receive, send: Send, status: int, why: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008, "reason": why})
        return
    body = f"{why}\n".encode()
    headers = [
        (b"content-type", b"text/plain; charset=utf-8"),
        (b"content-length", str(len(body)).encode()),
        (b"connection", b"close"),
        *HEADERS,
    ]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
