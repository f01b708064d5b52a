"""A server with the interface of S3, for campaigns whose nodes share no files."""

from __future__ import annotations

from collections.abc import Iterator
from uuid import uuid4

import pytest


@pytest.fixture(scope="session")
def s3_server() -> Iterator[str]:
    """Yield the address of the server."""
    pytest.importorskip("flask_cors")  # needed by the server, but not installed with moto
    server = pytest.importorskip("moto.server").ThreadedMotoServer("127.0.0.1", port=0)
    server.start()
    host, port = server.get_host_and_port()
    yield f"http://{host}:{port}"
    server.stop()


@pytest.fixture
def bucket(s3_server: str, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the address of a new bucket; environment variables name the server and the keys."""
    fs = pytest.importorskip("pyarrow.fs")
    for name, value in {
        "AWS_ACCESS_KEY_ID": "tester",
        "AWS_SECRET_ACCESS_KEY": "secret",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_ENDPOINT_URL": s3_server,
    }.items():
        monkeypatch.setenv(name, value)
    uri = f"s3://{uuid4().hex}"
    fs.FileSystem.from_uri(f"{uri}/x?allow_bucket_creation=true")[0].create_dir(uri[5:])
    return uri
