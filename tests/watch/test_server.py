import contextlib
import hashlib
import http.client
import json
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import pytest

from conevo.errors import EnvironmentFailure, UsageError
from conevo.watch.server import LiveServer, serve
from conevo.watch.state import Watched
from watch.followed import append, record, write_run

SECRET = "a secret that no page may show"


@pytest.fixture
def folder(tmp_path):
    """A folder with two runs; next to it a file that must not be read."""
    (tmp_path / "secret.json").write_text(SECRET)
    write_run(tmp_path / "runs" / "run")
    write_run(tmp_path / "runs" / "<i>&?#%2f")
    return tmp_path / "runs"


@contextmanager
def serving(folder, replay=lambda label: f"<p>{label}"):
    with LiveServer(Watched(folders=[folder]), None, replay) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture
def server(folder):
    with serving(folder) as made:
        yield made


def ask(server, path, method="GET", host=None, **headers):
    """Return status, headers and body of an answer."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    connection.putrequest(method, path, skip_host=True)
    connection.putheader("Host", host or f"127.0.0.1:{server.port}")
    for name, value in headers.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    answer = connection.getresponse()
    found = answer.status, dict(answer.headers), answer.read().decode()
    connection.close()
    return found


def send(server, data):
    """Send bytes and return all that comes back until the connection is closed."""
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as connection:
        connection.sendall(data)
        connection.shutdown(socket.SHUT_WR)
        return b"".join(iter(lambda: connection.recv(65536), b"")).decode()


def test_the_page_the_state_and_a_run(server):
    status, headers, body = ask(server, "/")
    assert (status, headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    assert "<!doctype html>" in body[:20].lower()
    status, headers, body = ask(server, "/state.json")
    assert (status, headers["Content-Type"]) == (200, "application/json; charset=utf-8")
    assert [run["label"] for run in json.loads(body)["runs"]] == ["<i>&?#%2f", "run"]
    status, _, body = ask(server, "/run.json?label=%3Ci%3E%26%3F%23%252f")
    assert (status, json.loads(body)["number"]) == (200, [0, 1, 2])
    status, headers, body = ask(server, "/replay/%3Ci%3E%26%3F%23%252f")
    assert (status, headers["Content-Type"], body) == (
        200,
        "text/html; charset=utf-8",
        "<p><i>&?#%2f",
    )


def test_every_answer_is_kept_from_other_sites(server):
    answers = [
        ask(server, "/"),
        ask(server, "/state.json"),
        ask(server, "/run.json?label=run"),
        ask(server, "/replay/run"),
        ask(server, "/nothing"),
        ask(server, "/", "POST"),
        ask(server, "/", host="evil.example"),
    ]
    assert [status for status, _, _ in answers] == [200, 200, 200, 200, 404, 405, 403]
    for _, headers, _ in answers:
        policy = headers["Content-Security-Policy"]
        assert policy.startswith("default-src 'none'; script-src 'unsafe-inline'; ")
        assert "connect-src 'self'; img-src data: blob:;" in policy
        assert "frame-ancestors 'none'" in policy
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Cache-Control"] == "no-store"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"
        assert "Access-Control-Allow-Origin" not in headers


def test_a_state_that_has_not_changed_costs_nothing(server, folder):
    _, headers, _ = ask(server, "/state.json")
    tag = headers["ETag"]
    status, headers, body = ask(server, "/state.json", If_None_Match=tag)
    assert (status, headers["ETag"], body) == (304, tag, "")
    append(folder / "run", record(3))
    status, headers, body = ask(server, "/state.json", If_None_Match=tag)
    assert (status, json.loads(body)["runs"][1]["generation"]) == (200, 4)
    assert headers["ETag"] != tag
    with serving(folder) as other:  # the same version of another server is another state
        assert ask(other, "/state.json", If_None_Match=tag)[0] == 200


@pytest.mark.parametrize(
    "path",
    [
        "/index.html",
        "/../secret.json",
        "/%2e%2e/secret.json",
        "/runs/",
        "/run",
        "/run/config.toml",
        "/state.json/",
        "/STATE.json",
        "/run.json",
        "/run.json?label=",
        "/run.json?label=../secret.json",
        "/run.json?label=%2e%2e%2fsecret.json",
        "/run.json?label=run/../run",
        "/run.json?label=run%00",
        "/run.json?label=%ff",
        "/run.json?lable=run",
        "/run.json?run",
        "/run.json?" + "&".join(f"{k}=1" for k in range(99)),
        "/replay/",
        "/replay/run/",
        "/replay/../runs/run",
        "/replay/..%2f..%2fsecret.json",
        "/replay/%2e%2e%2fruns%2frun",
        "/replay/%252e%252e",
        "/replay/RUN",
        "run",
        "*",
        "http://127.0.0.1/state.json",
        "file:///etc/passwd",
    ],
)
def test_any_other_path_is_refused_in_one_line(server, path):
    status, headers, body = ask(server, path)
    assert status == 404
    assert headers["Content-Type"] == "text/plain; charset=utf-8"
    assert body == "nothing is at this address\n"


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT", "what"])
def test_only_get_and_head_are_answered(server, method):
    status, headers, body = ask(server, "/state.json", method)
    assert (status, headers["Allow"]) == (405, "GET, HEAD")
    assert body == "only GET and HEAD are answered\n"


def test_head_is_get_without_the_body(server):
    for path in ("/", "/state.json", "/run.json?label=run", "/replay/run", "/nothing"):
        status, headers, body = ask(server, path, "HEAD")
        expected = ask(server, path)
        assert (status, body) == (expected[0], "")
        assert headers["Content-Length"] == str(len(expected[2].encode()))
        request = f"HEAD {path} HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n"
        assert send(server, request.encode()).endswith("\r\n\r\n")


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{port}", "127.0.0.1", "localhost:1", "[::1]:{port}", ""]
)
def test_another_host_is_refused(server, host):
    data = f"GET /state.json HTTP/1.1\r\nHost: {host.format(port=server.port)}\r\n\r\n"
    answer = send(server, data.encode())
    assert answer.startswith("HTTP/1.1 403 ")
    assert f"only http://127.0.0.1:{server.port}/ and http://localhost" in answer


def test_the_local_host_has_two_names(server):
    assert ask(server, "/", host=f"localhost:{server.port}")[0] == 200


@pytest.mark.parametrize("lines", ["", "Host: 127.0.0.1:{port}\r\nHost: 127.0.0.1:{port}\r\n"])
def test_a_request_has_one_host(server, lines):
    data = f"GET /state.json HTTP/1.1\r\n{lines.format(port=server.port)}\r\n"
    assert send(server, data.encode()).startswith("HTTP/1.1 403 ")


def test_requests_of_other_sites_are_refused(server):
    for site in ("cross-site", "same-site"):
        status, _, body = ask(server, "/replay/run", Sec_Fetch_Site=site, Sec_Fetch_Dest="image")
        assert (status, body) == (403, "requests from other sites are refused\n")
        assert ask(server, "/", Sec_Fetch_Site=site, Sec_Fetch_Dest="document")[0] == 200
    assert (
        ask(server, "/state.json", Sec_Fetch_Site="same-origin", Sec_Fetch_Dest="empty")[0] == 200
    )


@pytest.mark.parametrize(
    ("request_", "status"),
    [
        (b"GET /" + b"a" * 70_000 + b" HTTP/1.1\r\n\r\n", 414),
        (b"GET / HTTP/1.1\r\nX: " + b"a" * 70_000 + b"\r\n\r\n", 431),
        (b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 200 + b"\r\n", 431),
        (b"GET / HTTP/7.7\r\n\r\n", 505),
        (b"nonsense\r\n\r\n", 400),
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", 400),
        (b"GET / what HTTP/1.1\r\n\r\n", 400),
    ],
)
def test_nonsense_is_refused_and_the_server_keeps_running(server, capfd, request_, status):
    answer = send(server, request_)
    head, _, body = answer.partition("\r\n\r\n")
    assert f" {status} " in answer.splitlines()[0]
    assert "text/plain" in head
    assert body.count("\n") == 1
    assert "<" not in body or "text/html" not in head
    assert ask(server, "/state.json")[0] == 200
    assert capfd.readouterr() == ("", "")  # single requests are not logged


def test_data_after_a_refused_request_is_not_read(server):
    smuggled = f"GET /state.json HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n".encode()
    for method in (b"POST", b"GET"):
        head = (
            method
            + f" / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n".encode()
            + f"Content-Length: {len(smuggled)}\r\n\r\n".encode()
        )
        assert send(server, head + smuggled).count("HTTP/1.1 ") == 1


def test_a_connection_serves_many_requests(server):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    for _ in range(3):
        connection.request("GET", "/state.json")
        answer = connection.getresponse()
        assert (answer.status, len(answer.read()) > 100) == (200, True)
    connection.close()


def test_clients_that_leave_or_wait_do_not_stop_others(server, capfd):
    slow = socket.create_connection(("127.0.0.1", server.port))
    slow.sendall(b"GET /state.json HT")
    for _ in range(5):  # sends a request and leaves
        with socket.create_connection(("127.0.0.1", server.port)) as gone:
            gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\0\0\0\0\0\0\0")
            gone.sendall(f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n\r\n".encode())
    began = time.monotonic()
    assert ask(server, "/state.json")[0] == 200
    assert time.monotonic() - began < 2
    slow.close()
    time.sleep(0.1)
    assert capfd.readouterr() == ("", "")


def threads_of(server):
    return [t for t in threading.enumerate() if "process_request_thread" in t.name]


def test_a_client_that_asks_letter_by_letter_is_not_waited_for(server, monkeypatch, capfd):
    monkeypatch.setattr("conevo.watch.server.ASKING", 0.3)
    before = len(threads_of(server))
    began = time.monotonic()
    with (
        socket.create_connection(("127.0.0.1", server.port), timeout=10) as slow,
        contextlib.suppress(OSError),
    ):
        for letter in b"GET /state.json HTTP/1.1\r\nX: " + b"x" * 1000:
            slow.sendall(bytes([letter]))
            time.sleep(0.02)
    assert 0.25 < time.monotonic() - began < 5
    until = time.monotonic() + 5
    while len(threads_of(server)) > before:
        assert time.monotonic() < until
        time.sleep(0.01)
    assert server._deadlines == {}
    assert ask(server, "/state.json")[0] == 200
    assert capfd.readouterr() == ("", "")


def test_a_client_that_does_not_take_its_answer_is_not_waited_for(folder, monkeypatch, capfd):
    monkeypatch.setattr("conevo.watch.server.SENDING", 0.2)
    monkeypatch.setattr("conevo.watch.server.SLOWEST", 1e9)
    with serving(folder, lambda label: "x" * 50_000_000) as server:
        before = len(threads_of(server))
        with socket.create_connection(("127.0.0.1", server.port), timeout=10) as slow:
            host = f"Host: 127.0.0.1:{server.port}\r\n\r\n"
            slow.sendall(f"GET /replay/run HTTP/1.1\r\n{host}".encode())
            time.sleep(0.1)
            assert len(server._deadlines) == 1
            until = time.monotonic() + 5
            while server._deadlines or len(threads_of(server)) > before:
                assert time.monotonic() < until
                time.sleep(0.01)
        assert ask(server, "/state.json")[0] == 200
    assert capfd.readouterr() == ("", "")


def test_making_a_replay_may_take_longer_than_asking_for_it(folder, monkeypatch):
    monkeypatch.setattr("conevo.watch.server.ASKING", 0.1)
    monkeypatch.setattr("conevo.watch.server.SENDING", 0.1)
    with serving(folder, lambda label: time.sleep(0.5) or label) as server:
        assert ask(server, "/replay/run")[::2] == (200, "run")


def test_the_number_of_connections_is_limited(server, monkeypatch, capfd):
    monkeypatch.setattr("conevo.watch.server.MOST", 3)
    held = [socket.create_connection(("127.0.0.1", server.port), timeout=10) for _ in range(3)]
    until = time.monotonic() + 5
    while len(server._deadlines) < 3:
        assert time.monotonic() < until
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as one_more:
        assert one_more.recv(10) == b""
    for connection in held:
        connection.close()
    until = time.monotonic() + 5
    while server._deadlines:
        assert time.monotonic() < until
    assert ask(server, "/state.json")[0] == 200
    assert capfd.readouterr() == ("", "")


def test_a_replay_that_cannot_be_made_is_one_line(folder):
    def replay(label):
        raise UsageError(f"{label} was made with\nother kernels <script>")

    with serving(folder, replay) as server:
        status, headers, body = ask(server, "/replay/run")
    assert (status, headers["Content-Type"]) == (409, "text/plain; charset=utf-8")
    assert body == "run was made with other kernels <script>\n"


def test_one_replay_is_made_at_a_time(folder):
    active, most, calls = 0, 0, []
    begun, go_on = threading.Event(), threading.Event()

    def replay(label):
        nonlocal active, most
        active += 1
        most = max(most, active)
        calls.append(label)
        begun.set()
        go_on.wait(10)
        time.sleep(0.02)
        active -= 1
        return label

    with serving(folder, replay) as server:
        others = [threading.Thread(target=ask, args=(server, "/replay/run")) for _ in range(4)]
        for thread in others:
            thread.start()
        assert begun.wait(10)
        assert ask(server, "/state.json")[0] == 200  # continues meanwhile
        assert not go_on.is_set()
        go_on.set()
        for thread in others:
            thread.join()
    assert (most, calls) == (1, ["run"] * 4)


def test_the_server_listens_to_the_local_host_only(server):
    assert server.socket.getsockname()[0] == "127.0.0.1"
    assert server.address == f"http://127.0.0.1:{server.port}/"


def test_a_port_in_use_is_one_clear_line(folder, server):
    with pytest.raises(EnvironmentFailure, match=rf"port {server.port} of .* in use; .*--port"):
        LiveServer(Watched(folders=[folder]), server.port, str)
    with pytest.raises(EnvironmentFailure, match=r"port 70000 of .* cannot be used .*--port"):
        serve(Watched(folders=[folder]), 70000, str)


def test_nothing_is_written(server, folder):
    def digest():
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        return [(p, p.stat().st_mtime_ns, hashlib.sha256(p.read_bytes()).digest()) for p in files]

    before = digest()
    for path in ("/", "/state.json", "/run.json?label=run", "/replay/run", "/nothing"):
        ask(server, path)
    assert digest() == before


SERVE = """
import signal, sys
from pathlib import Path
from conevo.watch.state import Watched
from conevo.watch.server import serve
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job's children ignore it
serve(Watched(folders=[Path(sys.argv[1])]), None, str, lambda address: print(address, flush=True))
print("the end", flush=True)
"""


def test_ctrl_c_ends_it_cleanly(folder):
    command = [sys.executable, "-c", SERVE, str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        address = process.stdout.readline().decode().strip()
        port = int(address.rstrip("/").rpartition(":")[2])
        held = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
        held.request("GET", "/state.json")
        assert held.getresponse().status == 200  # the connection stays open
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20)
    assert (process.returncode, out, err) == (0, b"the end\n", b"")
