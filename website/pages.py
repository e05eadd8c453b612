"""Gathers the pages of the documentation in `build/docs/pages`, for the site that `make docs` builds.

The Markdown files stay where they are and are written for readers of the repository. Here the README becomes the first
page, links between files become links between pages, and a file of the repository that a page links to becomes a page.
"""

import argparse
import re
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from posixpath import normpath, relpath

ROOT = Path(__file__).resolve().parents[1]
TARGET = ROOT / "build" / "docs" / "pages"
RENAMED = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "clients/python/README.md": "clients/python.md",
    "clients/typescript/README.md": "clients/typescript.md",
    "docs/decisions/README.md": "decisions/index.md",
}
"""Pages that are called differently on the site, by their paths in the repository."""

LINK = re.compile(r"(\]\()([^)\s]+)(\))")
NAMED = re.compile(r"\[[\w./-]+\.md\](?=\(([^)\s#]+))")
"""A link that is called as the file it leads to."""
FENCE = re.compile(r"^\s*(```|~~~)")
LANGUAGES = {".py": "python", ".yml": "yaml", ".json": "json", ".sh": "bash", ".toml": "toml", ".ts": "typescript"}


class BrokenLinkError(ValueError):
    """A page links to a file or folder that cannot be shown."""


def sources() -> dict[str, str]:
    """Every Markdown page: its path in the repository, and on the site."""
    pages = [path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "docs").rglob("*.md"))]
    return {path: path.removeprefix("docs/") for path in pages} | RENAMED


def on_site(path: str) -> str:
    """Where a file of the repository, a page or not, is on the site."""
    known = sources().get(path)
    if known is not None:
        return known
    return path.removeprefix("docs/") if path.startswith("docs/") else f"repository/{path}.md"


def rewritten(text: str, path: str, linked: set[str]) -> str:
    """A page with its links leading to pages of the site.

    :param text: the Markdown.
    :param path: the page's path in the repository.
    :param linked: takes up the paths of the files that the page links to.
    :raises BrokenLinkError: if a link leads to no file.
    """
    here = PurePosixPath(path).parent.as_posix()
    start = PurePosixPath(on_site(path)).parent.as_posix()

    def lead(match: re.Match[str]) -> str:
        name, mark, anchor = match[2].partition("#")
        if not name or "://" in match[2] or name.startswith("mailto:"):
            return match[0]
        target = normpath(f"{here}/{name}")
        if target.startswith("..") or not (ROOT / target).is_file():
            raise BrokenLinkError(f"{path}: the link {match[2]} leads to no file of the repository")
        linked.add(target)
        return f"{match[1]}{relpath(on_site(target), start)}{mark}{anchor}{match[3]}"

    def title(match: re.Match[str]) -> str:
        target = ROOT / here / match[1]
        heading = re.search(r"^# (.+)$", target.read_text(encoding="utf-8"), re.MULTILINE) if target.is_file() else None
        return f"[{heading[1]}]" if heading else match[0]

    lines = []
    fenced = numbered = False
    for line in text.splitlines():
        fenced ^= bool(FENCE.match(line))
        numbered = bool(re.match(r"\d+\. ", line)) or (numbered and (not line or line.startswith("   ")))
        # Python-Markdown takes what belongs to an item of a list only if it is indented by four spaces.
        indented = f" {line}" if numbered and line.startswith("   ") else line
        lines.append(indented if fenced else LINK.sub(lead, NAMED.sub(title, indented)))
    return "\n".join(lines) + "\n"


def as_page(path: str) -> str:
    """A file of the repository as a page that shows its text."""
    text = (ROOT / path).read_text(encoding="utf-8")
    fence = "`" * max([4, *(len(run) + 1 for run in re.findall(r"`+", text))])
    return f"# {path}\n\n{fence}{LANGUAGES.get(Path(path).suffix, 'text')}\n{text.rstrip()}\n{fence}\n"


def gather(target: Path = TARGET) -> list[str]:
    """Writes every page and every file that a page shows.

    :param target: the folder, which is emptied before.
    :return: the paths of the pages on the site, without those that show a file of the repository.
    :raises BrokenLinkError: if a link leads to no file.
    """
    shutil.rmtree(target, ignore_errors=True)
    linked: set[str] = set()
    pages = sources()
    for path, page in pages.items():
        write(target / page, rewritten((ROOT / path).read_text(encoding="utf-8"), path, linked))
    for path in sorted(linked - set(pages)):
        if path.startswith("docs/"):
            (target / on_site(path)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / path, target / on_site(path))
        else:
            write(target / on_site(path), as_page(path))
    return sorted(pages.values())


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def listed(entries: Iterable[object]) -> list[str]:
    """The pages that a `nav` of the site's configuration names, in its order."""
    found = []
    for entry in entries:
        if isinstance(entry, str):
            found.append(entry)
        elif isinstance(entry, dict):
            for value in entry.values():
                found += listed(value if isinstance(value, list) else [value])
    return found


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    try:
        print(f"gathered {len(gather())} pages")
    except BrokenLinkError as error:
        sys.exit(f"make docs: {error}")


if __name__ == "__main__":
    main()
