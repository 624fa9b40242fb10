"""The tutorial runs from the first cell to the last, and shows what it says."""

import asyncio

import pytest

from places import COMPARISONS

NOTEBOOK = COMPARISONS / "tutorial.ipynb"


@pytest.fixture(scope="module")
def executed():
    client = pytest.importorskip("nbclient", reason="needs nbclient")
    pytest.importorskip("ipykernel", reason="needs ipykernel")
    pytest.importorskip("joblib", reason="needs qpavoid[study]")
    import nbformat

    book = nbformat.read(NOTEBOOK, as_version=4)
    runner = client.NotebookClient(book, timeout=300, kernel_name="python3")
    with asyncio.Runner() as loop:
        loop.run(runner.async_execute())
    return book


def printed(cell):
    return "".join(
        output.get("text", "") or output["data"].get("text/plain", "")
        for output in cell.outputs
    )


def test_the_tutorial_runs(executed):
    code = [cell for cell in executed.cells if cell.cell_type == "code"]
    text = "\n".join(map(printed, code))
    assert "Status" in printed(code[0]) or "status" in printed(code[0])
    assert "qp-ahead  arrived" in text and "contacts 0" in text


def test_it_shows_the_replay_inline(executed):
    pages = [
        output["data"]["text/html"]
        for cell in executed.cells
        for output in cell.get("outputs", ())
        if "text/html" in output.get("data", {})
    ]
    assert len(pages) == 1 and "<iframe" in pages[0] and "srcdoc" in pages[0]


def test_it_is_stored_without_outputs():
    import json

    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    assert not any(cell.get("outputs") for cell in cells)
