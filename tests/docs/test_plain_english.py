"""The documents are in plain English: short sentences, and no phrase that a reader has to guess at."""

import pytest

from tests.docs.plain_english import LONGEST, MEAN, ROOT, main, mean, pages, phrases, sentences, words

PAGES = pages()
MARKDOWN = """# A heading that does not count however long it is

At the end you have `one` [link](https://example.org/a-long-target). Two numbers: 0.71 and 3
of 4.

| a table | does not count |
|---|---|

- An item of a list, which counts.
- Another one that has
  two lines.

```sh
code --that does not count
```
"""
TEMPLATE = """<p>Of {% if days %}seven {{ days }} days{% else %}one day only, which is not read{% endif %} here.
<b>Bold</b> stays in the sentence.</p><td>cell</td>
"""


@pytest.mark.parametrize(
    ("name", "text", "lengths"), [("a.md", MARKDOWN, [7, 7, 7, 6]), ("a.j2", TEMPLATE, [5, 5])], ids=["md", "template"]
)
def test_sentences_are_counted_as_a_person_counts_them(tmp_path, name, text, lengths):
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert [words(one) for one in sentences(tmp_path / name)] == lengths


def test_sentences_are_short_on_average():
    assert len(PAGES) > 25
    assert mean([words(one) for path in PAGES for one in sentences(path)]) <= MEAN


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_page_has_no_long_sentence_and_no_riddle(path):
    assert [one for one in sentences(path) if words(one) > LONGEST] == []
    assert phrases(path) == []


def test_a_riddle_is_found(tmp_path):
    (tmp_path / "a.md").write_text("It is told that the fit came to rest.", encoding="utf-8")
    assert len(phrases(tmp_path / "a.md")) == 2


def test_the_script_prints_a_line_for_each_page(capsys):
    main([])
    assert len(capsys.readouterr().out.splitlines()) == len(PAGES) + 1
