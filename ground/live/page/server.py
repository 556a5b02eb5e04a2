"""HTTP server of the live page: three files and one stream of events.

Each browser has a task of its own that waits until the last event has left before it takes the next
one from `PageState`. A slow or stopped browser therefore keeps one event and delays nobody. Nothing
on the page is changed by a request: it has no command for a vehicle.
"""

import asyncio
import errno
import ipaddress
import socket
from collections.abc import AsyncIterator
from importlib.resources import files
from threading import Thread
from types import TracebackType
from typing import Self

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from ground.live.page.connections import PageConnection
from ground.live.page.page_state import Browser, PageState
from mavlink_io.clock import wall_s
from mavlink_io.errors import InputError

LOOPBACK, PORT = "127.0.0.1", 8750
PERIOD_S = 0.1
"""Wall time between two events of a browser."""
SILENCE_S = 1.0
"""Wall time after which a browser without news is sent an empty line.

A browser that has left after a part of a second request is found only by a write.
"""
CLOSE_TIMEOUT_S = 1.0
"""Wall time in which the last events may leave; a stopped browser takes none."""
_FILES = {
    "/": ("live.html", "text/html"),
    "/live.css": ("live.css", "text/css"),
    "/live.js": ("live.js", "text/javascript"),
    "/hull.js": ("hull.js", "text/javascript"),
    "/charts.js": ("charts.js", "text/javascript"),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
}
_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self';"
    " connect-src 'self'; img-src 'self'; base-uri 'none'; form-action 'none';"
    " frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


def listen(host: str = LOOPBACK, port: int | None = None) -> socket.socket:
    """Open the port of the page.

    Parameters
    ----------
    host : str
        Address of an interface of this machine.
    port : int, optional
        TCP port; without it `PORT`, or any free one if that is in use.

    Returns
    -------
    socket.socket
        Listening socket.

    Raises
    ------
    InputError
        The host is no address of this machine, or the port cannot be used.
    """
    if not _is_host_name(host):
        raise InputError(
            f"--host {host!r}: no address; give an address of this machine, or 0.0.0.0 for all"
        )
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    for number in (PORT, 0) if port is None else (port,):
        try:
            return socket.create_server((host, number), family=family)
        except OSError as error:
            if number == PORT and port is None and error.errno == errno.EADDRINUSE:
                continue
            options = f"--host {host}" + ("" if port is None else f" --port {port}")
            reason = error.strerror or str(error)
            raise InputError(
                f"{options}: {reason}; give an address of this machine and a free port"
            ) from None
    raise AssertionError


def _is_host_name(host: str) -> bool:
    """Return whether a text can be an address or a name; to a socket, none is every interface."""
    try:
        return bool(host.encode("idna"))
    except UnicodeError:
        return False


def url(listener: socket.socket) -> str:
    """Return the address of the page for a browser on this machine.

    Parameters
    ----------
    listener : socket.socket
        Result of `listen`.

    Returns
    -------
    str
        Address with http.
    """
    host, port = listener.getsockname()[:2]
    if ipaddress.ip_address(host).is_unspecified:
        host = "::1" if ":" in host else LOOPBACK
    return f"http://{f'[{host}]' if ':' in host else host}:{port}/"


class PageServer:
    """Server of the page in a thread of its own.

    Parameters
    ----------
    state : PageState
        What is shown.
    listener : socket.socket
        Result of `listen`; closed at the end.
    """

    def __init__(self, state: PageState, listener: socket.socket) -> None:
        self._state, self._listener = state, listener
        config = uvicorn.Config(
            application(state),
            log_config=None,
            access_log=False,
            lifespan="off",
            server_header=False,
            timeout_graceful_shutdown=int(CLOSE_TIMEOUT_S),
            ws="none",
            http=PageConnection,
            loop="asyncio",
        )
        self._server = uvicorn.Server(config)
        self._thread = Thread(target=self._run, name="live-page", daemon=True)

    def __enter__(self) -> Self:
        """Start to serve."""
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        tb: TracebackType | None,
    ) -> None:
        """Send each browser its last event, and end."""
        self._state.closing = True
        self._server.should_exit = True
        self._thread.join(CLOSE_TIMEOUT_S + 2.0)
        self._listener.close()

    def _run(self) -> None:
        """Serve until `__exit__`."""
        asyncio.run(self._server.serve(sockets=[self._listener]))


def application(state: PageState) -> ASGIApp:
    """Return the ASGI application of the page.

    Parameters
    ----------
    state : PageState
        What is shown.

    Returns
    -------
    ASGIApp
        Application that refuses unknown Host headers.
    """
    folder = files("ground.live.page")
    contents = {path: ((folder / name).read_bytes(), kind) for path, (name, kind) in _FILES.items()}

    async def file(request: Request) -> Response:
        content, kind = contents[request.url.path]
        return Response(content, media_type=kind, headers=_HEADERS)

    async def events(request: Request) -> Response:
        browser = Browser(request.query_params.get("dive", ""))
        headers = {**_HEADERS, "X-Accel-Buffering": "no"}
        return StreamingResponse(
            _events(state, browser), media_type="text/event-stream", headers=headers
        )

    routes = [Route(path, file) for path in _FILES]
    return CheckedHost(Starlette(routes=[*routes, Route("/events", events)]))


async def _events(state: PageState, browser: Browser) -> AsyncIterator[bytes]:
    """Yield the events of one browser until the server ends."""
    yield b"retry: 1000\n\n"
    sent_s = wall_s()
    while True:
        closing = state.closing
        message = state.news(browser)
        if message or wall_s() - sent_s > SILENCE_S:
            yield b"data: " + message + b"\n\n" if message else b"\n"
            sent_s = wall_s()
        if closing:
            yield b"event: end\ndata: {}\n\n"
            return
        await asyncio.sleep(PERIOD_S)


class CheckedHost:
    """Refuses requests whose Host header is a name other than localhost or this machine's.

    A page from elsewhere can make a browser send requests here under a name that it has pointed at
    this machine (DNS rebinding), but not under a numeric address or these names.

    Parameters
    ----------
    app : ASGIApp
        Application behind the check.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer 400 to a request under another name, and pass on all others.

        Parameters
        ----------
        scope : Scope
            Request.
        receive, send : callable
            Channels of the connection.
        """
        if scope["type"] == "http":
            hosts = [value for name, value in scope["headers"] if name == b"host"]
            if len(hosts) != 1 or not is_own_host(hosts[0].decode("latin-1")):
                refusal = PlainTextResponse("unknown Host header\n", 400, headers=_HEADERS)
                await refusal(scope, receive, send)
                return
        await self._app(scope, receive, send)


def is_own_host(host: str) -> bool:
    """Return whether a Host header is a numeric address, localhost or this machine's name.

    Parameters
    ----------
    host : str
        Value of the header, with or without a port.

    Returns
    -------
    bool
        True if no foreign name server can have given the name.
    """
    name = host[1:].partition("]")[0] if host.startswith("[") else host.partition(":")[0]
    if name.lower() in ("localhost", socket.gethostname().lower()):
        return True
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
