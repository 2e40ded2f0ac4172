"""Tables of texts: on a terminal and as Markdown, with every character as it was."""

import io
from xml.etree import ElementTree

import pytest
from markdown_it import MarkdownIt
from rich.console import Console

from flipdiagram.grid import Grid, labelled, verdict


def printed(grid, width=200):
    stream = io.StringIO()
    Console(file=stream, width=width).print(grid.rich())
    return stream.getvalue()


WIDE = Grid(
    ["who", "what became of it", *(f"number {k} [N m]" for k in range(9))],
    [[name, "struck the table at 0.229 s, dropped at 0.231 s", *["12345.67"] * 9] for name in ("pd", "pd+ff+dob")],
    "a title with a number at its end, which is too long for the terminal: 2.73 rad",
    [f"number {k} [N m]" for k in range(9)],
)


@pytest.mark.parametrize("width", [50, 80, 120])
def test_a_table_that_does_not_fit_is_parted_and_no_number_or_unit_is_broken(width):
    text = printed(WIDE, width)
    assert all(len(line) <= width for line in text.splitlines()) and "…" not in text
    assert text.count("12345.67") == 18 and text.count("[N m]") == 9
    assert "0.229 s" in text and "0.231 s" in text and "2.73 rad" in text
    assert text.count("┏") > 1 and text.count("pd+ff+dob") == text.count("┏"), "each part names its rows"


def test_a_table_that_fits_is_whole_and_no_wider_than_its_texts():
    assert printed(WIDE, 250).count("┏") == 1
    assert max(map(len, printed(Grid(["a"], [["b"]])).splitlines())) == 5


def test_both_keys_of_a_row_stand_in_each_part():
    grid = Grid(["case", "way", "x", "y"], [["one", "often", "1" * 30, "2" * 30]], right=["x", "y"], keys=2)
    text = printed(grid, 60)
    assert text.count("┏") == text.count("often") == text.count("one") == 2


def test_a_path_longer_than_the_terminal_is_folded_not_cut():
    text = printed(Grid(["", "file"], [["name", "/long" * 40]]), 60)
    assert "".join(text.replace("│", " ").split()).count("long") == 40


def test_the_name_of_a_number_says_its_unit():
    assert labelled("release_time_s", 0.4) == ("release time", "0.4 s")
    assert labelled("touchdown_speed_m_s", 1.0294) == ("touchdown speed", "1.029 m/s")
    assert labelled("cost_J", 0.7073) == ("cost J", "0.7073") and labelled("iterations", 47) == ("iterations", "47")
    assert WIDE.records()[0]["number 0 [N m]"] == "12345.67"


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
