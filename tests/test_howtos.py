"""The how-to pages about Drake and Gymnasium run as printed: the snippets of a page one after another, each prints."""

import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "docs" / "how-to"
PAGES = ("embed.md", "gymnasium.md", "linearise.md")


@pytest.mark.parametrize("page", PAGES)
def test_the_snippets_of_a_page_run_and_print(page, capsys):
    snippets = re.findall(r"^```python\n(.*?)^```", (FOLDER / page).read_text(encoding="utf-8"), re.DOTALL | re.M)
    names = {"__name__": "__main__"}
    for snippet in snippets:
        exec(compile(snippet, page, "exec"), names)
        assert capsys.readouterr().out, snippet
    assert snippets
