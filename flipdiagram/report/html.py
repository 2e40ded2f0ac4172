"""Markdown to one HTML file that needs no other: pictures inside, no script, no network."""

import html
import re
from base64 import b64encode
from pathlib import Path

from flipdiagram.report.contents import anchor

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 75rem; margin: 2rem auto; padding: 0 1.5rem; }
h1 { font-size: 1.7rem; } h2 { margin-top: 2.5rem; border-bottom: 1px solid #ccc; } h3 { margin-top: 1.8rem; }
table { border-collapse: collapse; margin: 1rem 0; font-size: 13px; display: block; overflow-x: auto; }
th, td { border: 1px solid #ccc; padding: 0.25rem 0.5rem; vertical-align: top; text-align: left; }
th { background: #f2f2f2; } code { background: #f4f4f4; padding: 0 0.2em; font-size: 0.92em; }
img { max-width: 100%; height: auto; } td strong { color: #B30000; }
blockquote { background: #FFF4D6; border-left: 4px solid #E69F00; margin: 1rem 0; padding: 0.4rem 1rem; }
"""


def self_contained(markdown: str, folder: Path) -> str:
    """The page as HTML; pictures are read from `folder` and written into it as data."""
    from markdown_it import MarkdownIt

    title = next((line.removeprefix("# ") for line in markdown.splitlines() if line.startswith("# ")), "report")
    body = MarkdownIt("commonmark", {"html": False}).enable("table").render(markdown)
    body = re.sub(r"<h2>(.*?)</h2>", lambda h: f'<h2 id="{anchor(html.unescape(h[1]))}">{h[1]}</h2>', body)
    data = 'src="data:image/png;base64,{}"'
    body = re.sub(
        r'src="([^"]+\.png)"', lambda source: data.format(b64encode((folder / source[1]).read_bytes()).decode()), body
    )
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head><meta charset="utf-8"><title>{html.escape(title)}</title>\n'
        f'<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head>\n'
        f"<body>\n{body}</body>\n</html>\n"
    )
