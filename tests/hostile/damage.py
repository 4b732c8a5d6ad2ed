"""How a file comes to harm: by chance (cut off, a bit, a block), or by somebody who knows its form.

Every function takes the whole content and a source of random choices, Hypothesis's or Python's own.
"""

import json
import re
from random import Random

BLOCKS = (b"\0", b"\xff", b"9", b"[", b"{", b'"', b"-", b"\n", b",", b"\xc3\x28", b"\x1a\x45\xdf\xa3", b"nan")
WORDS = (
    *("nan", "-inf", "Infinity", "1e999", "-1", "0", "99999999999999999999", "1e300", "1e-300", "true", "null", '""'),
    *("[]", "{}", "[[1]]", '"../../x"', '"/etc/passwd"', '"\\u0000"', "'x'", '"' + "x" * 300 + '"', "0x" + "f" * 5000),
    *("9" * 5000, "[" * 2000, '{"a":' * 2000, ".a" * 200, "1979-13-45", "\0", '"\\ud800"', "2001-01-01T00:00:00Z"),
)
"""What may stand in a text where something else was."""
VALUES = (
    *(float("nan"), float("inf"), -1, 0, 2**31, 2**63, 10**30, 1e300, 1e-300, -0.0, True, None, "", "x", "../../x"),
    *("\0", "x" * 300, [], {}, [[]], [None], {"x": 1}, [0] * 50, "0-99999999999", "7*9999999999", "nan", 0.5, "\ud800"),
)
"""What may stand in a table where something else was."""


def damage_bytes(data: bytes, random: Random) -> bytes:
    """Cut, flip, overwrite, insert, remove or repeat."""
    if not data:
        return b"\0"
    out = bytearray(data)
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        at = random.randrange(len(out)) if out else 0
        how = random.randrange(8)
        size = random.choice((1, 2, 4, 8, 64, 512))
        if how == 0:
            del out[at:]
        elif how in (1, 2) and out:
            out[at] ^= 1 << random.randrange(8)
        elif how == 3:
            out[at : at + size] = (random.choice(BLOCKS) * size)[: len(out[at : at + size])]
        elif how == 4:
            out[at:at] = random.choice(BLOCKS) * size
        elif how == 5:
            del out[at : at + size]
        elif how == 6:
            out[at:at] = out[at : at + size]
        else:
            out[at : at + size] = bytes(random.randrange(256) for _ in out[at : at + min(size, 16)])
    return bytes(out)


_TOKEN = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?|\"[^\"\n]*\"|true|false|null|\b[A-Za-z_]\w*\b")


def damage_text(data: bytes, random: Random) -> bytes:
    """A number, a string or a word becomes something else; now and then only bytes are damaged."""
    found = list(_TOKEN.finditer(data))
    if not found or random.randrange(4) == 0:
        return damage_bytes(data, random)
    one = random.choice(found)
    word = random.choice(WORDS).encode()
    return data[: one.start()] + word + data[one.end() :]


def damage_json(data: bytes, random: Random) -> bytes:
    """A value anywhere in the tables becomes something else or is gone; now and then only text or bytes are damaged."""
    if random.randrange(4) == 0:
        return damage_text(data, random)
    raw = json.loads(data)
    at = raw
    while True:
        keys = list(at) if isinstance(at, dict) else list(range(len(at)))
        if not keys:
            return damage_text(data, random)
        key = random.choice(keys)
        if isinstance(at[key], dict | list) and at[key] and random.randrange(4):
            at = at[key]
            continue
        if random.randrange(5) == 0:
            del at[key]
        else:
            at[key] = random.choice(VALUES)
        return json.dumps(raw).encode()
