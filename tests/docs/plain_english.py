"""How long the sentences of the documents are, and which phrases they use that a reader has to guess at.

Run it at the checkout's root. ``python tests/docs/plain_english.py`` prints each page with its mean and longest
sentence. ``python tests/docs/plain_english.py docs/how.md`` prints a page's ten longest sentences and its phrases.

Headings, code, tables, pictures and the targets of links are left out; a piece of code within a sentence is one word.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MEAN, LONGEST = 17.0, 45
"""Words of a sentence: on average over all pages, and at most."""
GENERATED = ("docs/reference/", "docs/licences.md")
"""Pages whose sentences come from docstrings or from other projects."""
PHRASES = {
    r"\btold\b": "say, print, show, report, estimate or distinguish",
    r"\b(is|are|was) telling\b": "say or show",
    r"\bat (its|their) word\b": "say what is trusted",
    r"\bby heart\b": "memorise",
    r"\b(come|comes|came|coming) to rest\b": "converge",
    r"\bat rest\b": "converged, or constant",
    r"\bdrawn at random\b": "say what is compared with chance",
    r"\bmade of\b": "consist of, or contain",
    r"\bwhat is learned\b": "name the features",
    r"\bof (one's|your|its|their) own\b": "your own ..., or leave it out",
    r"\bin nobody's way\b": "does not block",
    r"\bnobody\b": "unknown, not measured, not counted",
    r"\bpersons\b": "occupants",
    r"\bstraight lines?\b": "linearisation, or linear interpolation",
    r"\bthe days? kept\b|\bkept days?\b": "held-out days",
    r"\btwins\b": "bootstrap replicates",
    r"\bhold(s|ing)? the truth\b|\bheld the truth\b": "cover",
    r"\bheld against\b|\bhold(s|ing)? .{0,30} against\b": "compare with, check against",
    r"\bno longer\b|\bused to be\b|\bhas been mended\b": "say what is true; history stands in the changelog",
    r"\bwhatever (comes|twins|they) do\b": "say in which case",
    r"\bhonest(ly)?\b": "calibrated, or covers 90 %",
    r"\bnought\b": "zero",
    r"\bthat anybody could\b|\blets? anybody\b": "say who",
    r"\bbegins? anew\b": "start again",
    r"\bwhat [a-z]+ (makes|make) of (it|them)\b": "say what is computed",
    r"\bfor want of\b|\bit is as if\b|\bas it were\b|\bhangs? on\b": "say it plainly",
}
"""Phrases that are not used, and what to write instead."""
_BLOCK_TAGS = r"</?(?:p|li|ul|ol|div|h\d|td|th|tr|table|details|summary|title|br|pre|img|body|html|head)\b[^>]*>"


def pages() -> list[Path]:
    """The documents whose sentences are measured."""
    found = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
    found += [path for folder in ("fmus", "docker") for path in sorted((ROOT / folder).rglob("*.md"))]
    found += sorted((ROOT / "diagnosis/templates").glob("*.html.j2"))
    return [path for path in found if not path.relative_to(ROOT).as_posix().startswith(GENERATED)]


def sentences(path: Path) -> list[str]:
    """The sentences of a page, as text in one line each."""
    text = path.read_text(encoding="utf-8")
    blocks = _of_template(text) if path.suffix == ".j2" else _of_markdown(text)
    whole = (" ".join(block.split()) for block in blocks)
    split = (one for block in whole for one in re.split(r"(?<=[.!?])[\"')*]*\s+(?=[\"'(*\[]*[A-Z0-9`*X])", block))
    return [one for one in split if words(one) > 3]


def words(sentence: str) -> int:
    """How many words a sentence has; figures count, signs do not."""
    return sum(bool(re.search(r"\w", word)) for word in sentence.split())


def phrases(path: Path) -> list[str]:
    """What a page says that is among :data:`PHRASES`, with the sentence and what to write instead."""
    return [
        f"{match[0]!r} (write: {instead}): {one}"
        for one in sentences(path)
        for phrase, instead in PHRASES.items()
        for match in re.finditer(phrase, one, re.IGNORECASE)
    ]


def mean(lengths: list[int]) -> float:
    """Mean length of sentences [words]."""
    return sum(lengths) / max(len(lengths), 1)


def _of_markdown(text: str) -> list[str]:
    """Paragraphs and items of a list."""
    text = re.sub(r"^(`{3,})[^\n]*\n.*?^\1`*$", "\n", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"<!--.*?-->|!\[[^\]]*\]\([^)]*\)|</?[a-z][^>]*>", " ", text, flags=re.DOTALL)
    text = re.sub(r"^(#|\||    +[^\s*-]|:::|- :).*$", "\n", text, flags=re.MULTILINE)
    text = re.sub(r"`[^`]+`", "X", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)(\{[^}]*\})?", r"\1", text)
    text = re.sub(r"^\s*([-*]|\d+\.)\s+", "\n\n", text, flags=re.MULTILINE)
    return re.split(r"\n\s*\n", text.replace("**", "").replace("*", ""))


def _of_template(text: str) -> list[str]:
    """Texts between the tags of a page; of branches the first, and a value is one word."""
    branch = re.compile(r"\{%-? if (?:(?!\{%-? (?:if|endif)).)*?\{%-? endif -?%\}", re.DOTALL)
    text = re.sub(r"<style>.*?</style>|\{#.*?#\}", " ", text, flags=re.DOTALL)
    while found := branch.search(text):
        first = re.split(r"\{%-? (?:else|elif)[^%]*%\}|\{%-? endif -?%\}", found[0])[0]
        text = text[: found.start()] + re.sub(r"^\{%-? if.*?%\}", "", first, flags=re.DOTALL) + text[found.end() :]
    text = re.sub(r"\{%.*?%\}", "\n\n", text, flags=re.DOTALL)
    text = re.sub(r"\{\{.*?\}\}", "X", text, flags=re.DOTALL)
    text = re.sub(_BLOCK_TAGS, "\n\n", text)
    return re.split(r"\n\s*\n", re.sub(r"<[^>]+>|&\w+;", " ", text))


def main(names: list[str]) -> None:
    """Print what the pages' sentences are like."""
    every: list[int] = []
    for path in [Path(name).resolve() for name in names] or pages():
        said = sentences(path)
        lengths = [words(one) for one in said]
        every += lengths
        found = phrases(path)
        sizes = f"{mean(lengths):5.1f} {max(lengths, default=0):4d} {len(found):4d} phrases {len(said):4d} sentences"
        print(f"{sizes}  {path.relative_to(ROOT)}")
        if names:
            print(*sorted((f"{words(one):4d} {one}" for one in said), reverse=True)[:10], *found, sep="\n")
    print(f"{mean(every):5.1f} {max(every):4d} in all")


if __name__ == "__main__":
    main(sys.argv[1:])
