"""Who may speak with the workbench: this machine alone, and whoever has the link.

The page is served by viser, which asks nobody who he is. Every request, of HTTP and of the
websocket, therefore passes `Guard.answer` first. Texts from files reach the page through `escaped`
alone.
"""

import contextlib
import functools
import hmac
import io
import secrets
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from html import escape
from http import HTTPStatus
from importlib.resources import files
from typing import Any
from urllib.parse import parse_qs, quote, unquote, urlsplit

UPLOAD_LIMIT = 200_000_000
"""Bytes of a file that may be uploaded."""

_EVERYWHERE = {
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
_PAGE = (
    "default-src 'self' data: blob: 'unsafe-inline' 'unsafe-eval'; connect-src 'self' data: blob: "
    "ws://{host}; frame-ancestors 'none'; base-uri 'none'; form-action 'none'; object-src 'none'"
)
"""What the page may load: nothing from another machine."""
_FILE = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; img-src data: blob:; font-src "
    "data:; style-src 'unsafe-inline'; script-src 'unsafe-inline' 'unsafe-eval' blob: data:"
)
"""What a file that is opened may do: a report draws itself, and cannot speak with the workbench."""
_WELCOME = '<!doctype html><title>ccfem</title><meta http-equiv="refresh" content="0;url=/">'
"""The page behind the link. A redirection would not carry the cookie where another site led here.
"""


def escaped(text: object) -> str:
    """Text as HTML that shows it, whatever is in it."""
    return escape(str(text), quote=True)


@dataclass(frozen=True)
class Served:
    """A file for the browser: its bytes, what they are, and a name under which it is saved."""

    content: bytes
    kind: str
    save_as: str = ""


@dataclass
class Guard:
    """Lets a request pass, answers it, or refuses it."""

    # Returns the file of a name below ``/files/``; None where there is none.
    serve: Callable[[str], Served | None] = lambda name: None
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))  # what the link holds

    def link(self, port: int) -> str:
        """Link that opens the page."""
        return f"http://127.0.0.1:{port}/?token={self.token}"

    def answer(
        self, target: str, headers: Mapping[str, str | None], port: int
    ) -> tuple[HTTPStatus, dict[str, str], bytes] | None:
        """Answer a request; None lets it pass.

        Parameters
        ----------
        target : str
            Path and query.
        headers : mapping
            ``get`` returns the value of a header, or None.
        port : int
            That the server listens on.
        """
        hosts = [f"{name}:{port}" for name in ("127.0.0.1", "localhost")]
        host, origin = headers.get("Host"), headers.get("Origin")
        upgrade = headers.get("Upgrade") is not None
        if host not in hosts:
            return _refused("this address is not that of the workbench")
        if (upgrade or origin is not None) and origin not in [f"http://{h}" for h in hosts]:
            return _refused("another page may not speak with the workbench")
        try:
            place = urlsplit(target)
            token = parse_qs(place.query).get("token", [""])[0]
        except ValueError:
            return _refused("this is no address")
        cookie = f"ccfem-{port}"
        if not upgrade and token and self._is_token(token):
            given = f"{cookie}={self.token}; HttpOnly; SameSite=Strict; Path=/"
            return _answered(_WELCOME.encode(), "text/html; charset=utf-8", {"Set-Cookie": given})
        if not self._is_token(_cookies(headers.get("Cookie") or "").get(cookie, "")):
            return _refused("open the link that ccfem open has printed")
        if upgrade:
            return None
        if place.path == "/":
            policy = {"Content-Security-Policy": _PAGE.format(host=host)}
            return _answered(_page(), "text/html; charset=utf-8", policy)
        served = None
        if place.path.startswith("/files/"):
            served = self.serve(unquote(place.path.removeprefix("/files/")))
        if served is None:
            return _refused("there is no such file", HTTPStatus.NOT_FOUND)
        more = {"Content-Security-Policy": _FILE}
        if served.save_as:
            name = quote(served.save_as, safe="")
            more["Content-Disposition"] = f"attachment; filename*=UTF-8''{name}"
        return _answered(served.content, served.kind, more)

    def _is_token(self, given: str) -> bool:
        return hmac.compare_digest(given.encode("utf-8", "replace"), self.token.encode())

    @contextlib.contextmanager
    def before_viser(self) -> Iterator[None]:
        """Stand before every server that starts within the block.

        Raises
        ------
        RuntimeError
            Where none has: then nobody would be asked who he is.
        """
        import websockets.asyncio.server as sockets
        from websockets.datastructures import Headers
        from websockets.http11 import Response

        unguarded, guarded = sockets.serve, []

        def process(inner: Any, connection: Any, request: Any) -> Any:
            port = connection.transport.get_extra_info("sockname")[1]
            try:
                answer = self.answer(request.path, request.headers, port)
            except Exception:  # as for a header that is given twice
                answer = _refused("this request is not understood")
            if answer is None:
                return inner(connection, request)
            status, headers, content = answer
            return Response(status.value, status.phrase, Headers(headers), content)

        def serve(*arguments: Any, process_request: Any, **options: Any) -> Any:
            guarded.append(True)
            process_request = functools.partial(process, process_request)
            return unguarded(*arguments, process_request=process_request, **options)

        sockets.serve = serve
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                yield
        finally:
            sockets.serve = unguarded
        if not guarded:
            raise RuntimeError("this version of viser starts its server in another way")


def _refused(
    why: str, status: HTTPStatus = HTTPStatus.FORBIDDEN
) -> tuple[HTTPStatus, dict[str, str], bytes]:
    return _answered(f"ccfem: {why}\n".encode(), "text/plain; charset=utf-8", {}, status)


def _answered(
    content: bytes, kind: str, more: dict[str, str], status: HTTPStatus = HTTPStatus.OK
) -> tuple[HTTPStatus, dict[str, str], bytes]:
    headers = {"Content-Type": kind, "Content-Length": str(len(content)), **_EVERYWHERE, **more}
    return status, headers, content


def _cookies(text: str) -> dict[str, str]:
    pairs = (pair.strip().partition("=") for pair in text.split(";"))
    return {name: value for name, _, value in pairs}


@functools.cache
def _page() -> bytes:
    """Viser's page with a style and a script of ours in its head."""
    import viser

    page = files(viser).joinpath("client", "build", "index.html").read_bytes()
    head = files("ccfem.workbench").joinpath("head.html").read_bytes()
    return page.replace(b"<title>Viser</title>", b"<title>ccfem</title>").replace(
        b"</head>", head + b"</head>", 1
    )


def send_again(handle: Any) -> None:
    """Send the value of a field to all browsers, whatever they show."""
    from viser._messages import GuiUpdateMessage

    inner = handle._impl
    message = GuiUpdateMessage(inner.uuid, {"value": inner.value})
    inner.gui_api._websock_interface.queue_message(message)


def limit_uploads(server: Any, refuse: Callable[[str], object]) -> None:
    """Refuse files above `UPLOAD_LIMIT` when they are announced and as they come; share nothing.

    Parameters
    ----------
    server : viser.ViserServer
    refuse : callable
        Told why.
    """
    from viser import _messages as messages

    sockets, gui = server._websock_server, server.gui
    going = gui._current_file_upload_states

    def refused(client: Any, message: Any, why: str) -> None:
        refuse(why)
        going.pop(message.transfer_uuid, None)
        if client in server.get_clients():  # where it waits, and may send no other, till it is told
            send = server.get_clients()[client]._websock_connection.queue_message
            ends = (message.source_component_uuid, message.transfer_uuid, 1, 1)
            send(messages.FileTransferPartAck(*ends))
            send(messages.RemoveNotificationMessage(f"upload-{message.transfer_uuid}"))

    def start(client: Any, message: Any) -> None:
        size = message.size_bytes + sum(state["total_bytes"] for state in going.values())
        if size > UPLOAD_LIMIT or message.part_count > UPLOAD_LIMIT // 1000:
            others = " with others on their way" if size > message.size_bytes else ""
            why = (
                f"{message.filename} has {size / 1e6:.0f} MB{others}; files of up to "
                f"{UPLOAD_LIMIT / 1e6:.0f} MB can be uploaded: start ccfem open in its folder"
            )
            refused(client, message, why)
        else:
            gui._handle_file_transfer_start(client, message)

    def part(client: Any, message: Any) -> None:
        state = going.get(message.transfer_uuid)
        if state is not None:
            if state["transferred_bytes"] + len(message.content) > state["total_bytes"]:
                why = f"{state['filename']} is larger than the browser said: upload it again"
                refused(client, message, why)
            else:
                gui._handle_file_transfer_part(client, message)

    for kind, handler in {
        messages.FileTransferStartUpload: start,
        messages.FileTransferPart: part,
    }.items():
        sockets.unregister_handler(kind)
        sockets.register_handler(kind, handler)
    for kind in (messages.ShareUrlRequest, messages.ShareUrlDisconnect):
        sockets.unregister_handler(kind)
