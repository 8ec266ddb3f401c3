"""Build the site into ``build/site``, from what the repository holds: ``make site``. Nothing is executed or fetched.

The files keep their places, so that links between them hold; Sphinx reads a copy, to which figures' anchors, texts and
the pages of `templates` are added. All of it stands in ``build``; the site is replaced when it is whole.
"""

from __future__ import annotations

import argparse
import base64
import io
import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path
from types import ModuleType
from typing import Any
from urllib.parse import unquote, urlsplit

import jinja2
from joblib import Parallel, delayed
from PIL import Image
from tqdm import tqdm

import stereolib
from stereolib.base import ROOT, read_json, read_text, write_atomic
from stereolib.notebook.baked import INDEX, PAGES, bake, write_index
from stereolib.reproduction import code_sha256

DOCS = Path(__file__).resolve().parent
BUILD = ROOT / "build"
SITE, SOURCE, SLIDERS = BUILD / "site", BUILD / "site-source", BUILD / "site-sliders"
COPIED = ("*.md", "docs/*.md", "notebooks/**/*.md", "data/*.md", "figures/**/*.*", "LICENSE*", "*.yml", "*.cff")
LOOSE = ("figures", "environment.yml", "CITATION.cff", "LICENSE", "LICENSE-text")  # files that pages link to
THUMBNAIL_PX = 480
DRAWN = re.compile(r'\b(?:save|show)_figure\("(\w+)"')


@dataclass(frozen=True)
class Figure:
    """A figure in a notebook: its name, what there is to see, the notebook without suffix, and its PNG."""

    name: str
    alt: str
    notebook: str
    png: bytes


# --- what Sphinx reads


def lay_out() -> None:
    """Copy what the site shows to where Sphinx reads it, and add the pages that are made of other files."""
    shutil.rmtree(SOURCE, ignore_errors=True)
    for path in {path for pattern in COPIED for path in ROOT.glob(pattern)}:
        copy(path, SOURCE / path.relative_to(ROOT))
    figures = []
    for path in sorted((ROOT / "notebooks").rglob("*.ipynb")):
        name = path.relative_to(ROOT)
        notebook = read_json(path)
        figures += adapt(notebook, name.with_suffix("").as_posix())
        write(SOURCE / name, json.dumps(notebook))
    if missing := {path.stem for path in (ROOT / "figures").glob("*.png")} - {figure.name for figure in figures}:
        raise ValueError(f"no notebook draws these files of figures/: {', '.join(sorted(missing))}")
    for figure in figures:
        thumbnail(figure.png, SOURCE / "thumbnails" / f"{figure.name}.webp")
    names = dict.fromkeys(figure.notebook for figure in figures)
    chapters = [(name, [figure for figure in figures if figure.notebook == name]) for name in names]
    facts = {
        "chapters": chapters,
        "sliders": PAGES,
        "rooms": [name for name in stereolib.__all__ if isinstance(getattr(stereolib, name), ModuleType)],
        "repository": os.environ.get("GITHUB_REPOSITORY"),  # where the site is built to be published
    }
    templates = jinja2.Environment(loader=jinja2.FileSystemLoader(DOCS / "templates"), trim_blocks=True)
    for path in sorted((DOCS / "templates").glob("*.md.jinja")):
        write(SOURCE / path.stem, templates.get_template(path.name).render(facts))


def adapt(notebook: dict[str, Any], name: str) -> list[Figure]:
    """Give a notebook's figures their anchors and texts, and its sliders the way to those without Python."""
    alt_texts = tomllib.loads(read_text(ROOT / "stereolib" / "plotting" / "alt_texts.toml"))
    sliders = [
        f"[Sliders of this chapter that move on this site](../sliders/{page.file}), at a handful of positions."
        for page in PAGES
        if name == f"notebooks/{page.stem}"
    ]
    figures, cells = [], list[dict[str, Any]]()
    for cell in notebook["cells"]:
        source = "".join(cell["source"]) if cell["cell_type"] == "code" else ""
        if cell["metadata"].get("jupyter", {}).get("outputs_hidden"):
            cell["metadata"].setdefault("tags", []).append("hide-output")
        shown = [output.get("data", {}) for output in cell.get("outputs", [])]
        png = next((data["image/png"] for data in shown if "image/png" in data), None)
        if png and (drawn := DRAWN.search(source)):
            figures.append(Figure(drawn[1], alt_texts.get(drawn[1], ""), name, base64.b64decode("".join(png))))
            cell["metadata"]["mystnb"] = {"image": {"alt": figures[-1].alt}}
            cells.append(markdown(drawn[1], f'<a id="{drawn[1]}"></a>'))
        cells.append(cell)
        if "explore(" in source and sliders:
            cells.append(markdown("chapters-sliders", sliders.pop()))
    notebook["cells"] = cells
    return figures


def markdown(name: str, text: str) -> dict[str, Any]:
    """A cell of a notebook."""
    return {"id": name, "cell_type": "markdown", "metadata": {}, "source": text}


def thumbnail(png: bytes, path: Path) -> None:
    """Write a small copy of a picture."""
    with Image.open(io.BytesIO(png)) as picture:
        small = picture.convert("RGB")
    small.thumbnail((THUMBNAIL_PX, 10 * THUMBNAIL_PX))
    path.parent.mkdir(parents=True, exist_ok=True)
    small.save(path, quality=80)


def bake_sliders() -> None:
    """Bake the chapters' sliders, two pages at once, unless neither code nor recordings have changed since."""
    package = ROOT / "stereolib"
    rooms = [path.parent.name for path in package.glob("*/__init__.py")]
    stamp = code_sha256(rooms) + read_text(ROOT / "data" / "virtual" / "SHA256SUMS")
    if (SLIDERS / "stamp").exists() and read_text(SLIDERS / "stamp") == stamp:
        return
    print("baking sliders, a minute or two ...", flush=True)
    shutil.rmtree(SLIDERS, ignore_errors=True)
    jobs = Parallel(n_jobs=2, return_as="generator_unordered")(delayed(bake)(SLIDERS, [page]) for page in PAGES)
    for _ in tqdm(jobs, "baking sliders", len(PAGES), unit="page", leave=False, disable=None):
        pass
    write_index(SLIDERS)
    write(SLIDERS / "stamp", stamp)


# --- the site


def build() -> list[str]:
    """Build the site beside the old one, and put it in its place; return what is wrong with it."""
    new = BUILD / "site-new"
    shutil.rmtree(new, ignore_errors=True)
    strict = ["-W", "--keep-going", "-j", "2", *([] if sys.stdout.isatty() else ["-q"])]
    folders = ["-c", str(DOCS), "-d", str(BUILD / "site-doctrees"), str(SOURCE), str(new)]
    if subprocess.call([sys.executable, "-m", "sphinx", *strict, *folders], cwd=ROOT):
        return ["Sphinx has warned, see above"]
    shutil.rmtree(new / ".doctrees", ignore_errors=True)
    for name in LOOSE:
        copy(ROOT / name, new / name)
    report = new / "figures" / "report.html"  # its links lead to the notebooks, here to their pages
    write(report, re.sub(r'(href="\.\./notebooks/[^"#]+)\.ipynb', r"\1.html", read_text(report)))
    copy(SLIDERS, new / "sliders")
    (new / "sliders" / "stamp").unlink()
    if wrong := list(broken_links(new)):
        return wrong
    shutil.rmtree(SITE, ignore_errors=True)
    new.rename(SITE)
    return []


class Page(HTMLParser):
    """Where a page's links lead, what it loads, and the places that it has."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.links, self.loaded, self.places = set[str](), set[str](), set[str]()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Take note of a tag's addresses and of its name."""
        for name, value in attrs:
            if name in {"src", "poster", "data"} or (name == "href" and tag == "link"):
                self.loaded.add(value or "")
            elif name == "href":
                self.links.add(value or "")
            elif name in {"id", "name"}:
                self.places.add(value or "")


def broken_links(site: Path) -> Iterator[str]:
    """Yield each link that leads nowhere in the site, and each address that a page loads from elsewhere."""
    pages = {path: Page(read_text(path)) for path in sorted(site.rglob("*.html"))}
    for path, page in pages.items():
        for address in sorted(page.links | page.loaded):
            parts, where = urlsplit(address), path.relative_to(site).as_posix()
            if parts.scheme == "data" or (parts.scheme and address not in page.loaded):
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if parts.scheme or parts.netloc or parts.path.startswith("/"):
                yield f"{where}: {address} is not in the site"
            elif not target.is_relative_to(site.resolve()) or not target.is_file():
                yield f"{where}: {address} leads nowhere"
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].places:
                yield f"{where}: {address} has no such place"
    for path in sorted(site.rglob("*.css")):
        for address in re.findall(r"(?:url\(|@import)\s*['\"]?((?:https?:)?//[^'\")]+)", read_text(path)):
            yield f"{path.relative_to(site).as_posix()}: {address} is not in the site"


# --- files


def write(path: Path, text: str) -> None:
    """Write a file and the folders above it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomic(path, text)


def copy(source: Path, target: Path) -> None:
    """Copy a file or a folder, and make the folders above it."""
    if source.is_dir():
        shutil.copytree(source, target, dirs_exist_ok=True)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(source, target)


def main() -> int:
    """Build all of it; return the exit code."""
    parser = argparse.ArgumentParser(prog="make site", description=__doc__, epilog="example: make site")
    parser.parse_args()
    try:
        lay_out()
        bake_sliders()
        print("writing pages ...", flush=True)
        wrong = build()
    except (ValueError, OSError) as error:
        wrong = [str(error)]
    except KeyboardInterrupt:
        return 130
    if wrong:
        print(*wrong, "make site: the site was not replaced", sep="\n", file=sys.stderr)
        return 2
    print(f"{SITE}: {len(list(SITE.rglob('*.html')))} pages; open {SITE / INDEX}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
