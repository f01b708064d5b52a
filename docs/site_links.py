"""Checks of a built site: links must lead somewhere, and nothing may be loaded from elsewhere."""

from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADED = {("img", "src"), ("script", "src"), ("link", "href"), ("source", "src"), ("video", "src")}


class Page(HTMLParser):
    """The identifiers and links of a page.

    Attributes:
        ids: of its elements.
        links: (tag, address) of everything that it leads to or loads.
    """

    def __init__(self, text):
        super().__init__()
        self.ids, self.links = set(), []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        """Keep an element's identifier and address."""
        found = dict(attrs)
        self.ids |= {found[name] for name in ("id", "name") if found.get(name)}
        is_hint = tag == "link" and found.get("rel") in ("canonical", "alternate")
        for name in ("href", "src"):
            if found.get(name) and not is_hint:
                self.links.append((tag, name, found[name]))


def faults(site):
    """Return the faults in the links of a site, one line each; ``site`` is its folder."""
    pages = {
        path.resolve(): Page(path.read_text(encoding="utf-8")) for path in site.rglob("*.html")
    }
    found = set()
    for path, page in pages.items():
        if path.name == "404.html" or "report" in path.parts:
            continue
        for tag, name, address in page.links:
            where = f"{path.relative_to(site)}: {address}"
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                if (tag, name) in LOADED and parts.scheme != "data":
                    found.add(f"{where}: is loaded from elsewhere")
                continue
            target = path.parent / unquote(parts.path) if parts.path else path
            target = Path(target, "index.html") if target.is_dir() else target
            if not target.is_file():
                found.add(f"{where}: leads nowhere")
                continue
            there = pages.get(target.resolve())
            if there and parts.fragment and unquote(parts.fragment) not in there.ids:
                found.add(f"{where}: no such heading")
    return sorted(found)
