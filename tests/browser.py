"""Opens a replay in a headless Chromium, and asks a script what it shows."""

import json
import re
import shutil
import subprocess

from conftest import ALTERNATIVES
from patience import HUNG

BASE = (
    "--headless --no-sandbox --disable-gpu --enable-unsafe-swiftshader --disable-quic --no-first-run --disable-sync"
    " --disable-background-networking --disable-component-update --disable-extensions --window-size=640,360"
).split()


def browse(folder, page, *options, at=""):
    path = folder / "replay.html"
    path.write_text(page, encoding="utf-8")
    chromium = next(filter(None, map(shutil.which, ALTERNATIVES["chromium"])))
    command = [chromium, *BASE, *options, f"--user-data-dir={folder / 'profile'}", f"{path.as_uri()}{at}"]
    return subprocess.run(command, capture_output=True, timeout=HUNG, text=True)


def probe(folder, page, script, *options, at):
    """What a script that is written into the page leaves in it."""
    trouble = "<head><script>window.trouble = []; onerror = text => trouble.push(String(text));</script>"
    probed = page.replace("<head>", trouble, 1).replace("</body>", script + "</body>")
    done = browse(folder, probed, *options, "--dump-dom", at=at)
    found = re.search(r'<pre id="probe">(.*?)</pre>', done.stdout)
    assert found, done.stderr[-2000:]
    shown = json.loads(found.group(1))
    assert shown["errors"] == []
    return shown
