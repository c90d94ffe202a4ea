"""Who is let in: the right host, no other origin, and the token; for pages and for WebSockets, and no uploads."""

import contextlib
import gc
import re
import socket
import urllib.error
import urllib.request

import msgspec
import pytest
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

import jounce as jn
from jounce.viewer import view
from jounce.viewer.page.local_server import AccessControl, quiet_server
from tests.viewer.small import wheel


@pytest.fixture(scope="module")
def page():
    with view(wheel(), open_page=False, order=1, playing=False) as found:
        yield found


@pytest.fixture
def bare(page):
    """The address without its token."""
    return page.url.partition("/?")[0]


def fetched(address, **headers):
    try:
        with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=20) as answer:
            return answer.status, answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def connected(address, origin=None):
    """Whether a WebSocket gets what the page shows; refusals have status 403."""
    given = {"origin": origin, "subprotocols": [f"viser-v{viser.__version__}"], "max_size": None}
    try:
        with connect(address.replace("http", "ws", 1), **given) as socket:
            return len(socket.recv(timeout=20)) > 0
    except InvalidStatus as error:
        return error.response.status_code != 403


def test_the_address_holds_a_token_of_128_bits_that_is_new_each_time(page):
    token = re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=([\w-]{22})", page.url)[1]
    assert token not in {AccessControl().token for _ in range(10)}


def test_the_right_address_shows_the_page(page, bare):
    status, body = fetched(page.url)
    assert status == 200
    assert b"Viser" in body
    assert fetched(bare + "/index.html" + page.url.removeprefix(bare)[1:])[0] == 200
    assert connected(page.url)
    assert connected(page.url, bare)


@pytest.mark.parametrize("path", ["", "/", "/index.html", "/?token=", "/?token=wrong", "/nothing.js", "/%2e%2e/"])
def test_without_the_token_nothing_is_shown(page, bare, path):
    status, body = fetched(bare + path)
    assert status == 403
    assert b"iser" not in body
    assert page.url.rpartition("=")[2].encode() not in body
    assert not connected(bare + path, bare)


def test_a_token_in_part_or_twice_is_none(page):
    assert fetched(page.url[:-1])[0] == 403
    assert fetched(page.url + "&token=" + page.url.rpartition("=")[2])[0] == 403


@pytest.mark.parametrize("message", [b"\x00\xff" * 50, b"\x81\xa4type\xa7Unknown", "text", b""])
def test_what_is_no_message_of_the_page_prints_nothing(page, bare, message, capfd, caplog):
    given = {"origin": bare, "subprotocols": [f"viser-v{viser.__version__}"], "max_size": None}
    with connect(page.url.replace("http", "ws", 1), **given) as stream:
        stream.recv(timeout=20)
        stream.send(message)
        with contextlib.suppress(ConnectionClosed, TimeoutError):
            while stream.recv(timeout=1.0):
                pass
    gc.collect()  # tasks that failed are told when they are gone
    assert fetched(page.url)[0] == 200
    assert capfd.readouterr() == ("", "")
    assert caplog.records == []  # the root logger would print them


def test_values_that_no_control_can_have_print_nothing(page, bare, capfd, caplog):
    given = {"origin": bare, "subprotocols": [f"viser-v{viser.__version__}"], "max_size": None}
    controls = list(page.page.server.gui._gui_input_handle_from_uuid)
    with connect(page.url.replace("http", "ws", 1), **given) as stream:
        stream.recv(timeout=20)
        for update in ({"nothing": 1}, {"value": []}, {"value": {}}):
            for name in controls:
                message = {"type": "GuiUpdateMessage", "uuid": name, "updates": update}
                stream.send(msgspec.msgpack.encode(message))
        with contextlib.suppress(ConnectionClosed, TimeoutError):
            while stream.recv(timeout=1.0):
                pass
    gc.collect()
    assert fetched(page.url)[0] == 200
    assert capfd.readouterr() == ("", "")
    assert caplog.records == []


@pytest.mark.parametrize("length", [2000, 7000])
def test_a_long_path_is_refused_in_words(page, bare, length):
    token = page.url.removeprefix(bare)[1:]
    status, body = fetched(f"{bare}/{'a' * length}{token}")
    assert status == 414
    assert b"too long" in body


@pytest.mark.parametrize(
    "sent", [b"\x00\xff" * 500, b"GET / HTTP/9.9\r\n\r\n", b"\r\n\r\n", b"GET /" + b"a" * 70000, b""]
)
def test_what_is_no_request_prints_nothing_and_harms_nothing(page, bare, sent, capfd, caplog):
    host, _, port = bare.removeprefix("http://").partition(":")
    with socket.create_connection((host, int(port)), timeout=20) as stream, contextlib.suppress(OSError):
        stream.sendall(sent)
        stream.shutdown(socket.SHUT_WR)
        while stream.recv(4096):
            pass
    assert fetched(page.url)[0] == 200
    assert capfd.readouterr() == ("", "")
    assert caplog.records == []  # the root logger would print them


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "127.0.0.2", "localhost@evil.example", "0.0.0.0", ""],
)
def test_another_host_is_refused(page, host):
    """A name that an attacker lets mean this machine: DNS rebinding."""
    assert fetched(page.url, Host=host)[0] == 403


@pytest.mark.parametrize("host", ["localhost", "LOCALHOST:8080", "127.0.0.1", "127.0.0.1:9999", "[::1]:80"])
def test_this_machine_has_several_names_and_a_tunnel_other_ports(page, host):
    assert fetched(page.url, Host=host)[0] == 200


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", "http://localhost", "file://"])
def test_another_origin_is_refused(page, bare, origin):
    assert fetched(page.url, Origin=origin)[0] == 403
    assert not connected(page.url, origin)
    assert not connected(page.url, bare.replace("http", "https"))


def test_uploads_are_refused(page):
    """Viser would keep the parts of a file that is sent for any control, a slider say."""
    gui = page.page.server.gui
    control = next(iter(gui._gui_input_handle_from_uuid))
    before = gui._gui_input_handle_from_uuid[control].value
    start = {"source_component_uuid": control, "transfer_uuid": "t", "filename": "f", "mime_type": "text/plain"}
    part = {"source_component_uuid": control, "transfer_uuid": "t", "part_index": 0, "content": b"abcd"}
    messages = [
        {"type": "FileTransferStartUpload", **start, "part_count": 2, "size_bytes": 8},
        {"type": "FileTransferPart", **part},
        {"type": "FileTransferPart", **part, "part_index": 1},
    ]
    with connect(
        page.url.replace("http", "ws", 1), subprotocols=[f"viser-v{viser.__version__}"], max_size=None
    ) as socket:
        socket.recv(timeout=20)
        for message in messages:
            socket.send(msgspec.msgpack.encode(message))
        socket.ping().wait(20)
    assert not gui._current_file_upload_states
    assert gui._gui_input_handle_from_uuid[control].value == before


def test_what_cannot_be_guarded_is_not_served(monkeypatch):
    started = []

    class Unknown:
        def __init__(self, **options):
            started.append(self)

        def stop(self):
            started.remove(self)

    monkeypatch.setattr(viser, "ViserServer", Unknown)
    with pytest.raises(jn.JounceError, match="guarded"):
        quiet_server()
    assert not started


def test_servers_of_others_are_left_alone():
    """While a page starts, another WebSocket server of the process may start too."""
    import asyncio

    from websockets.asyncio import client, server

    async def talk():
        async with server.serve(lambda socket: socket.send("hello"), "127.0.0.1", 0) as listening:
            port = listening.sockets[0].getsockname()[1]
            async with client.connect(f"ws://127.0.0.1:{port}") as socket:
                return await socket.recv()

    with pytest.raises(jn.JounceError, match="guarded"), AccessControl().starting():  # as no page was started
        assert asyncio.run(talk()) == "hello"
