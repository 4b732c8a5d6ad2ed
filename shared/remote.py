"""Datasets elsewhere: :func:`copy` from and to all that fsspec reaches, and a cache for those that are read by URL.

A shard has the sha256 of the manifest before it gets its name, and the manifest is written last. So a copy that was
interrupted is no dataset yet, and the same call completes it.
"""

from __future__ import annotations

import errno
import hashlib
import logging
import os
import shutil
import socket
import ssl
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit, urlunsplit

import xarray as xr

from shared.ceiling import FILE_NAME as CEILING_FILE
from shared.errors import DatasetError
from shared.lock import FILE_NAME as LOCK_FILE
from shared.lock import FolderLock, at_work
from shared.logs import fields, heard, logger
from shared.manifest import (
    MANIFEST,
    MOST_MANIFEST,
    Manifest,
    check_shard_name,
    parse_manifest,
    sha256_of,
    temporary_name,
)
from shared.places import check_folder, is_url, url_of
from shared.progress import progress_bar
from shared.reading import MIB, read_bytes, read_text, why
from shared.results import Result

BESIDE = ("failures.jsonl", CEILING_FILE, "README.md")
"""What a dataset may have beside its shards; the manifest has no hash of these."""
ATTEMPTS = 3
"""Times that a file is asked for if the network fails in between: short failures pass, others need the user."""
SILENCE = 60.0
"""Seconds without a byte after which a web server counts as gone. The whole of a file may take any time."""
_BUCKETS = {"s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "oci", "oss"}
"""Protocols without folders, where to make a folder may mean to make a bucket."""
_EXTRA = {"fsspec", "s3fs", "aiobotocore", "botocore", "aiohttp"}
"""What the extra ``remote`` installs."""
_FULL = (errno.ENOSPC, errno.EDQUOT)
_DATASET = "a dataset made by `datagen run`"
_log = logger(__name__)


@dataclass(frozen=True, repr=False)
class Copied(Result):
    """What a copy did: shards that were copied, their size, and shards that were there already."""

    target: str
    systems: int
    shards: int
    bytes: int
    kept: int

    @property
    def headline(self) -> str:
        """What this is, in a few words."""
        there = f", {self.kept} shards were there" if self.kept else ""
        return f"{self.target}: {self.systems} systems, {self.shards} shards copied ({self.bytes / MIB:.1f} MiB){there}"

    def to_dataframe(self) -> Any:
        """One row."""
        return xr.Dataset({name: ("copy", [value]) for name, value in vars(self).items()}).to_dataframe()


class _Failed(DatasetError):
    """A transfer broke off; another attempt may succeed."""


class _Place(ABC):
    """Where a dataset lies: a folder here, or a URL."""

    shown: str

    def at(self, name: str) -> str:
        """How a message names a file."""
        return f"{self.shown}/{name}"

    @abstractmethod
    def fetch(self, name: str, to: Path) -> bool:
        """Write the content of a file to ``to``; False if there is no such file."""

    @abstractmethod
    def put(self, content: Path, name: str) -> None:
        """Take a file, which has its name once it is whole. ``content`` may be moved."""

    @abstractmethod
    def draft(self, name: str) -> Path:
        """Where to write what will be put."""

    def hash_of(self, name: str) -> str:
        """sha256 of a file; empty if there is none."""
        draft = self.draft(name)
        try:
            return sha256_of(draft) if self.fetch(name, draft) else ""
        finally:
            draft.unlink(missing_ok=True)


class _Folder(_Place):
    """A folder on this machine."""

    def __init__(self, path: Path) -> None:
        self.path, self.shown = path, str(path)

    def fetch(self, name: str, to: Path) -> bool:
        try:
            shutil.copyfile(self.path / name, to)
        except FileNotFoundError:
            return False
        return True

    def put(self, content: Path, name: str) -> None:
        with open(content, "rb+") as handle:
            os.fsync(handle.fileno())
        content.replace(self.path / name)

    def draft(self, name: str) -> Path:
        path = temporary_name(self.path / name)
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def hash_of(self, name: str) -> str:
        path = self.path / name
        return sha256_of(path) if path.is_file() else ""


class _Url(_Place):
    """A place that fsspec reaches."""

    def __init__(self, url: str, system: Any, root: str, drafts: Path) -> None:
        self.shown, self._system, self._root, self._drafts = _without_secrets(url), system, root, drafts

    def _path(self, name: str) -> str:
        if not self._root.startswith(("http://", "https://")):
            return f"{self._root.rstrip('/')}/{name}".lstrip("/" if not self._root else "")
        parts = urlsplit(self._root)  # a query may hold the signature that opens the place
        return urlunsplit(parts._replace(path=f"{parts.path.rstrip('/')}/{name}"))

    def fetch(self, name: str, to: Path) -> bool:
        try:
            with _in_words(self.at(name)):
                self._system.get_file(self._path(name), str(to))
        except FileNotFoundError:
            return False
        return to.is_file()  # a folder of that name is passed over without a word

    def put(self, content: Path, name: str) -> None:
        path = self._path(name)
        try:
            with _in_words(self.at(name)):
                protocols = self._system.protocol
                if not _BUCKETS & set([protocols] if isinstance(protocols, str) else protocols):
                    self._system.makedirs(path.rpartition("/")[0], exist_ok=True)
                with open(content, "rb") as whole, self._system.transaction, self._system.open(path, "wb") as out:
                    shutil.copyfileobj(whole, out, 8 * MIB)
                size = self._system.info(path)["size"]
        except FileNotFoundError:
            raise DatasetError(
                f"{self.at(name)}: cannot be written, as its bucket or folder is not there; expected one that is"
            ) from None
        if size != content.stat().st_size:
            raise _Failed(f"{self.at(name)}: arrived with {size} bytes; expected {content.stat().st_size}: copy again")

    def draft(self, name: str) -> Path:
        return self._drafts / Path(name).name


@contextmanager
def _opened(place: Path | str) -> Iterator[_Place]:
    """A place to read from or write to.

    Raises DatasetError if a URL is of no known kind, or what reaches it is not installed.
    """
    if not is_url(place):
        yield _Folder(Path(place))
        return
    url = url_of(place).rstrip("/").removesuffix(f"/{MANIFEST}")
    try:
        import fsspec
        from fsspec.implementations.local import LocalFileSystem

        options: dict[str, Any] = {"skip_instance_cache": True}  # whose listings would be those of before
        if url.startswith(("http://", "https://")):
            import aiohttp

            patience = aiohttp.ClientTimeout(total=None, sock_connect=SILENCE, sock_read=SILENCE)
            options["client_kwargs"] = {"timeout": patience}
        with _in_words(_without_secrets(url)):
            system, root = fsspec.core.url_to_fs(url, **options)
    except ImportError as error:
        missing = _chain(error)[-1].name or "fsspec"  # type: ignore[attr-defined]
        package = "'zeroshot-fmu[remote]'" if missing.partition(".")[0] in _EXTRA else missing
        raise DatasetError(
            f"{_without_secrets(url)}: reading it needs {missing}, which is not installed; pip install {package}"
        ) from None
    except FileNotFoundError:
        raise DatasetError(f"{_without_secrets(url)}: not there; expected the URL of a dataset's folder") from None
    if isinstance(system, LocalFileSystem):
        yield _Folder(Path(root))
        return
    with tempfile.TemporaryDirectory(prefix="zeroshot-copy-") as drafts:
        yield _Url(url, system, root, Path(drafts))


def _without_secrets(url: str) -> str:
    """A URL for messages, without a password or a signature."""
    parts = urlsplit(url)
    if parts.scheme in ("http", "https") or "@" in parts.netloc:
        return urlunsplit(parts._replace(netloc=parts.netloc.rpartition("@")[2], query=""))
    return url


def _chain(error: BaseException) -> list[BaseException]:
    chain = [error]
    while (cause := chain[-1].__cause__ or chain[-1].__context__) is not None and cause not in chain:
        chain.append(cause)
    return chain


@contextmanager
def _in_words(url: str) -> Iterator[None]:
    """Turn what a library of fsspec's raises into a sentence; these libraries have no kind of error in common.

    A missing file or package is left to the caller.
    """
    try:
        yield
    except (FileNotFoundError, ImportError):
        raise
    except NotImplementedError:
        raise DatasetError(f"{url}: nothing can be written there; expected a folder, or a URL such as s3://") from None
    except Exception as error:
        raise _sentence(url, error) from None
    except KeyboardInterrupt:
        logging.getLogger("asyncio").setLevel(logging.CRITICAL)  # which would complain of the transfer that is left
        raise


def _sentence(url: str, error: Exception) -> DatasetError:
    chain = _chain(error)
    kinds = {kind.__name__ for one in chain for kind in type(one).__mro__}
    statuses = [getattr(one, "status", None) for one in chain]
    status = next((one for one in statuses if isinstance(one, int)), None)
    full = [one for one in chain if isinstance(one, OSError) and one.errno in _FULL]
    if full:
        return DatasetError(f"{url}: cannot be stored here ({full[0].strerror}); expected more free space")
    if "PermissionError" in kinds or status in (401, 403) or {"NoCredentialsError", "PartialCredentialsError"} & kinds:
        return DatasetError(
            f"{url}: access is refused; expected credentials that open it (for s3:// AWS_PROFILE, or AWS_ACCESS_KEY_ID"
            " and AWS_SECRET_ACCESS_KEY; for a public bucket FSSPEC_S3_ANON=true)"
        )
    if status is not None:
        return _Failed(f"{url}: the server answers with status {status}; try again later, which goes on from here")
    if any(isinstance(one, ssl.SSLError) for one in chain):
        return DatasetError(f"{url}: its certificate is not trusted here; expected one that is: check the address")
    if any(isinstance(one, socket.gaierror) for one in chain) or {"ClientConnectorDNSError", "InvalidURL"} & kinds:
        return DatasetError(f"{url}: no such host; expected an address that this machine can reach: check its spelling")
    if {"ClientConnectorError", "EndpointConnectionError", "ConnectTimeoutError", "ConnectionRefusedError"} & kinds:
        return DatasetError(f"{url}: its host does not answer; check the address, the port and the network")
    if type(error) is ValueError and "::" in url:  # a server that cannot send parts of a file
        return DatasetError(f"{url}: cannot be read where it lies; expected the archive on this machine: download it")
    if type(error) is ValueError:  # a protocol that nobody knows, or an address that is none
        return DatasetError(
            f"{url}: is no URL that can be opened ({why(error)}); expected one such as https:// or s3://"
        )
    return _Failed(
        f"{url}: the transfer broke off ({why(error)}); give the same command again, which goes on from here"
    )


def _fetched(source: _Place, name: str, to: Path, sha256: str | None = None) -> bool:
    """Fetch a file whole, and with this hash; a transfer that fails is tried again."""
    for left in reversed(range(ATTEMPTS)):
        try:
            if not source.fetch(name, to):
                return False
            if sha256 is None or (digest := sha256_of(to)) == sha256:
                return True
            raise _Failed(
                f"{source.at(name)}: its sha256 is {digest}, and the manifest's {sha256}; expected a shard that is not"
                " damaged: mend it there with `datagen verify --repair`, and copy again"
            )
        except _Failed:
            if not left:
                raise
    raise AssertionError


def _manifest(source: _Place, draft: Path) -> Manifest | None:
    """The manifest of a place, whose text is then in ``draft``; None if there is none."""
    if not _fetched(source, MANIFEST, draft):
        return None
    text = read_text(draft, DatasetError, _DATASET, most=MOST_MANIFEST)
    manifest = parse_manifest(text, source.at(MANIFEST))
    for entry in manifest.shards:
        check_shard_name(entry, source.shown)
    return manifest


def _transfer(source: _Place, manifest: Manifest, text: Path, target: _Place, *, quiet: bool) -> Copied:
    """Bring a dataset to a place, its manifest last; shards that are there with the right hash stay."""
    copied = size = 0
    with progress_bar("shards", len(manifest.shards), shown=not quiet) as bar:
        for count, entry in enumerate(manifest.shards, start=1):
            name = f"shards/{entry.file}"
            if target.hash_of(name) != entry.sha256:
                size += _carry(source, name, target, entry.sha256)
                copied += 1
            bar.update(count, note=f"{size / MIB:.1f} MiB")
    for name in BESIDE:
        _carry(source, name, target)
    draft = target.draft(MANIFEST)
    try:
        shutil.copyfile(text, draft)
        target.put(draft, MANIFEST)
    finally:
        draft.unlink(missing_ok=True)
    return Copied(target.shown, len(manifest.done()), copied, size, len(manifest.shards) - copied)


def _carry(source: _Place, name: str, target: _Place, sha256: str | None = None) -> int:
    """Copy a file, and return its size [bytes]; one without a hash may be missing."""
    draft = target.draft(name)
    try:
        if _fetched(source, name, draft, sha256):
            size = draft.stat().st_size
            target.put(draft, name)
            return size
    finally:
        draft.unlink(missing_ok=True)
    if sha256 is not None:
        raise DatasetError(f"{source.at(name)}: the manifest lists this shard, but it is missing; copy it there first")
    return 0


def copy(source: Path | str, target: Path | str, *, quiet: bool = True) -> Copied:
    """Copy a dataset between folders and URLs; every shard is verified by its sha256.

    Parameters
    ----------
    source
        Folder or URL of a dataset, of a kind that fsspec reads.
    target
        Folder or URL: new, a copy that was interrupted, or the same dataset with fewer systems.

    Raises
    ------
    DatasetError
        If a place cannot be reached or written to, a shard is missing or damaged, or another dataset or anything else
        lies in ``target``. What was copied by then is kept, without a manifest.
    """
    with _opened(source) as there, _opened(target) as goal, tempfile.TemporaryDirectory(prefix="zeroshot-copy-") as own:
        _check_apart(there, goal)
        draft = Path(own, MANIFEST)
        manifest = _manifest(there, draft)
        if manifest is None:
            raise DatasetError(f"{there.at(MANIFEST)}: not there; expected the folder or URL of {_DATASET}")
        if isinstance(there, _Folder) and (holder := at_work(there.path)):
            _log.warning("%s: a run is at it (%s); what it has finished is copied", there.shown, holder)
        _check_target(manifest, there, goal, Path(own, "before"))
        try:
            if isinstance(goal, _Folder):
                goal.path.mkdir(parents=True, exist_ok=True)
            with FolderLock(goal.path) if isinstance(goal, _Folder) else nullcontext():
                if isinstance(goal, _Folder):
                    for path in (goal.path / "shards").glob(".*.tmp"):  # of a process that was killed
                        path.unlink(missing_ok=True)
                return _transfer(there, manifest, draft, goal, quiet=quiet)
        except OSError as error:
            name = error.filename2 or error.filename or goal.shown
            raise DatasetError(
                f"{name}: cannot be read or written ({error.strerror or error}); give the same command again when that"
                " is mended: it goes on"
            ) from None


def _check_apart(there: _Place, goal: _Place) -> None:
    if isinstance(there, _Folder) and isinstance(goal, _Folder):
        one, other = there.path.resolve(), goal.path.resolve()
        if other.is_relative_to(one):
            raise DatasetError(f"{goal.shown}: is {there.shown} or lies in it; expected another place to copy to")
    elif there.shown == goal.shown:
        raise DatasetError(f"{goal.shown}: is what to copy; expected another place to copy to")


def _check_target(manifest: Manifest, there: _Place, goal: _Place, draft: Path) -> None:
    """Refuse a target that holds something else, or systems that the source lacks."""
    if isinstance(goal, _Folder):
        check_folder(goal.path, DatasetError)
    before = _manifest(goal, draft)
    if before is None:
        if isinstance(goal, _Folder) and goal.path.is_dir():
            usual = {*BESIDE, "shards", LOCK_FILE}
            strange = sorted(path.name for path in goal.path.iterdir() if path.name not in usual)
            strange = [name for name in strange if not name.endswith(".tmp")]
            if strange:
                raise DatasetError(f"{goal.shown}: has other files ({strange[0]}); expected a new folder")
        return
    for field in ("system_hash", "fmu_sha256", "root_seed", "settings"):
        found, ours = getattr(before, field), getattr(manifest, field)
        if found != ours:
            raise DatasetError(
                f"{goal.shown}: holds another dataset ({field} is {found}, that of {there.shown} is {ours}); expected a"
                " new place"
            )
    lost = set(before.done()) - set(manifest.done())
    if lost:
        raise DatasetError(f"{goal.shown}: has {len(lost)} systems that {there.shown} lacks; expected a new place")


def cache_folder() -> Path:
    """Where datasets that were read by URL are kept: in ``XDG_CACHE_HOME``, or ``~/.cache``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "zeroshot-fmu", "datasets")


def cached(url: Path | str) -> Path:
    """The folder on this machine that has the content of a URL; what it lacks is fetched, and each shard verified.

    The sha256 of the manifest names the folder, so that what changes at the URL gets a folder of its own. The manifest
    is asked for each time. Raises DatasetError if the URL cannot be reached, holds no dataset, or the cache cannot be
    written.
    """
    with _opened(url) as there, tempfile.TemporaryDirectory(prefix="zeroshot-copy-") as own:
        if isinstance(there, _Folder):
            return there.path
        draft = Path(own, MANIFEST)
        manifest = _manifest(there, draft)
        if manifest is None:
            raise DatasetError(f"{there.at(MANIFEST)}: not there; expected the URL of {_DATASET}")
        content = read_bytes(draft, DatasetError, _DATASET, most=MOST_MANIFEST)
        goal = _Folder(cache_folder() / hashlib.sha256(content).hexdigest())
        try:
            found = _transfer(there, manifest, draft, goal, quiet=not heard())
        except OSError as error:
            raise DatasetError(
                f"{goal.shown}: the cache cannot be written ({error.strerror or error}); expected free space there, or"
                " set XDG_CACHE_HOME to another folder"
            ) from None
        facts = (there.shown, goal.shown, found.shards, found.bytes / MIB, found.kept)
        _log.info(
            "%s: read from %s, %d shards fetched (%.1f MiB), %d were there",
            *facts,
            extra=fields(url=there.shown, folder=goal.shown, fetched=found.shards, kept=found.kept),
        )
        return goal.path
