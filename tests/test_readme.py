"""Every Python snippet of the README and of the pages of docs/ runs as printed; their tables are those of the results."""

import json
import re
import runpy
from pathlib import Path

import pytest
from test_howtos import PAGES as TESTED_THERE

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def snippets_of(text):
    return re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


SNIPPETS = snippets_of(TEXT)
PAGES = {
    page.relative_to(ROOT / "docs").as_posix(): page.read_text(encoding="utf-8")
    for page in sorted((ROOT / "docs").rglob("*.md"))
}


@pytest.mark.parametrize("snippet", SNIPPETS, ids=[snippet.splitlines()[-1] for snippet in SNIPPETS])
def test_a_snippet_runs_and_prints(snippet, capsys):
    exec(compile(snippet, "README.md", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out


OWN = {name: [snippet for snippet in snippets_of(text) if snippet not in SNIPPETS] for name, text in PAGES.items()}
"""Those of each page that the README does not have too."""
ELSEWHERE = {f"how-to/{page}" for page in (*TESTED_THERE, "challenge.md")}
"""Of the challenge: tests/studies/challenge/test_entry.py flies them."""


@pytest.mark.parametrize("name", [name for name, snippets in OWN.items() if snippets and name not in ELSEWHERE])
def test_the_snippets_of_a_page_run_one_after_another(name, capsys):
    namespace = {"__name__": "__main__"}
    for snippet in OWN[name]:
        exec(compile(snippet, name, "exec"), namespace)
    assert capsys.readouterr().out


def test_every_link_and_picture_of_readme_and_pages_is_there():
    for name, text in {"../README.md": TEXT, **PAGES}.items():
        for target in re.findall(r"\]\(([^)#]+)\)", text):
            generated = target.endswith(("reference/cli.md", "reference/scenario.md"))
            assert "://" in target or generated or ((ROOT / "docs" / name).parent / target).exists(), (name, target)


def test_the_page_of_claims_is_that_of_the_published_report():
    summary = json.loads((ROOT / "docs" / "report" / "summary.json").read_text(encoding="utf-8"))
    publish = runpy.run_path(str(ROOT / "docs" / "publish.py"))
    page = PAGES[publish["LONG"]["report"]]
    assert page.split("<!-- report: begin -->\n")[1].split("<!-- report: end -->\n")[0] == publish["claims_block"](
        summary
    )


def test_the_table_of_claims_is_that_of_the_published_report():
    summary = json.loads((ROOT / "docs" / "report" / "summary.json").read_text(encoding="utf-8"))
    assert not summary["quick"] and summary["schema"] == "flipdiagram/report/1"
    block = TEXT.split("<!-- report: begin -->\n")[1].split("<!-- report: end -->\n")[0]
    publish = runpy.run_path(str(ROOT / "docs" / "publish.py"))
    assert block == publish["readme_block"](summary)


def test_the_published_report_tells_the_same_as_its_summary():
    """Every claim's row, and no picture that is missing."""
    folder = ROOT / "docs" / "report"
    summary, page = (
        json.loads((folder / "summary.json").read_text()),
        (folder / "report.md").read_text(encoding="utf-8"),
    )
    for entry in summary["claims"]:
        assert f"| {entry['id']} |" in page
    for name in re.findall(r"!\[[^]]*\]\(([^)]+)\)", page):
        assert (folder / name).is_file(), name


def test_the_table_of_speed_is_that_of_the_published_benchmark():
    page = (ROOT / "docs" / "bench.md").read_text(encoding="utf-8")
    block = TEXT.split("<!-- bench: begin -->\n")[1].split("<!-- bench: end -->\n")[0]
    publish = runpy.run_path(str(ROOT / "docs" / "publish.py"))
    assert block == publish["targets"](page)
    assert all(block.count(f"| {row} |") == 1 for row in publish["FIRST_ROWS"]), "a row that the benchmark has no more"
