"""Tables of texts: on a terminal and as Markdown, with every character as it was."""

import io
from xml.etree import ElementTree

import pytest
from markdown_it import MarkdownIt
from rich.console import Console

from flipdiagram.grid import Grid, verdict


def printed(grid):
    stream = io.StringIO()
    Console(file=stream, width=200).print(grid.rich())
    return stream.getvalue()


def test_markdown_has_a_line_a_row_and_aligns_what_is_named():
    grid = Grid(["name", "size"], [["a", "1"], ["b", "2"]], right=["size"])
    assert grid.markdown() == "| name | size |\n| --- | ---: |\n| a | 1 |\n| b | 2 |\n"


@pytest.mark.parametrize("text", ["|φ| < 1", "two\nlines", "<b>&amp;", "[red]not a colour[/red]", "1 * 2 * 3"])
def test_every_text_reaches_the_reader_whole(text):
    grid = Grid(["x", "y"], [[text, "z"]])
    html = MarkdownIt("commonmark", {"html": False}).enable("table").render(grid.markdown())
    assert html.count("<td>") == 2  # the text broke no row and no cell
    shown = text.replace("\n", " ").replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    if "&amp;" not in text:  # a character reference is one character in Markdown
        assert shown in html
    for line in text.split("\n"):
        assert line in printed(grid)


def test_a_terminal_shows_no_marks_of_markdown():
    text = printed(Grid(["a"], [["`pd`"], ["**no**"], ["yes"]], title="[1] of"))
    assert "`" not in text and "*" not in text
    assert "pd" in text and "no" in text and "[1] of" in text


def test_an_open_verdict_is_neither_yes_nor_no():
    assert [verdict(holds) for holds in (True, False, None)] == ["yes", "no", "not judged"]


def test_a_unit_in_a_heading_is_no_markup():
    from io import StringIO

    from rich.console import Console

    out = StringIO()
    Console(file=out, width=60).print(Grid(["solve time\n[ms]", "way [cm]"], [["1.2", "3"]]).rich())
    assert "[ms]" in out.getvalue() and "[cm]" in out.getvalue()


def test_a_notebook_shows_the_same_texts_escaped_with_verdicts_in_colour():
    html = Grid(["a", "n"], [["<i>", "1"], ["`no`", "2"]], title="a < b", right=["n"]).html()
    root = ElementTree.fromstring(html)
    assert [cell.text for cell in root.iter("td")] == ["a", "n", "<i>", "1", "no", "2"]
    assert root.find("b").text == "a < b"
    styles = [cell.get("style") for cell in root.iter("td")]
    assert "right" in styles[3] and "color" in styles[4] and "color" not in styles[5]
