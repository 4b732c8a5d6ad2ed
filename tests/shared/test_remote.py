"""Datasets elsewhere, held against a web server, an S3 server and the bytes on the disk."""

import functools
import http.server
import json
import logging
import os
import shutil
import socket
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from datagen import copy
from shared import remote
from shared.errors import DatasetError
from shared.places import is_url, url_of
from shared.store import DatasetFolder, read_manifest, sha256_of
from tests.shared.datasets import write_dataset


def dataset(folder, blocks, seed=3):
    """One that is to have six systems, with a card."""
    write_dataset(folder, blocks, seed, systems=6, shard_size=2)
    (folder / "README.md").write_text("a card")
    return folder


@pytest.fixture
def ours(tmp_path):
    return dataset(tmp_path / "ours", [[0, 1], [2, 3], [4, 5]])


def content(folder):
    """Bytes of every file of a dataset, by name, without the lock."""
    files = [path for path in Path(folder).rglob("*") if path.is_file() and path.name != ".lock"]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


class Handler(http.server.SimpleHTTPRequestHandler):
    """A web server that counts what is asked for, and fails as it is told."""

    def do_GET(self):
        self.server.asked.append(self.path)
        if self.server.fail and self.server.fail(self.path):
            self.send_response(self.server.status)
            self.send_header("Content-Length", "1000")
            self.end_headers()
            self.wfile.write(b"half")
            self.close_connection = True
            return
        super().do_GET()

    def log_message(self, *_):
        pass


@pytest.fixture
def web(tmp_path):
    with http.server.ThreadingHTTPServer(
        ("127.0.0.1", 0), functools.partial(Handler, directory=str(tmp_path))
    ) as server:
        server.asked, server.fail, server.status = [], None, 200
        server.url = f"http://127.0.0.1:{server.server_port}"
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@pytest.fixture
def bucket(monkeypatch):
    """A bucket of an S3 server in this process."""
    moto = pytest.importorskip("moto.server")
    boto3 = pytest.importorskip("boto3")
    for name, value in (("AWS_ACCESS_KEY_ID", "us"), ("AWS_SECRET_ACCESS_KEY", "ours"), ("AWS_DEFAULT_REGION", "eu")):
        monkeypatch.setenv(name, value)
    server = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
    client = boto3.client("s3")
    client.create_bucket(Bucket="rooms", CreateBucketConfiguration={"LocationConstraint": "eu"})
    yield client
    server.stop()


def test_a_copy_from_a_web_server_has_the_same_bytes_and_fetches_no_shard_twice(ours, web, tmp_path):
    done = copy(f"{web.url}/ours", tmp_path / "copy")
    assert content(tmp_path / "copy") == content(ours)
    assert (done.systems, done.shards, done.kept) == (6, 3, 0)
    assert done.bytes == sum(path.stat().st_size for path in (ours / "shards").iterdir())
    damaged = tmp_path / "copy" / "shards" / "shard-000001.nc"
    damaged.write_bytes(damaged.read_bytes()[:-1] + b"?")
    web.asked.clear()
    assert (copy(f"{web.url}/ours/", tmp_path / "copy").shards, content(tmp_path / "copy")) == (1, content(ours))
    assert [path for path in web.asked if path.endswith(".nc")] == ["/ours/shards/shard-000001.nc"]


def test_an_interrupted_copy_is_no_dataset_and_goes_on(ours, web, tmp_path):
    web.fail = lambda path: path.endswith("shard-000001.nc")
    with pytest.raises(DatasetError, match=r"ours/shards/shard-000001\.nc: the transfer broke off .* goes on"):
        copy(f"{web.url}/ours", tmp_path / "copy")
    assert sorted(content(tmp_path / "copy")) == ["shards/shard-000000.nc"]
    with pytest.raises(DatasetError, match=r"manifest\.json: no such file"):
        read_manifest(tmp_path / "copy")
    web.fail = None
    done = copy(f"{web.url}/ours", tmp_path / "copy")
    assert (done.shards, done.kept) == (2, 1)
    assert content(tmp_path / "copy") == content(ours)


def test_a_short_failure_passes(ours, web, tmp_path):
    web.fail = lambda path: path.endswith("shard-000001.nc") and web.asked.count(path) == 1
    assert copy(f"{web.url}/ours", tmp_path / "copy").shards == 3
    assert content(tmp_path / "copy") == content(ours)


@pytest.mark.slow
def test_a_dataset_goes_to_a_bucket_and_back(ours, bucket, tmp_path):
    with pytest.raises(DatasetError, match=r"s3://halls/a/.*: cannot be written, as its bucket or folder is not there"):
        copy(ours, "s3://halls/a")
    copy(ours, "s3://rooms/a/b")
    there = {one["Key"]: one["Size"] for one in bucket.list_objects_v2(Bucket="rooms")["Contents"]}
    assert there == {f"a/b/{name}": len(data) for name, data in content(ours).items()}
    bucket.put_object(Bucket="rooms", Key="a/b/shards/shard-000002.nc", Body=b"x" * there["a/b/shards/shard-000002.nc"])
    with pytest.raises(DatasetError, match=r"s3://rooms/a/b/shards/shard-000002\.nc: its sha256 is"):
        copy("s3://rooms/a/b", tmp_path / "back")
    assert copy(ours, "s3://rooms/a/b").shards == 1
    assert copy("s3://rooms/a/b", tmp_path / "back").kept == 2
    assert content(tmp_path / "back") == content(ours)
    with pytest.raises(DatasetError, match=r"s3://rooms/c/manifest\.json: not there; expected"):
        copy("s3://rooms/c", tmp_path / "other")


def test_a_place_of_another_kind_gets_a_file_only_whole(ours, tmp_path, monkeypatch):
    fsspec = pytest.importorskip("fsspec")
    memory = fsspec.filesystem("memory")
    monkeypatch.setattr(type(memory), "store", {})
    monkeypatch.setattr(type(memory), "pseudo_dirs", [""])
    copy(ours, "memory://a")
    assert {name.removeprefix("/a/"): memory.cat_file(name) for name in memory.find("/a")} == content(ours)
    go = remote.shutil.copyfileobj

    def cut(whole, out, size):
        out.write(whole.read(100))
        raise OSError("gone")

    monkeypatch.setattr(remote.shutil, "copyfileobj", cut)
    with pytest.raises(DatasetError, match=r"memory://b/shards/shard-000000\.nc: the transfer broke off \(gone\)"):
        copy("memory://a", "memory://b")
    assert memory.find("/b") == []
    monkeypatch.setattr(remote.shutil, "copyfileobj", go)
    assert copy("memory://a", "memory://b").shards == 3


def test_a_dataset_grows_where_it_is_and_nothing_is_lost(ours, tmp_path):
    small = dataset(tmp_path / "small", [[0, 1], [2, 3]])
    copy(small, tmp_path / "copy")
    assert copy(ours, tmp_path / "copy").kept == 2
    assert content(tmp_path / "copy") == content(ours)
    with pytest.raises(DatasetError, match=r"copy: has 2 systems that .*small lacks; expected a new place"):
        copy(small, tmp_path / "copy")
    other = dataset(tmp_path / "other", [[0, 1]], seed=4)
    with pytest.raises(DatasetError, match=r"copy: holds another dataset \(root_seed is 3, that of .*other is 4\)"):
        copy(other, tmp_path / "copy")
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "text.tex").touch()
    with pytest.raises(DatasetError, match=r"thesis: has other files \(text\.tex\); expected a new folder"):
        copy(ours, tmp_path / "thesis")
    with pytest.raises(DatasetError, match="ours or lies in it"):
        copy(ours, ours / "copy")


def test_a_url_is_read_through_a_cache_whose_shards_are_verified(ours, web, tmp_path, monkeypatch, caplog):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    url = f"{web.url}/ours"
    caplog.set_level(logging.INFO, "zeroshot")
    there = DatasetFolder(Path(url))  # a command line makes a Path of it
    assert there.folder.name == sha256_of(ours / "manifest.json")
    assert [one.message for one in caplog.records if "read from" in one.message] == [
        f"{url}: read from {there.folder}, 3 shards fetched"
        f" ({sum(one.stat().st_size for one in (ours / 'shards').iterdir()) / 2**20:.1f} MiB), 0 were there"
    ]
    np.testing.assert_array_equal(there.load().values, DatasetFolder(ours).load().values)
    shard = there.folder / "shards" / "shard-000000.nc"
    shard.write_bytes(shard.read_bytes()[:-1])
    web.asked.clear()
    assert DatasetFolder(url).load().values.shape[0] == 6
    assert [path for path in web.asked if path.endswith(".nc")] == ["/ours/shards/shard-000000.nc"]
    shutil.rmtree(ours)
    dataset(ours, [[0, 1]])
    assert len(DatasetFolder(url).manifest.done()) == 2  # another content, so another folder
    assert len(DatasetFolder(there.folder).manifest.done()) == 6


def closed_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def test_each_mistake_has_its_sentence(ours, web, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(remote, "ATTEMPTS", 1)
    cases = {
        f"{web.url}/theirs": r"theirs/manifest\.json: not there; expected the URL of a dataset made by",
        f"http://127.0.0.1:{closed_port()}/ours": r"manifest\.json: its host does not answer; check the address",
        "http://no.such.host.invalid/ours": r"manifest\.json: no such host; expected an address",
        "nonsense://host/ours": r"nonsense://host/ours: is no URL that can be opened \(.*nonsense\); expected one such",
        "gs://bucket/ours": r"gs://bucket/ours: reading it needs gcsfs, which is not installed; pip install gcsfs",
    }
    for url, sentence in cases.items():
        with pytest.raises(DatasetError, match=sentence):
            DatasetFolder(url)
    for status, sentence in ((403, "access is refused"), (503, "the server answers with status 503; try again later")):
        web.fail, web.status = lambda path: True, status
        with pytest.raises(DatasetError, match=sentence) as error:
            DatasetFolder(f"{web.url.replace('//', '//me:secret@')}/ours?signature=secret")
        assert "secret" not in str(error.value)
    web.fail = None
    assert not (tmp_path / "cache").exists()
    with pytest.raises(DatasetError, match=r"target/.*: nothing can be written there; expected a folder, or a URL"):
        copy(ours, f"{web.url}/target")
    (ours / "shards" / "shard-000001.nc").write_bytes(b"damaged")
    with pytest.raises(DatasetError, match=r"shard-000001\.nc: its sha256 is \w+, and the manifest's .* --repair"):
        copy(f"{web.url}/ours", tmp_path / "copy")
    with pytest.raises(DatasetError, match=r"shard-000001\.nc: its sha256 is \w+, and the manifest's .* --repair"):
        copy(ours, tmp_path / "copy")
    (ours / "shards" / "shard-000001.nc").unlink()
    with pytest.raises(DatasetError, match=r"shard-000001\.nc: the manifest lists this shard, but it is missing"):
        copy(f"{web.url}/ours", tmp_path / "copy")
    raw = json.loads((ours / "manifest.json").read_text())
    raw["shards"][0]["file"] = "../../shard.nc"
    (ours / "manifest.json").write_text(json.dumps(raw))
    with pytest.raises(DatasetError, match=r"shard '\.\./\.\./shard\.nc' is not a plain file name"):
        copy(f"{web.url}/ours", tmp_path / "copy")


def test_the_extra_is_named_where_it_lacks(monkeypatch, tmp_path):
    from fsspec.registry import _registry

    for module in ("s3fs", "aiohttp"):
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.delitem(_registry, "s3", raising=False)
    for url, module in (("s3://rooms/a", "s3fs"), ("https://example.org/a", "aiohttp")):
        with pytest.raises(DatasetError, match=rf"needs {module}, which.*; pip install 'zeroshot-fmu\[remote\]'"):
            copy(url, tmp_path / "copy")


@pytest.mark.skipif(os.name == "nt", reason="a Path has other slashes there")
def test_a_url_is_known_also_as_a_path():
    for url in ("https://host/a?b", "s3://bucket/a", "file:///a/b", "zip://::https://host/a.zip"):
        assert is_url(url)
        assert is_url(Path(url))
        assert url_of(Path(url)) == url_of(url) == url
    assert not any(map(is_url, ("a/b", Path("C:/a"), Path("/a:/b"), None)))
