"""Weights and the card that describes them: two files that change at one moment, the one in which the card is renamed.

New weights are first written beside the ones that they replace, under a name with their hash. Then comes the card,
which names that hash, and only then do the weights take their usual name. Whenever a process is killed, the card that
is there has its own weights beside it, under one name or the other.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from pathlib import Path

from shared.errors import EstimatorError, ZeroshotError
from shared.reading import read_bytes, read_json
from shared.store import write_atomically

_HASH = "[0-9a-f]{64}"


def write_pair(weights: Path, data: bytes, card: Path, text: str, before: Callable[[], None] | None = None) -> None:
    """Write weights and their card; ``text`` is JSON that has the :func:`digest` of ``data`` as ``weights_sha256``.

    One process at a time may do so. ``before`` is called once the weights are written, and before they take the place
    of others: it removes what was said of those, which is still there where a disk is too full for new ones. Raises
    OSError if one of them cannot be written; the former pair is then still whole.
    """
    _settle(weights, card)
    write_atomically(_late(weights, digest(data)), data)
    if before is not None:
        before()
    write_atomically(card, text.encode())
    _settle(weights, card)


def remove_pair(weights: Path, card: Path) -> None:
    """Remove both, the card first: without it the weights are nothing."""
    card.unlink(missing_ok=True)
    _settle(weights, card)
    weights.unlink(missing_ok=True)


def read_pair(weights: Path, sha256: str, card: str, again: str) -> bytes:
    """The weights of a hash that a card names, from their usual place.

    For the sentence ``card`` is its name, and ``again`` what is to be done where they cannot be used. Raises
    EstimatorError if there are no weights, or others.
    """
    # they may take their usual name between the first look and the second
    for path, last in ((weights, False), (_late(weights, sha256), False), (weights, True)):
        try:
            data = read_bytes(path, EstimatorError, f"weights; {again}")
        except EstimatorError:
            if last:
                raise
            continue
        if digest(data) == sha256:
            return data
    raise EstimatorError(f"{weights}: damaged, or not the weights that {card} describes; {again}")


def digest(data: bytes) -> str:
    """sha256 of weights, as their card has it."""
    return hashlib.sha256(data).hexdigest()


def _late(weights: Path, sha256: str) -> Path:
    """Where weights of a hash wait for their usual name; a card that was changed is not let out of its folder."""
    return weights.with_stem(f"{weights.stem}-{sha256}") if re.fullmatch(_HASH, sha256) else weights


def _settle(weights: Path, card: Path) -> None:
    """Give waiting weights their usual name if the card is theirs; others, of an earlier kill, are removed."""
    waiting = [path for path in weights.parent.glob(f"{weights.stem}-*{weights.suffix}") if _is_late(weights, path)]
    if not waiting:
        return
    own = _late(weights, _named_by(card))
    for path in waiting:
        if path == own:
            path.replace(weights)
        else:
            path.unlink(missing_ok=True)


def _is_late(weights: Path, path: Path) -> bool:
    return re.fullmatch(f"{re.escape(weights.stem)}-{_HASH}", path.stem) is not None


def _named_by(card: Path) -> str:
    try:
        found = read_json(card, ZeroshotError, "a card")
    except ZeroshotError:  # none yet, or a damaged one
        return ""
    return str(found.get("weights_sha256", "")) if isinstance(found, dict) else ""
