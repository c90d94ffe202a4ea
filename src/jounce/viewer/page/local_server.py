"""The server of a page: on this machine only, for requests with the token in the address, and for no other origin.

A server that listens on this machine only can still be reached by every local program, and by every page open in a
local browser: scripts may open a WebSocket to any port (only its Origin identifies the page), and an attacker may point
a name to this machine after its page was loaded (DNS rebinding: only the Host reveals it). Every request, for a page or
a WebSocket, must therefore name this machine as its host, come from this page or from no page, and contain the token.
"""

from __future__ import annotations

import io
import logging
import re
import secrets
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from typing import Any
from urllib.parse import parse_qs, urlsplit

from jounce.errors import JounceError

HOSTS = ("127.0.0.1", "localhost", "[::1]")  # with any port, as the other end of a tunnel may have another one
LONGEST_PATH = 1000  # characters; paths of the page are far shorter
REFUSED = "Open this page with the complete address that jounce view prints, including its token.\n"
HEADERS = {"Cache-Control": "no-store", "Referrer-Policy": "no-referrer", "X-Content-Type-Options": "nosniff"}
# By default the page of viser connects to its own address without the query string.
CONNECT = b"""<script>{
const given = new URLSearchParams(location.search);
if (!given.has("websocket")) {
  const token = given.get("token"), server = location.origin.replace("http", "ws");
  history.replaceState(null, "", `?token=${token}&websocket=${server}/?token=${token}`);
}
}</script>"""
_starting = threading.Lock()
_quiet = logging.getLogger(__name__)  # invalid requests of others do not concern the user
_quiet.setLevel(logging.CRITICAL + 1)


class AccessControl:
    """Control that allows only requests with a random token.

    Attributes
    ----------
    token : str
        Token of 128 random bits, for the address.
    """

    def __init__(self) -> None:
        self.token = secrets.token_urlsafe(16)

    def allows(self, request: Any) -> bool:
        """Return whether a request is allowed.

        Parameters
        ----------
        request : websockets.http11.Request
        """
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        if len(hosts) != 1 or not _is_local_host(hosts[0]) or origins not in ([], [f"http://{hosts[0]}"]):
            return False
        given = parse_qs(urlsplit(request.path).query).get("token", [])
        return len(given) == 1 and secrets.compare_digest(given[0].encode(), self.token.encode())

    @contextmanager
    def starting(self) -> Iterator[None]:
        """Guard the server that viser starts in this context, as viser has no hook for it.

        Raises
        ------
        JounceError
            If viser does not start its server in the known way, so that it cannot be guarded.
        """
        from websockets.asyncio import server as library

        serve, guarded = library.serve, []

        def serving(*arguments: Any, process_request: Any = None, **options: Any) -> Any:
            if getattr(process_request, "__module__", "").startswith("viser."):  # other servers are not changed
                guarded.append(True)
                process_request = self._before(process_request)
                options["logger"] = _quiet
            return serve(*arguments, process_request=process_request, **options)

        with _starting:
            library.serve = serving
            try:
                yield
            finally:
                library.serve = serve
        if not guarded:
            raise JounceError("this version of viser cannot be guarded; install that of the extra jounce[viewer]")

    def _before(self, process_request: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that answers only allowed requests."""

        def guarded(connection: Any, request: Any) -> Any:
            if not self.allows(request):
                return connection.respond(403, REFUSED)
            if len(request.path) > LONGEST_PATH:
                return connection.respond(414, "This address is too long.\n")
            if "Accept-Encoding" in request.headers:
                del request.headers["Accept-Encoding"]  # so that the page is not compressed
            response = process_request(connection, request)
            if response is not None:
                _complete(response)
            return response

        return guarded


def _refuse_uploads(server: Any) -> None:
    """Refuse uploads: no control of the page asks for files, but viser would store files sent for a slider.

    Parameters
    ----------
    server : viser.ViserServer
    """
    from viser import _messages as messages

    for kind in (messages.FileTransferStartUpload, messages.FileTransferPart):
        server.gui._websock_interface.unregister_handler(kind)


def _ignore_what_does_not_fit(server: Any) -> None:
    """Ignore messages that no page sends, such as letters for the number of a slider.

    Parameters
    ----------
    server : viser.ViserServer
    """
    interface = server.gui._websock_interface
    handle = interface._handle_incoming_message

    async def handled(client: int, message: Any) -> None:
        with suppress(Exception):  # viser would print it; errors of callbacks are handled elsewhere
            await handle(client, message)

    interface._handle_incoming_message = handled


def _is_local_host(host: str) -> bool:
    return re.sub(r":[0-9]+$", "", host).lower() in HOSTS


def _complete(response: Any) -> None:
    """Add the address of the connection to the page, and headers with which the browser keeps the address private."""
    response.headers.update(HEADERS)
    head = b"<head>"
    if response.headers.get("Content-Type", "").startswith("text/html") and head in response.body:
        response.body = response.body.replace(head, head + CONNECT, 1)
        del response.headers["Content-Length"]
        response.headers["Content-Length"] = str(len(response.body))


def check_installed() -> None:
    """Raise JounceError unless the packages of the extra ``viewer`` are installed."""
    from importlib.util import find_spec

    if any(find_spec(name) is None for name in ("viser", "trimesh", "shapely")):
        message = 'the view needs the package viser, which is not installed: pip install "jounce[viewer]"'
        raise JounceError(message)


def quiet_server(port: int = 0, label: str | None = None, access: AccessControl | None = None) -> Any:
    """Return a viser server that listens on this machine only, answers allowed requests only, and prints nothing.

    Raises
    ------
    JounceError
        If viser is not installed or cannot be guarded, or the port is taken.
    """
    check_installed()
    import viser

    server = None
    try:
        with redirect_stdout(io.StringIO()), (access or AccessControl()).starting():
            server = viser.ViserServer(host="127.0.0.1", port=port or _free_port(), label=label, verbose=False)
        _refuse_uploads(server)
        _ignore_what_does_not_fit(server)
    except BaseException:
        if server is not None:
            stop_silently(server)
        raise
    return server


def stop_silently(server: Any) -> None:
    """Stop a viser server without output."""
    with redirect_stdout(io.StringIO()):
        server.stop()


def _free_port() -> int:
    """Return a free port of this machine."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def check_port(port: Any) -> None:
    """Raise JounceError unless a port is valid and free."""
    if isinstance(port, bool) or not isinstance(port, int) or not 0 <= port <= 65535:
        raise JounceError("must be a whole number from 0 to 65535; 0 takes a free one", name="port", value=port)
    if port:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
            except OSError as error:
                message = f"cannot be used: {error.strerror}; 0 takes a free one"
                raise JounceError(message, name="port", value=port) from None
