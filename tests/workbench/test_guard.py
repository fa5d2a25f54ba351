"""Who may speak with the workbench, by bare requests."""

import contextlib
import socket

import pytest

from ccfem.workbench import guard as guarding
from ccfem.workbench.guard import Guard, Served, escaped, limit_uploads

FILES = {
    "part.toml": Served(b"layers = 3", "text/plain", "part.toml"),
    'häk "1"\r\nX: y': Served(b"hook", "text/plain", 'häk "1"\r\nX: y'),
}


@pytest.fixture(scope="module")
def server():
    """A server of viser behind a guard; what it refused is in ``said``."""
    viser = pytest.importorskip("viser", reason="viser is not installed: pip install ccfem[ui]")
    guard = Guard(FILES.get)
    with guard.before_viser():
        server = viser.ViserServer("127.0.0.1", 0, verbose=False)
    server.guard, server.said = guard, []
    limit_uploads(server, server.said.append)
    yield server
    with contextlib.redirect_stdout(None):
        server.stop()


def ask(server, path="/", **headers):
    """Status, headers and content that a request is answered with."""
    port = server.get_port()
    headers = {"Host": f"127.0.0.1:{port}"} | {k.replace("_", "-"): v for k, v in headers.items()}
    lines = [f"GET {path} HTTP/1.1", *(f"{k}: {v}" for k, v in headers.items() if v), "", ""]
    with socket.create_connection(("127.0.0.1", port), timeout=10) as line:
        line.sendall("\r\n".join(lines).encode())
        data = b""
        while b"\r\n\r\n" not in data and (more := line.recv(65536)):
            data += more
        head, _, content = data.partition(b"\r\n\r\n")
        status = int(head.split()[1])
        while status != 101 and (more := line.recv(65536)):
            content += more
    return status, head.decode(), content


def cookie(server):
    return f"ccfem-{server.get_port()}={server.guard.token}"


def test_the_link_gives_a_cookie_that_opens_the_page(server):
    status, head, _ = ask(server, "/?" + server.guard.link(1).partition("?")[2])
    assert status == 200
    assert f"Set-Cookie: {cookie(server)}; HttpOnly; SameSite=Strict; Path=/" in head
    status, head, content = ask(server, Cookie=cookie(server))
    assert status == 200
    assert b"<title>ccfem</title>" in content
    assert "frame-ancestors 'none'" in head


@pytest.mark.parametrize(
    "headers",
    [
        {},
        {"Cookie": "ccfem-1=abc"},
        {"Host": "evil.example"},
        {"Host": None},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
    ],
)
def test_others_are_refused(server, headers):
    given = headers if headers.keys() & {"Cookie"} or not headers else {"Cookie": cookie(server)}
    assert ask(server, **given | headers)[0] in (403, 400)
    assert ask(server, "/files/part.toml", **given | headers)[0] in (403, 400)
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade"} | WEBSOCKET | origin(server)
    assert ask(server, **upgrade | given | headers)[0] in (403, 400)


WEBSOCKET = {"Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ==", "Sec_WebSocket_Version": "13"}


def origin(server):
    return {"Origin": f"http://127.0.0.1:{server.get_port()}"}


def test_the_websocket_opens_for_the_page_alone(server):
    upgrade = {"Upgrade": "websocket", "Connection": "Upgrade"} | WEBSOCKET
    known = {"Cookie": cookie(server)}
    assert ask(server, **upgrade | known | origin(server))[0] == 101
    assert ask(server, **upgrade | known)[0] == 403
    assert ask(server, "/?token=" + server.guard.token, **upgrade | origin(server))[0] == 403


@pytest.mark.parametrize("token", ["", "x", "%00", "%ff%fe", "é"])
def test_a_wrong_token_is_refused(server, token):
    assert ask(server, f"/?token={token}")[0] in (400, 403)


@pytest.mark.parametrize(
    "path", ["/files/../guard.py", "/../../etc/passwd", "/%2e%2e/x", "/files/", "/index.html"]
)
def test_only_named_files_are_served(server, path):
    assert ask(server, path, Cookie=cookie(server))[0] == 404
    status, head, content = ask(server, "/files/part.toml", Cookie=cookie(server))
    assert (status, content) == (200, b"layers = 3")
    assert "sandbox allow-scripts" in head
    assert "allow-same-origin" not in head


def test_a_file_of_any_name_is_served_under_it(server):
    name = "h%C3%A4k%20%221%22%0D%0AX%3A%20y"
    status, head, content = ask(server, f"/files/{name}", Cookie=cookie(server))
    assert (status, content) == (200, b"hook")
    assert f"Content-Disposition: attachment; filename*=UTF-8''{name}\r\n" in head
    assert "\nX: y" not in head


def test_nobody_else_on_the_network_is_listened_to(server):
    sockets = server._websock_server
    assert sockets._host == "127.0.0.1"
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.2", server.get_port()), timeout=5)


def test_large_files_are_refused_before_and_as_they_come(server, monkeypatch):
    from viser import _messages as messages

    monkeypatch.setattr(guarding, "UPLOAD_LIMIT", 100_000)
    upload = server.gui.add_upload_button("a file")
    handlers = server._websock_server._incoming_handlers

    def send(message):
        for handler in handlers[type(message)]:
            handler(0, message)

    def start(size):
        send(messages.FileTransferStartUpload(upload._impl.uuid, "t", "a.stl", "", 2, size))

    start(300_000)
    assert "a.stl has 0 MB; files of up to 0 MB" in server.said[-1]
    assert not server.gui._current_file_upload_states
    start(10)
    assert server.gui._current_file_upload_states
    send(messages.FileTransferPart(upload._impl.uuid, "t", 0, b"x" * 11))  # more than announced
    assert not server.gui._current_file_upload_states
    assert server.said[-1] == "a.stl is larger than the browser said: upload it again"
    start(60_000)
    send(messages.FileTransferStartUpload(upload._impl.uuid, "u", "b.stl", "", 2, 60_000))
    assert list(server.gui._current_file_upload_states) == ["t"]  # both are too much at once
    assert "b.stl has 0 MB with others on their way" in server.said[-1]
    assert messages.ShareUrlRequest not in handlers  # nothing is shared through other machines


def test_texts_from_files_are_no_html():
    said = escaped("<img src=x onerror='a()'> & \"b\"")
    assert not set("<>'\"") & set(said)
