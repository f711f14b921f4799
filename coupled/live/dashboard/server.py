"""The page's process: HTTP for its files, a websocket for flight data and requests.

It binds to loopback by default. Every request needs the token of this flight. A websocket must
come from the page itself (its Origin is the server's address). Requests of a browser are checked
here, and again by the host.

Browsers cannot delay the flight: connections, viewers and requests per second are limited, idle
connections are closed, and the process has a lower priority than the flight's.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import secrets
import signal
import socket
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect
from uvicorn.protocols.http.h11_impl import H11Protocol

from coupled.live.dashboard.board import Board
from coupled.record.channels import CONTROL_NAMES
from coupled.schema import LARGEST

STATIC = Path(__file__).parent / "static"
FILES = {
    "": ("index.html", "text/html; charset=utf-8"),
    "live.js": ("live.js", "text/javascript; charset=utf-8"),
    "drawing.js": ("drawing.js", "text/javascript; charset=utf-8"),
    "live.css": ("live.css", "text/css; charset=utf-8"),
    "uplot.js": ("uPlot.iife.min.js", "text/javascript; charset=utf-8"),
    "uplot.css": ("uPlot.min.css", "text/css; charset=utf-8"),
}
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; connect-src 'self'; style-src 'self'"
    " 'unsafe-inline'; img-src 'self' data:; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-store",
    "Connection": "close",
}
RATE_Hz = 60.0
MOST_VIEWERS = 8
MOST_CONNECTIONS = 32  # a page opens six for its files, and one that stays
REQUEST_s = 5.0  # time limit for a connection to send its request
WORDS_per_s, MOST_WORDS = 10.0, 20  # requests of all viewers, mean and burst; not of hands
NICE = 10  # increment of the process's nice value
LARGEST_bytes = 2048
WORDS = ("stop", "mark", "set", "service", "save", "hand", "leave")


@dataclass(frozen=True)
class PageAddress:
    """The address of the page, and the token that it requires."""

    address: str
    port: int
    token: str

    @property
    def url(self) -> str:
        """Return the URL for the user."""
        shown = f"[{self.address}]" if ":" in self.address else self.address
        return f"http://{shown}:{self.port}/?token={self.token}"


def request_of(text: str) -> dict[str, Any] | None:
    """Return a browser's request, or None if it is invalid."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(found, dict) or found.get("what") not in WORDS:
        return None
    plain: dict[str, Any] = {"what": found["what"]}
    for key in ("text", "control"):
        value = found.get(key, "")
        if not isinstance(value, str) or len(value) > 200:
            return None
        plain[key] = value
    value = found.get("value", 0.0)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= LARGEST:
        return None
    return plain | {"value": float(value)}


class Bounded(H11Protocol):
    """A connection, limited in number (MOST_CONNECTIONS) and in time to its request."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Refuse a connection beyond the limit; else start the time limit of its request."""
        assert isinstance(transport, asyncio.Transport)
        super().connection_made(transport)
        if len(self.connections) > MOST_CONNECTIONS:
            transport.abort()
        else:
            self.loop.call_later(REQUEST_s, self._give_up)

    def _give_up(self) -> None:
        """Close a connection without a request; a websocket has another protocol by then."""
        if self.cycle is None and self.transport.get_protocol() is self:
            self.transport.abort()


class Allowance:
    """The number of requests still allowed: it grows by WORDS_per_s, up to MOST_WORDS."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._left, self._then = clock, float(MOST_WORDS), clock()

    def take(self) -> bool:
        """Use one request; return whether it is allowed."""
        now = self._clock()
        filled = self._left + WORDS_per_s * (now - self._then)
        self._then, self._left = now, min(float(MOST_WORDS), filled)
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class Server:
    """The application: one flight's page."""

    def __init__(self, served_at: PageAddress, board: Board, host: Connection, width: int) -> None:
        self._served_at, self._board, self._host, self._width = served_at, board, host, width
        self._viewers = 0
        self._allowance = Allowance()

    def app(self) -> Starlette:
        """Return the application."""
        routes = [
            Route("/{name:path}", self.file, methods=["GET"]),
            WebSocketRoute("/ws", self.socket),
        ]
        return Starlette(routes=list(reversed(routes)))

    def _known(self, token: str) -> bool:
        return secrets.compare_digest(token.encode(), self._served_at.token.encode())

    def _own_host(self, host: str) -> bool:
        """Return whether the Host header names this server (protection from DNS rebinding)."""
        name = host.rpartition(":")[0].strip("[]")
        if self._served_at.address in ("0.0.0.0", "::"):
            return bool(name)
        return name in {self._served_at.address, "localhost", "127.0.0.1", "::1"}

    async def file(self, request: Request) -> Response:
        """Serve one of the page's files."""
        name = request.path_params["name"]
        if not self._own_host(request.headers.get("host", "")):
            return PlainTextResponse("another host", 403, HEADERS)
        if not self._known(request.query_params.get("token", "")):
            problem = "No token, or another flight's. Open the whole line that was printed."
            return PlainTextResponse(problem, 403, HEADERS)
        if name not in FILES:
            return PlainTextResponse("no such file", 404, HEADERS)
        file, kind = FILES[name]
        body = (STATIC / file).read_text(encoding="utf-8")
        if name == "":
            body = body.replace("TOKEN", self._served_at.token)
        return Response(body, media_type=kind, headers=HEADERS)

    async def socket(self, socket: WebSocket) -> None:
        """Send flight data 60 times a second, and receive requests."""
        host = socket.headers.get("host", "")
        own = self._own_host(host) and socket.headers.get("origin") == f"http://{host}"
        if not own or not self._known(socket.query_params.get("token", "")):
            await socket.close(1008)
            return
        if self._viewers >= MOST_VIEWERS:
            await socket.close(1013)
            return
        await socket.accept()
        self._viewers += 1
        moved: dict[str, dict[str, Any]] = {}  # last positions of hands, passed on by the sender
        sender = asyncio.create_task(self._send(socket, moved))
        held: set[str] = set()
        try:
            while True:
                word = request_of(await socket.receive_text())
                if word is None:
                    continue
                if word["what"] == "hand":
                    if word["control"] in CONTROL_NAMES:
                        held.add(word["control"])
                        moved[word["control"]] = word
                elif word["what"] in ("stop", "leave") or self._allowance.take():
                    self._pass(word)
                else:
                    await socket.close(1008, "too many words")
                    break
        except (WebSocketDisconnect, RuntimeError):
            pass
        finally:
            self._viewers -= 1
            sender.cancel()
            for control in held:  # a closed connection releases its controls
                self._pass({"what": "hand", "text": "", "control": control, "value": 0.0})

    def _pass(self, word: dict[str, Any]) -> None:
        with contextlib.suppress(OSError):
            self._host.send_bytes(json.dumps(word).encode())

    async def _send(self, socket: WebSocket, moved: dict[str, dict[str, Any]]) -> None:
        seen, count = -1, 0
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while True:
                while moved:
                    self._pass(moved.popitem()[1])
                seen, state = self._board.state(seen)
                if state:
                    await socket.send_text(state)
                count, rows = self._board.rows(count, self._width)
                if len(rows):
                    await socket.send_bytes(rows.astype(np.float32).tobytes())
                await asyncio.sleep(1.0 / RATE_Hz)


def bind(address: str, port: int) -> socket.socket:
    """Return a listening socket; raises OSError."""
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    wire = socket.socket(family, socket.SOCK_STREAM)
    if os.name == "posix":  # on Windows it would share a port that another server has
        wire.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    wire.bind((address, port))
    wire.listen(64)  # before the address is published
    return wire


def serve(address: str, port: int, token: str, memory: Any, host: Connection, width: int) -> None:
    """Run the page's process: report its URL, serve it, and end with the host."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is handled by the host
    if hasattr(os, "nice"):
        os.nice(NICE)
    try:
        wire = bind(address, port)
    except OSError as error:
        host.send_bytes(json.dumps({"problem": error.strerror or str(error)}).encode())
        return
    served_at = PageAddress(address, int(wire.getsockname()[1]), token)
    app = Server(served_at, Board(memory), host, width).app()
    config = uvicorn.Config(
        app,
        http=Bounded,
        log_level="critical",
        ws="websockets-sansio",
        ws_max_size=LARGEST_bytes,
        timeout_graceful_shutdown=1,
        lifespan="off",
    )
    server = uvicorn.Server(config)

    def watch() -> None:
        with contextlib.suppress(OSError, EOFError):
            host.recv_bytes()
        server.should_exit = True

    threading.Thread(target=watch, daemon=True).start()
    host.send_bytes(json.dumps({"url": served_at.url}).encode())
    asyncio.run(server.serve(sockets=[wire]))
