"""Run the notebooks of ``docs/notebooks`` and store their outputs and thumbnails.

    python docs/making/notebooks.py [NAME ...]

Pictures are stored as small as they are shown. What differs between two runs of the same code is left out.
"""

from __future__ import annotations

import argparse
import base64
import io
import os
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode
from PIL import Image

FOLDER = Path(__file__).resolve().parents[1] / "notebooks"
THUMBNAIL = 480
"""Width [pixels]."""


def executed(notebook: NotebookNode) -> NotebookNode:
    """A notebook after a run from the beginning, in the folder of all.

    Raises
    ------
    CellExecutionError
        If a cell raises.
    """
    resources = {"metadata": {"path": str(FOLDER)}}
    return NotebookClient(notebook, timeout=600, kernel_name="python3", resources=resources).execute()


def stored(notebook: NotebookNode) -> NotebookNode:
    """The notebook without times and messages, its pictures with a palette."""
    notebook.metadata.pop("widgets", None)
    for cell in notebook.cells:
        cell.metadata = NotebookNode()
        kept = []
        for output in cell.get("outputs", []):
            if output.output_type == "stream" and output.name == "stderr":
                continue
            if "image/png" in output.get("data", {}):
                output.data["image/png"] = base64.b64encode(packed(output.data["image/png"])).decode()
            kept.append(output)
        if cell.cell_type == "code":
            cell.outputs = kept
    return notebook


def packed(png: str) -> bytes:
    """A picture with 256 colours."""
    buffer = io.BytesIO()
    with Image.open(io.BytesIO(base64.b64decode(png))) as picture:
        picture.convert("RGB").quantize(256, dither=Image.Dither.NONE).save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def pictures(notebook: NotebookNode) -> list[str]:
    """The pictures of all cells, as base64."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return [output.data["image/png"] for output in outputs if "image/png" in output.get("data", {})]


def write_thumbnail(notebook: NotebookNode, path: Path) -> None:
    """The last picture of a notebook, small."""
    with Image.open(io.BytesIO(base64.b64decode(pictures(notebook)[-1]))) as picture:
        small = picture.convert("RGB")
        small.thumbnail((THUMBNAIL, THUMBNAIL))
        small.quantize(64, dither=Image.Dither.NONE).save(path, "PNG", optimize=True)


def main() -> None:
    """Run the notebooks that are named, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="without .ipynb; all by default")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    names = parser.parse_args().names or sorted(path.stem for path in FOLDER.glob("*.ipynb"))
    for name in names:
        began = time.monotonic()
        notebook = stored(executed(nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)))
        nbformat.write(notebook, FOLDER / f"{name}.ipynb")
        write_thumbnail(notebook, FOLDER / f"{name}.png")
        print(f"{name}: {time.monotonic() - began:.0f} s")  # noqa: T201


if __name__ == "__main__":
    main()
