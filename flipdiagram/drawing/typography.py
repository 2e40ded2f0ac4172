"""Names of boxes and signals as they are set in a drawing: x_cmd as x with a subscript, qdd_ref as q̈ with one."""

from collections.abc import Sequence
from html import escape

_SYMBOLS = {"tau": "τ", "theta": "θ", "omega": "ω", "phi": "φ", "qd": "q̇", "qdd": "q̈"}
_WIDE = 12
"""Characters of a box's name beyond which it takes a second line."""
_WIDEST = 16
"""Characters of the names on one line of an arrow."""


def signal_html(name: str) -> str:
    """A signal for Graphviz's HTML-like labels."""
    symbol, index = _parts(name)
    if symbol == name and len(name) > 1:
        return escape(name)
    html = f"<I>{escape(symbol)}</I>"
    return f'{html}<SUB><FONT POINT-SIZE="9">{escape(index)}</FONT></SUB>' if index else html


def box_lines(name: str) -> list[str]:
    """The words of a box's name, on two lines of like length where one would be wide."""
    words = name.replace("_", " ").split(" ")
    whole = " ".join(words)
    if len(whole) <= _WIDE or len(words) == 1:
        return [whole]
    cuts = [(" ".join(words[:i]), " ".join(words[i:])) for i in range(1, len(words))]
    return list(min(cuts, key=lambda cut: max(map(len, cut))))


def signal_rows(signals: Sequence[str]) -> list[list[str]]:
    """The names of signals on as many lines as they need."""
    rows: list[list[str]] = [[]]
    for name in signals:
        if rows[-1] and sum(map(len, rows[-1])) + len(name) > _WIDEST:
            rows.append([])
        rows[-1].append(name)
    return rows


def size_of(signals: Sequence[str]) -> tuple[float, float]:
    """Width and height of the names of signals, about [pt]."""
    rows = signal_rows(signals)
    return max(map(_width, rows)), 14.0 * len(rows)


def _width(row: list[str]) -> float:
    stems, indices = zip(*(_parts(name) for name in row), strict=True)
    return 6.5 * sum(map(len, stems)) + 4.8 * sum(map(len, indices)) + 7.0 * (len(row) - 1) + 4.0


def _parts(name: str) -> tuple[str, str]:
    """The symbol and its index; a word has none."""
    stem, _, index = name.partition("_")
    symbol = _SYMBOLS.get(stem, stem)
    return (symbol, index) if stem in _SYMBOLS or len(stem) == 1 else (name, "")
