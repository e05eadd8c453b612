"""Takes the pictures of the console in `docs/images` from the demo's data: `make screenshots`.

Needs what `make test` needs, node's packages (`npm ci`) and Chromium.
"""

import argparse
import os
import re
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
COLOURS = 200
"""Of a picture: enough that small marks keep their colours, with half of the bytes."""


def shrink(path: Path) -> None:
    """Writes a picture again with few colours."""
    with Image.open(path) as picture:
        few = picture.convert("RGB").quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    few.save(path, optimize=True)


def take(folder: Path, target: Path = IMAGES) -> list[Path]:
    """Runs the demo, takes the pictures, and stops its service.

    :param folder: for the demo's database.
    :param target: where the pictures go.
    :return: the pictures.
    """
    ran = subprocess.run(
        [sys.executable, "-m", "server", "demo", "--keep", "--out", str(folder)],
        cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    pid = int(re.search(r"stop it with: kill (\d+)", ran.stdout)[1])  # type: ignore[index]
    try:
        page = re.search(r"in a browser: (\S+)", ran.stdout)
        if page is None:
            sys.exit("make screenshots: the demo found no hard match to show")
        before = {path: path.stat().st_mtime_ns for path in target.glob("console-*.png")}
        script = str(ROOT / "website" / "screenshots.mjs")
        if subprocess.run(["node", script, str(target), page[1]], cwd=ROOT, check=False).returncode:
            sys.exit("make screenshots: the pictures could not be taken")
    finally:
        os.kill(pid, signal.SIGTERM)
    taken = [path for path in target.glob("console-*.png") if before.get(path) != path.stat().st_mtime_ns]
    for path in taken:
        shrink(path)
    return sorted(taken)


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    with tempfile.TemporaryDirectory(prefix="screenshots-", dir="/tmp") as folder:
        for path in take(Path(folder)):
            print(f"{path.relative_to(ROOT)}: {path.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
