"""A run as one HTML page that works from disk: nothing is fetched, nothing from result files is executed."""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import json
import re
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

#: Draws for `page.js`: plotly.js 4.1.1, the bundle "basic", as npm has it (MIT; its notice is its first lines).
LIBRARY = "plotly-basic.min.js"


def page(title: str, data: Mapping[str, Any]) -> str:
    """The page that shows ``data`` (`web.data.page_data`).

    All that comes from files is compressed and spelt in base64, and `page.js` writes it as text, never as HTML; the
    browser runs the two scripts whose hashes the page's policy names, and fetches nothing.
    """
    library, script, style, frame = map(_text, (LIBRARY, "page.js", "page.css", "page.html"))
    packed = gzip.compress(json.dumps(data, allow_nan=False, separators=(",", ":")).encode(), 6, mtime=0)
    hashes = " ".join(f"'sha256-{_digest(one)}'" for one in (library, script))
    parts = {
        "title": html.escape(title),
        "policy": f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:",
        "style": style,
        "data": base64.b64encode(packed).decode(),
        "library": library,
        "script": script,
    }
    return re.sub(r"\[\[(\w+)\]\]", lambda place: parts[place[1]], frame)


def _text(name: str) -> str:
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def _digest(script: str) -> str:
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
