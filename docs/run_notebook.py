"""Runs the cells of docs/notebook.ipynb and keeps what they show: `python docs/run_notebook.py docs/notebook.ipynb`.

The notebook is written to the file that is named. Cells tagged `notebook-extra` need Jupyter itself, and show nothing.
"""

import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from IPython.core.interactiveshell import InteractiveShell
from traitlets.config import Config

NOTEBOOK = Path(__file__).with_name("notebook.ipynb")
EXTRA = "notebook-extra"


def run(cells: list[dict[str, Any]]) -> None:
    """Run cells of code, in the current folder, and keep what each shows in it."""
    shell = InteractiveShell(config=Config({"HistoryManager": {"enabled": False}}))
    shell.enable_gui = lambda _: None  # `%matplotlib inline` asks for it
    for number, cell in enumerate(cells, start=1):
        if EXTRA in cell["metadata"].get("tags", []):
            continue
        done = shell.run_cell("".join(cell["source"]))
        done.raise_error()
        shown, _ = shell.display_formatter.format(done.result) if done.result is not None else ({}, {})
        if "text/html" in shown:
            del shown["text/plain"]  # which would say the same at length
        data = {kind: text.splitlines(keepends=True) for kind, text in shown.items()}
        output = {"output_type": "execute_result", "execution_count": number, "metadata": {}, "data": data}
        cell |= {"execution_count": number, "outputs": [output] if data else []}


def main(target: Path) -> None:
    """Run the notebook in a folder of its own, and write it to a file."""
    notebook = json.loads(NOTEBOOK.read_text())
    with tempfile.TemporaryDirectory() as folder:
        here = Path.cwd()
        os.chdir(folder)
        try:
            run([cell for cell in notebook["cells"] if cell["cell_type"] == "code"])
        finally:
            os.chdir(here)
    target.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
