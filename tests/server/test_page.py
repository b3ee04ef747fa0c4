"""The page's own files: sent from memory, compressed, and not at all to a browser that has them."""

from __future__ import annotations

import gzip
import os
import re
from pathlib import Path

from server import assets
from tests.server.living import Live


def test_the_page_names_every_module_that_its_modules_import(live: Live):
    """So a browser asks for all of them at once."""
    page = live.http.get("/").text
    named = set(re.findall(r'rel="modulepreload" href="(/static/[^"]+)"', page))
    assert "/static/main.js" in named
    for path in sorted(named):
        text = live.http.get(path).text
        for found in re.findall(r'(?:from|import)\s*\(?\s*"(\.[^"]+)"', text):
            imported = os.path.normpath(f"{Path(path).parent}/{found}")
            assert imported in named, f"{path} imports {imported}"


def test_what_is_drawn_first_is_asked_for_first_and_styles_are_in_the_page(live: Live):
    page = live.http.get("/").text
    named = re.findall(r'rel="modulepreload" href="/static/([^"]+)"', page)
    assert named.index("library/missions.js") < named.index("wire/api.js") < named.index("stage.js")
    assert all(named.index(path) < named.index("stage.js") for path in assets._imported("main.js"))
    assert 'rel="stylesheet"' not in page
    for style in (assets.static_directory() / "style").glob("*.css"):
        assert style.read_text(encoding="utf-8") in page, style


def test_a_file_comes_compressed_and_only_once(live: Live):
    first = live.http.get("/static/main.js", headers={"accept-encoding": "gzip"})
    assert first.headers["content-encoding"] == "gzip" and "mountRooms" in first.text
    tag = first.headers["etag"]
    again = live.http.get("/static/main.js", headers={"accept-encoding": "gzip", "if-none-match": tag})
    assert again.status_code == 304 and again.content == b"" and again.headers["etag"] == tag
    plain = live.http.get("/static/main.js", headers={"accept-encoding": "identity", "if-none-match": tag})
    assert plain.status_code == 200 and "content-encoding" not in plain.headers and plain.text == first.text


def test_a_file_that_changed_is_sent_as_it_is_now(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(assets, "static_directory", lambda: tmp_path)
    (tmp_path / "a.js").write_text("1")
    before = assets.static_file("a.js")
    (tmp_path / "a.js").write_text("2;" * 500)
    os.utime(tmp_path / "a.js", ns=(1, 1))
    after = assets.static_file("a.js")
    assert before is not None and before.plain == b"1" and before.gzipped is None
    assert after is not None and after.tag != before.tag
    assert after.gzipped is not None and gzip.decompress(after.gzipped) == after.plain == b"2;" * 500
    (tmp_path / "a.txt").write_text("1")
    (tmp_path / "link.js").symlink_to("/etc/hostname")
    assert assets.static_file("a.txt") is None and assets.static_file("link.js") is None
    assert assets.static_file("../a.js") is None and assets.static_file("a.js\0.png") is None
