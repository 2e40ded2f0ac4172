"""The contents of a page: links to its sections."""

import re


def with_contents(text: str) -> str:
    """A page of Markdown with links to its sections before the first of them."""
    titles = re.findall(r"^## (.+)$", text, re.MULTILINE)
    links = "\n".join(f"* [{title}](#{anchor(title)})" for title in titles)
    return text.replace("\n## ", f"\n{links}\n\n## ", 1) if titles else text


def anchor(title: str) -> str:
    """What GitHub and Python-Markdown call a section of this title."""
    return re.sub(r"[^\w\- ]", "", title.lower()).strip().replace(" ", "-")
