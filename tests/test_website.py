"""The pages of `make docs`: their sources are whole, and, where the extra is installed, so is what they become."""

import importlib.util
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).parents[1]
CONFIGURATION: dict[str, Any] = tomllib.loads((ROOT / "zensical.toml").read_text())["project"]


def load_pages() -> Any:
    """`website/pages.py`, which is a script and no package."""
    spec = importlib.util.spec_from_file_location("website_pages", ROOT / "website" / "pages.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


pages = load_pages()


def test_the_navigation_lists_every_page_once(tmp_path: Path) -> None:
    listed = pages.listed(CONFIGURATION["nav"])
    assert sorted(listed) == pages.gather(tmp_path)
    assert len(set(listed)) == len(listed)


def test_no_link_or_picture_of_a_gathered_page_is_broken(tmp_path: Path) -> None:
    pages.gather(tmp_path)
    found = 0
    for page in tmp_path.rglob("*.md"):
        if "repository" in page.relative_to(tmp_path).parts:
            continue
        for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
            name = link.partition("#")[0]
            if name and "://" not in link and not name.startswith("mailto:"):
                found += 1
                assert (page.parent / name).is_file(), f"{page.relative_to(tmp_path)}: {link}"
    assert found > 100


def test_a_link_to_a_file_of_the_repository_shows_that_file(tmp_path: Path) -> None:
    pages.gather(tmp_path)
    shown = (tmp_path / "repository/examples/robot_loop.py.md").read_text()
    assert (ROOT / "examples/robot_loop.py").read_text().strip() in shown
    assert "](repository/examples/robot_loop.py.md)" in (tmp_path / "guides.md").read_text()


@pytest.mark.parametrize("link", ["nowhere.md", "../../elsewhere.md", "architecture"])
def test_a_broken_link_is_refused_with_its_page(link: str) -> None:
    with pytest.raises(pages.BrokenLinkError, match=re.escape(f"docs/guides.md: the link {link}")):
        pages.rewritten(f"See [this]({link}).", "docs/guides.md", set())


def test_a_link_called_as_its_file_is_called_as_its_page() -> None:
    assert (
        pages.rewritten("See [maps.md](maps.md).", "docs/guides.md", set())
        == "See [Maps: many drives, one stem map](maps.md).\n"
    )


def test_what_stands_in_a_block_of_code_stays_as_it_is() -> None:
    text = "```text\n[a](nowhere.md)\n```\n"
    assert pages.rewritten(text, "docs/guides.md", set()) == text


def test_items_below_a_number_are_indented_so_that_they_belong_to_it() -> None:
    text = "9. first\n   goes on:\n\n   - below\n\nafter\n"
    assert pages.rewritten(text, "docs/guides.md", set()) == "9. first\n    goes on:\n\n    - below\n\nafter\n"


class Loaded(HTMLParser):
    """Collects what a page loads or links to."""

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        values = {name: value for name, value in attributes if value}
        if "src" in values:
            self.loads.append(values["src"])
        if "href" in values:
            (self.links if tag == "a" else self.loads).append(values["href"])


def local(links: list[str]) -> Iterator[str]:
    for link in links:
        name = unquote(link.partition("#")[0].partition("?")[0])
        if name and not re.match(r"[a-z]+:", name):
            yield name


@pytest.mark.skipif(
    importlib.util.find_spec("zensical") is None, reason="what makes the pages is not installed: run `make docs` first"
)
def test_the_site_loads_nothing_from_elsewhere_and_its_links_lead_somewhere(tmp_path: Path) -> None:
    pages.gather(tmp_path / "build/docs/pages")
    (tmp_path / "zensical.toml").write_text((ROOT / "zensical.toml").read_text())
    built = subprocess.run(
        [sys.executable, "-m", "zensical", "build", "--strict"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    site = tmp_path / "build/docs/site"
    for page in pages.listed(CONFIGURATION["nav"]):
        path = site / Path(page).with_suffix(".html")
        found = Loaded()
        found.feed(path.read_text(encoding="utf-8"))
        assert not [one for one in found.loads if re.match(r"(https?:)?//", one)], page
        for name in local(found.loads + found.links):
            assert (path.parent / name).exists(), f"{page}: {name}"
