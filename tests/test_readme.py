"""Every Python snippet of the README runs as printed."""

import json
import re
import runpy
from pathlib import Path

import pytest

TEXT = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
SNIPPETS = re.findall(r"^```python\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("snippet", SNIPPETS, ids=[snippet.splitlines()[-1] for snippet in SNIPPETS])
def test_a_snippet_runs_and_prints(snippet, capsys):
    exec(compile(snippet, "README.md", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out


def test_every_picture_of_the_readme_is_there():
    for name in re.findall(r"!\[[^]]*\]\(([^)]+)\)", TEXT):
        assert (Path(__file__).parents[1] / name).is_file()


def test_the_table_of_claims_is_that_of_the_published_report():
    summary = json.loads((Path(__file__).parents[1] / "docs" / "report" / "summary.json").read_text(encoding="utf-8"))
    assert not summary["quick"] and summary["schema"] == "flipdiagram/report/1"
    block = TEXT.split("<!-- report: begin -->\n")[1].split("<!-- report: end -->\n")[0]
    publish = runpy.run_path(str(Path(__file__).parents[1] / "docs" / "publish.py"))
    assert block == publish["readme_block"](summary)


def test_the_published_report_tells_the_same_as_its_summary():
    """Every claim's row, and no picture that is missing."""
    folder = Path(__file__).parents[1] / "docs" / "report"
    summary, page = (
        json.loads((folder / "summary.json").read_text()),
        (folder / "report.md").read_text(encoding="utf-8"),
    )
    for entry in summary["claims"]:
        assert f"| {entry['id']} |" in page
    for name in re.findall(r"!\[[^]]*\]\(([^)]+)\)", page):
        assert (folder / name).is_file(), name


def test_the_table_of_speed_is_that_of_the_published_benchmark():
    page = (Path(__file__).parents[1] / "docs" / "bench.md").read_text(encoding="utf-8")
    block = TEXT.split("<!-- bench: begin -->\n")[1].split("<!-- bench: end -->\n")[0]
    table = page.split("## Targets\n\n")[1].split("\n\n")[0]
    assert block.strip() == table and table.count("\n") > 30
