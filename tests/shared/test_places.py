"""Folders for results: refused before the work where they could not be written to after it."""

import os
import subprocess
import sys

import pytest

from shared.children import environment
from shared.errors import RecordingError
from shared.places import check_folder


def inside(folder):
    return sorted(str(one.relative_to(folder)) for one in folder.rglob("*"))


@pytest.mark.parametrize("name", ["there", "new", "new/one/deep", "new/../other", "missing/../../other"])
def test_a_folder_that_can_be_made_is_left_to_be_made(tmp_path, name):
    (tmp_path / "base" / "there").mkdir(parents=True)
    before = inside(tmp_path)
    check_folder(tmp_path / "base" / name, RecordingError)
    assert inside(tmp_path) == before


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("file", "file: nothing can be written there, because .*file is a file; expected a folder"),
        ("file/below/it", "it: nothing can be written there, because .*file is a file"),
        ("link", "link leads nowhere; expected a folder"),
        ("n" * 300, r"nothing can be written there \(File name too long\); expected a folder"),
        ("/proc/zeroshot", r"nothing can be written there \(No such file or directory\)"),
    ],
)
def test_what_is_in_the_way_is_said(tmp_path, name, said):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "link").symlink_to(tmp_path / "gone")
    with pytest.raises(RecordingError, match=said):
        check_folder(tmp_path / name, RecordingError)
    assert inside(tmp_path) == ["file", "link"]
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_of_somebody_else_is_refused(tmp_path):
    (tmp_path / "locked").mkdir(mode=0o500)
    with pytest.raises(RecordingError, match="Permission denied"):
        check_folder(tmp_path / "locked" / "out", RecordingError)


@pytest.mark.skipif(os.name == "nt", reason="no such home there")
def test_without_a_home_matplotlib_is_given_a_place_and_says_nothing(tmp_path):
    code = (
        "from shared.places import give_matplotlib_a_place; give_matplotlib_a_place()\n"
        "import matplotlib.font_manager; print(matplotlib.get_cachedir())"
    )
    env = {name: one for name, one in environment().items() if not name.startswith(("XDG_", "MPL"))}
    env |= {"HOME": "/proc/nohome", "TMPDIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], env=env, capture_output=True, text=True)
    assert done.stdout == f"{tmp_path}/zeroshot-fmu-{os.getuid()}/matplotlib\n"
    assert "Building the font cache" in done.stderr or not done.stderr
