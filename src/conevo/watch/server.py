"""The server behind a live page: for browsers on this machine, read-only, known paths only.

Every other website that a reader has open can reach a server on this machine as well. So requests
count only if they name this machine as their host (against DNS rebinding) and do not come from
another site, and answers are kept from being used by one. A run is named by its label, which is
looked up among those that are watched and never becomes a path.
"""

from __future__ import annotations

import errno
import json
import math
import secrets
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from typing import Any
from urllib.parse import unquote, unquote_plus

from conevo.errors import ConevoError, EnvironmentFailure
from conevo.watch.state import Watched

__all__ = ["LiveServer", "serve"]

HOST = "127.0.0.1"
PATIENCE = 1.0  # seconds that a request for the state may take to read what is new
ASKING = 60.0  # seconds from one answer to the end of the next request
SENDING = 60.0  # seconds for an answer, in addition to the time that it takes at
SLOWEST = 20_000  # bytes per second
MOST = 100  # connections at once
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "connect-src 'self'; img-src data: blob:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}
HTML, JSON, TEXT = "text/html", "application/json", "text/plain"
Replay = Callable[[str], str]


def serve(
    watched: Watched,
    port: int | None,
    replay: Replay,
    on_ready: Callable[[str], None] = lambda address: None,
) -> None:
    """Serve the live page until the reader presses Ctrl-C.

    Args:
        watched: the runs that are followed.
        port: of the server; any free one for None or 0.
        replay: returns the page with the replay of a label's fittest team so far; called for one
            label at a time.
        on_ready: called with the page's address when it can be opened.

    Raises:
        EnvironmentFailure: the port is in use, or may not be used.
    """
    with LiveServer(watched, port, replay) as server:
        on_ready(server.address)
        try:
            server.serve_forever(poll_interval=0.2)
        except KeyboardInterrupt:
            return


class LiveServer(ThreadingHTTPServer):
    """A thread for each connection, so that a slow one does not keep others waiting."""

    daemon_threads = True
    allow_reuse_address = True  # not while another server listens
    request_queue_size = 64

    def __init__(self, watched: Watched, port: int | None, replay: Replay) -> None:
        try:
            super().__init__((HOST, port or 0), Handler)
        except (OSError, OverflowError) as error:
            number = getattr(error, "errno", None)
            why = "is in use" if number == errno.EADDRINUSE else f"cannot be used ({error})"
            raise EnvironmentFailure(
                f"port {port} of {HOST} {why}; choose another with --port, or leave it out"
            ) from error
        self.watched, self.replay = watched, replay
        self.port = int(self.server_address[1])
        self.address = f"http://{HOST}:{self.port}/"
        self.hosts = {f"{HOST}:{self.port}", f"localhost:{self.port}"}
        self.page = resources.files("conevo.watch").joinpath("watch.html").read_bytes()
        self.at_replay = threading.Lock()
        watched.snapshot(PATIENCE)  # so that labels are known
        self._deadlines: dict[socket.socket, float] = {}
        self._waiting = threading.Lock()
        self._session = secrets.token_hex(4)  # another server has other versions
        self._encoding = threading.Lock()
        self._encoded: tuple[int, bytes] = (0, b"")

    def state(self) -> tuple[str, bytes]:
        """Return the tag and the text of the current state."""
        state = self.watched.snapshot(PATIENCE)
        version = state["version"]
        with self._encoding:
            if self._encoded[0] != version:
                self._encoded = version, _as_json(state)
            return f'"{self._session}-{version}"', self._encoded[1]

    # --- slow clients -----------------------------------------------------------------------------

    def expect(self, connection: socket.socket, seconds: float) -> None:
        """Set the time until a connection is ended, unless it is called again before."""
        with self._waiting:
            self._deadlines[connection] = time.monotonic() + seconds

    def verify_request(self, request: Any, client_address: Any) -> bool:
        """Refuse a connection if the server has too many."""
        with self._waiting:
            is_welcome = len(self._deadlines) < MOST
        if is_welcome:
            self.expect(request, ASKING)
        return is_welcome

    def service_actions(self) -> None:
        """End connections whose time is up; called several times a second."""
        now = time.monotonic()
        with self._waiting:
            late = [one for one, deadline in self._deadlines.items() if deadline < now]
        for connection in late:
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)  # its thread reads the end, and leaves

    def shutdown_request(self, request: Any) -> None:
        """Close a connection."""
        with self._waiting:
            self._deadlines.pop(request, None)
        super().shutdown_request(request)

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a client that has gone; print other errors as Python does."""
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class Handler(BaseHTTPRequestHandler):
    """Answers GET and HEAD."""

    server: LiveServer
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "conevo", ""

    def handle_one_request(self) -> None:
        """Read a request, within ``ASKING`` seconds in all, and answer it."""
        self.server.expect(self.connection, ASKING)
        super().handle_one_request()

    def do_GET(self) -> None:
        """Answer a request."""
        self.server.expect(self.connection, math.inf)  # a replay takes long
        if (refusal := self._refusal()) is not None:
            self.send_error(HTTPStatus.FORBIDDEN, refusal)
            return
        if {"Content-Length", "Transfer-Encoding"} & set(self.headers):
            self.close_connection = True  # the following bytes are not a request
        path, _, query = self.path.partition("?")
        try:
            self._answer(path, query)
        except UnknownAddress:
            self.send_error(HTTPStatus.NOT_FOUND, "nothing is at this address")
        except ConevoError as error:
            self.send_error(HTTPStatus.CONFLICT, str(error))

    do_HEAD = do_GET  # without the body, see _send

    def _refusal(self) -> str | None:
        """Return why a request is refused, None if it is not."""
        if self.headers.get_all("Host", []) not in [[host] for host in self.server.hosts]:
            port = self.server.port
            return (
                f"only http://{HOST}:{port}/ and http://localhost:{port}/ are served; "
                f"from another machine forward the same port: ssh -L {port}:{HOST}:{port} MACHINE"
            )
        site = self.headers.get("Sec-Fetch-Site", "none")
        is_link = self.headers.get("Sec-Fetch-Dest") == "document"  # in a page that links here
        if site not in ("none", "same-origin") and not is_link:
            return "requests from other sites are refused"
        return None

    def _answer(self, path: str, query: str) -> None:
        if path == "/":
            self._send(HTML, self.server.page)
        elif path == "/state.json":
            tag, body = self.server.state()
            if self.headers.get("If-None-Match") == tag:
                self._send(JSON, b"", HTTPStatus.NOT_MODIFIED, tag)
            else:
                self._send(JSON, body, tag=tag)
        elif path == "/run.json":
            key, _, value = query.partition("=")
            label = self._known(unquote_plus(value) if key == "label" else "")
            self._send(JSON, _as_json(self.server.watched.details(label)))
        elif path.startswith("/replay/"):
            label = self._known(unquote(path.removeprefix("/replay/")))
            with self.server.at_replay:
                page = self.server.replay(label)
            self._send(HTML, page.encode())
        else:
            raise UnknownAddress

    def _known(self, label: str) -> str:
        """Return the label of a run that is watched.

        Raises:
            UnknownAddress: none has this label.
        """
        if label not in self.server.watched.labels:
            raise UnknownAddress
        return label

    def _send(
        self, kind: str, body: bytes, status: HTTPStatus = HTTPStatus.OK, tag: str = ""
    ) -> None:
        self.server.expect(self.connection, SENDING + len(body) / SLOWEST)
        self.send_response(status)
        for name, value in HEADERS.items():
            self.send_header(name, value)
        if tag:
            self.send_header("ETag", tag)
        if status == HTTPStatus.METHOD_NOT_ALLOWED:
            self.send_header("Allow", "GET, HEAD")
        if status != HTTPStatus.NOT_MODIFIED:
            self.send_header("Content-Type", f"{kind}; charset=utf-8")
            self.send_header("Content-Length", str(len(body)))
        if self.close_connection:
            self.send_header("Connection", "close")
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """Send one line of plain text; the rest of the request is not read."""
        status = HTTPStatus(code)
        if status == HTTPStatus.NOT_IMPLEMENTED:
            status, message = HTTPStatus.METHOD_NOT_ALLOWED, "only GET and HEAD are answered"
        self.close_connection = True
        self.request_version = self.protocol_version  # an older one would get no headers
        line = " ".join((message or status.phrase).split())
        self._send(TEXT, f"{line}\n".encode(errors="replace"), status)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 (its name there)
        """Print nothing about single requests."""


class UnknownAddress(Exception):
    """Nothing is at the requested address."""


def _as_json(value: Any) -> bytes:
    return json.dumps(value, allow_nan=False, separators=(",", ":")).encode()
