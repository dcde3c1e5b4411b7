"""Attacks on a running studio: each must be refused, and leave nothing behind."""

import asyncio
import contextlib
import http.client
import json
import os
import socket
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from galileo_jax.runtime.errors import InputError
from galileo_jax.studio import results
from galileo_jax.studio.paths import below, clips, safe_name
from galileo_jax.studio.session import Session
from tests.missing import needed_module
from tests.studio.clips import clip_in
from tests.studio.tab import Server, started

pytestmark = pytest.mark.video


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    needed_module("nicegui")
    outside = tmp_path_factory.mktemp("outside")
    clip_in(outside, "secret")
    root = tmp_path_factory.mktemp("studio")
    clip_in(root)
    (root / "link.mp4").symlink_to(outside / "secret.mp4")
    return root


@pytest.fixture(scope="module")
def studio(folder):
    with started(folder) as server:
        yield server


def ask(
    studio: Server, path: str = "/", method: str = "GET", body: bytes | None = None, **headers: str
) -> tuple[int, bytes, dict[str, str]]:
    connection = http.client.HTTPConnection("127.0.0.1", studio.port, timeout=20)
    named = {key.replace("_", "-"): value for key, value in headers.items()}
    with contextlib.closing(connection):
        connection.request(method, path, body, named)
        answer = connection.getresponse()
        return answer.status, answer.read(), {k.lower(): v for k, v in answer.getheaders()}


@pytest.fixture(scope="module")
def cookie(studio) -> str:
    status, _, headers = ask(studio, f"/?token={studio.token}")
    assert status == 303 and headers["location"] == "/"
    assert "HttpOnly" in headers["set-cookie"] and "SameSite=Strict" in headers["set-cookie"]
    return headers["set-cookie"].split(";")[0]


def test_the_address_that_was_printed_opens_it(studio, cookie):
    status, body, headers = ask(studio, Cookie=cookie)
    assert status == 200 and b"galileo studio" in body
    assert headers["x-frame-options"] == "DENY"


@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=wrong", "/frame/slide/0", "/nothing"])
def test_without_the_token_nothing_is_answered(studio, path):
    assert ask(studio, path)[0] == 403


@pytest.mark.parametrize("cookie", ["galileo_studio=x", "galileo_studio_0=x", "=;;=,"])
def test_a_made_up_cookie_is_refused(studio, cookie):
    assert ask(studio, Cookie=cookie)[0] == 403


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", "file://"])
def test_another_sites_request_is_refused_even_with_the_cookie(studio, cookie, origin):
    assert ask(studio, Cookie=cookie, Origin=origin)[0] == 403
    assert ask(studio, "/upload/a.mp4", "PUT", b"x", Cookie=cookie, Origin=origin)[0] == 403


def test_another_name_of_this_machine_is_refused(studio, cookie):
    assert ask(studio, Cookie=cookie, Host=f"evil.example:{studio.port}")[0] == 403
    assert ask(studio, Cookie=cookie, Host="127.0.0.1")[0] == 403


@pytest.mark.parametrize("path", ["/_nicegui_ws/socket.io/?EIO=4&transport=websocket", "/"])
@pytest.mark.parametrize("origin", [None, "http://evil.example", "null"])
def test_the_web_socket_is_refused_to_others(studio, cookie, path, origin):
    assert not upgraded(studio, path, cookie, origin)


def test_the_web_socket_is_refused_without_the_cookie(studio, cookie):
    path = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    own = f"http://127.0.0.1:{studio.port}"
    assert not upgraded(studio, path, "", own)
    assert upgraded(studio, path, cookie, own), "else the tests above show nothing"


def upgraded(studio: Server, path: str, cookie: str, origin: str | None) -> bool:
    lines = [
        f"GET {path} HTTP/1.1", f"Host: 127.0.0.1:{studio.port}", "Connection: Upgrade",
        "Upgrade: websocket", "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
    ]  # fmt: skip
    lines += [f"Cookie: {cookie}"] if cookie else []
    lines += [f"Origin: {origin}"] if origin is not None else []
    with socket.create_connection(("127.0.0.1", studio.port), timeout=20) as line:
        line.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        return b" 101 " in line.recv(200).split(b"\r\n")[0]


def test_long_polling_of_the_socket_is_refused_to_others(studio, cookie):
    path = "/_nicegui_ws/socket.io/?EIO=4&transport=polling"
    assert ask(studio, path)[0] == 403
    assert ask(studio, path, Cookie=cookie, Origin="http://evil.example")[0] == 403


def test_it_listens_on_this_machine_alone(studio):
    # All of 127/8 is this machine: a server that listens everywhere would answer there, too.
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.2", studio.port), timeout=2).close()


@pytest.mark.parametrize("name", ["..%2Fsecret", "%2e%2e", "link", "secret", "..%2f..%2fetc"])
def test_frames_come_from_the_folders_own_clips(studio, cookie, name):
    assert ask(studio, f"/frame/{name}/0", Cookie=cookie)[0] == 404
    assert ask(studio, "/frame/slide/0", Cookie=cookie)[0] == 200


@pytest.mark.parametrize(
    ("kind", "file"), [("still", "first_and_last.png"), ("report", "report.html")]
)
def test_a_runs_picture_and_page_are_the_folders_own(studio, cookie, folder, tmp_path, kind, file):
    path, secret = folder / "runs" / "slide" / file, tmp_path / "secret"
    path.parent.mkdir(parents=True, exist_ok=True)
    assert ask(studio, f"/{kind}/slide", Cookie=cookie)[0] == 404
    path.write_text("mine")
    assert ask(studio, f"/{kind}/slide", Cookie=cookie)[:2] == (200, b"mine")
    assert ask(studio, f"/{kind}/link", Cookie=cookie)[0] == 404
    secret.write_text("not mine")
    path.unlink()
    path.symlink_to(secret)
    assert ask(studio, f"/{kind}/slide", Cookie=cookie)[0] == 404
    path.unlink()


@pytest.mark.parametrize("index", ["-1", "99999999", "x", "0.5"])
def test_a_frame_that_there_is_not(studio, cookie, index):
    assert ask(studio, f"/frame/slide/{index}", Cookie=cookie)[0] in (404, 422)


@pytest.mark.parametrize(
    "name",
    [
        "..%2Fup.mp4",
        "%2Ftmp%2Fup.mp4",
        ".hidden.mp4",
        "up.py",
        "up.mp4%00.yaml",
        "up.sh",
        "a%0a.mp4",
    ],
)
def test_names_cannot_climb_out_and_nothing_else_is_taken(studio, cookie, folder, name):
    before = sorted(folder.iterdir())
    status, _, _ = ask(studio, f"/upload/{name}", "PUT", b"x" * 50, Cookie=cookie)
    assert status in (404, 405, 422)
    assert sorted(folder.iterdir()) == before
    assert not (folder.parent / "up.mp4").exists()


def test_a_text_named_mp4_is_refused_and_gone(studio, cookie, folder):
    status, body, _ = ask(studio, "/upload/text.mp4", "PUT", b"#!/bin/sh\nrm\n" * 9, Cookie=cookie)
    assert status == 422 and b"cannot be decoded" in body
    assert not list(folder.glob("text*")) and not list(folder.glob(".upload*"))


@pytest.mark.parametrize(
    "text",
    [
        b"video: !!python/object/apply:os.system ['touch pwned']\n",
        b"scenario: ramp\nprogram: x\n",
        b"video: ../../etc/passwd\n",
        b"track: /etc/passwd\n",
        b"\xff\xfe",
        b"a: &a [*a]\n",
    ],
)
def test_a_yaml_is_read_safely(studio, cookie, folder, text):
    status, _, _ = ask(studio, "/upload/tags.yaml", "PUT", text, Cookie=cookie)
    assert status == 422
    assert not (folder / "tags.yaml").exists() and not (folder / "pwned").exists()
    assert not Path("pwned").exists()


def test_nothing_is_overwritten(studio, cookie, folder):
    before = (folder / "slide.yaml").read_bytes()
    assert ask(studio, "/upload/slide.yaml", "PUT", b"fps: 30.0\n", Cookie=cookie)[0] == 422
    assert (folder / "slide.yaml").read_bytes() == before


def test_5_gb_are_refused_before_they_are_read(studio, cookie, folder):
    """Announced, and unannounced: as chunks that do not end."""
    status, _, _ = ask(studio, "/upload/big.mp4", "PUT", Cookie=cookie, Content_Length="5000000000")
    assert status == 413
    assert not list(folder.glob(".upload*"))


def test_an_upload_that_does_not_end_is_cut_off(folder):
    from galileo_jax.studio.upload import receive

    sent = 0

    async def endless():
        nonlocal sent
        while True:
            sent += 1_000_000
            yield b"\0" * 1_000_000

    def upload():
        # In a thread of its own: the browser's tests have a loop in this one.
        asyncio.run(receive(folder, "big.mp4", endless(), limit=3_000_000))

    with ThreadPoolExecutor(1) as pool, pytest.raises(InputError, match="larger than 3 MB"):
        pool.submit(upload).result()
    assert sent == 4_000_000
    assert not list(folder.glob(".upload*")) and not (folder / "big.mp4").exists()


def test_requests_that_upload_nothing_are_small(studio, cookie):
    body = b"x" * 3_000_000
    try:
        status, _, _ = ask(studio, "/anything", "POST", body, Cookie=cookie)
    except (BrokenPipeError, ConnectionResetError):
        return  # it hung up, which is as good
    assert status == 413


def test_chunks_of_a_body_are_counted(studio, cookie):
    """No Content-Length: the guard counts what is read."""
    with socket.create_connection(("127.0.0.1", studio.port), timeout=20) as line:
        head = f"PUT /upload/big.yaml HTTP/1.1\r\nHost: 127.0.0.1:{studio.port}\r\n"
        head += f"Cookie: {cookie}\r\nTransfer-Encoding: chunked\r\n\r\n"
        line.sendall(head.encode())

        def feed() -> None:
            try:
                for _ in range(64):
                    line.sendall(b"10000\r\n" + b"#" * 65536 + b"\r\n")
            except OSError:
                pass

        feeder = threading.Thread(target=feed, daemon=True)
        feeder.start()
        answer = line.recv(300)
    feeder.join(10)
    assert answer.split()[1] in (b"413", b"422")


def test_a_clip_is_taken_and_shown(studio, cookie, folder, tmp_path):
    content = clip_in(tmp_path, "fresh").read_bytes()
    assert ask(studio, "/upload/fresh.mp4", "PUT", content, Cookie=cookie)[0] == 200
    assert (folder / "fresh.mp4").read_bytes() == content
    assert not os.access(folder / "fresh.mp4", os.X_OK)
    assert ask(studio, "/frame/fresh/0", Cookie=cookie)[0] == 200


def test_paths_stay_below_the_folder(tmp_path):
    root = tmp_path / "in"
    root.mkdir()
    (root / "way").symlink_to(tmp_path)
    for parts in (("..", "x"), ("way", "x"), ("/etc/passwd",)):
        with pytest.raises(InputError, match="leads out"):
            below(root, *parts)
    assert below(root, "runs", "a") == root / "runs" / "a"
    for name in ("../a", "a/b", "..", ".a", "", "a\0", "a" * 99, "a\n"):
        with pytest.raises(InputError):
            safe_name(name)


def test_links_out_of_the_folder_are_no_clips(folder):
    assert "slide" in clips(folder) and "link" not in clips(folder)


def test_a_yaml_beside_a_clip_cannot_name_files_elsewhere(tmp_path):
    video = clip_in(tmp_path)
    text = video.with_suffix(".yaml").read_text()
    video.with_suffix(".yaml").write_text(text.replace("slide.mp4", "../../other.mp4"))
    session = Session(tmp_path)
    assert session.sheets == {} and "leads out" in session.broken["slide"]


def test_a_runs_program_is_not_run_without_a_press(tmp_path):
    clip_in(tmp_path)
    run = tmp_path / "runs" / "slide"
    run.mkdir(parents=True)
    (run / "result.json").write_text(json.dumps({"effects_from": ["evil.py"], "effects": []}))
    with pytest.raises(InputError, match=r"evil\.py, which is a program"):
        results.check_run(tmp_path, run)
    results.check_run(tmp_path, run, may_run=True)
    (run / "result.json").write_text(json.dumps({"effects_from": ["/tmp/evil.py"]}))
    with pytest.raises(InputError, match="leads out"):
        results.check_run(tmp_path, run, may_run=True)


def test_a_run_cannot_lead_out_of_the_folder(tmp_path):
    root = tmp_path / "in"
    (root / "runs" / "slide").mkdir(parents=True)
    (root / "runs" / "slide" / "result.json").write_text("{}")
    (root / "runs" / "slide" / "clip.yaml").write_text("video: ../../../secret.mp4\n")
    with pytest.raises(InputError, match="leads out"):
        results.check_run(root, root / "runs" / "slide")
    (root / "runs" / "away").symlink_to(tmp_path)
    with pytest.raises(InputError, match="leads out"):
        results.check_run(root, root / "runs" / "away")
