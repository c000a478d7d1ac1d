"""Builds the site into docs/_build/html: `python docs/make_site.py` (`make docs`; needs the extras `docs` and `render`).

Pages by hand, pages out of the code and of docs/results, pictures and notebooks are gathered in docs/_build/source. Sphinx
builds them, its warnings are errors, notebooks are run; then each link is followed. Nothing is fetched, unless `--online`.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path

from site_pages import algorithms, api, environments, leaderboard, links, markup, staging
from sphinx.cmd.build import build_main

DOCS = Path(__file__).resolve().parent
TUTORIALS = (
    "quickstart",
    "first_bug",
    "own_world",
    "own_reward",
    "train_and_compare",
    "ros_map",
    "robot_teams",
    "dataset_to_policy",
    "colab",
)
"""The notebooks in the order of reading."""


def gather(source: Path, *, pictures: bool) -> None:
    """Write all pages into a folder.

    Args:
        source: the folder; what is there goes.
        pictures: whether to drive policies and draw them.
    """
    shutil.rmtree(source, ignore_errors=True)
    staging.stage(source)
    policies: Mapping[str, str] = {}
    scenarios: environments.Captions = {}
    if pictures:
        from site_pages.pictures import draw_policies, draw_scenarios  # loads pygame

        policies, scenarios = draw_policies(source / "algorithms"), draw_scenarios(source / "environments")
    made = {
        **algorithms.pages(policies),
        **environments.pages(scenarios),
        **api.pages(),
        **leaderboard.pages(),
        "tutorials/index.md": tutorials(),
        "guide/index.md": guide(source),
    }
    for place, text in made.items():
        (source / place).parent.mkdir(parents=True, exist_ok=True)
        (source / place).write_text(text, encoding="utf-8")
    if "GITHUB_REPOSITORY" in os.environ:  # as workflows have it: else nobody here knows where the project lies
        add_badges(source / "index.md", os.environ["GITHUB_REPOSITORY"])
    with (source / "results" / "README.md").open("a", encoding="utf-8") as page:
        page.write("\n" + markup.toctree(sorted(path.stem for path in (DOCS / "results").glob("*.json"))) + "\n")


def quiet_kernels(folder: Path) -> Path:
    """IPython's settings for notebooks: each kernel warns that it speaks to us without encryption, on one machine."""
    settings = folder / "profile_default" / "ipython_kernel_config.py"
    settings.parent.mkdir(parents=True, exist_ok=True)
    settings.write_text("get_config().Application.log_level = 40  # errors\n", encoding="utf-8")
    return folder


def add_badges(page: Path, repository: str) -> None:
    """Put the buttons under the title of a page."""
    title, _, rest = page.read_text(encoding="utf-8").partition("\n\n")
    page.write_text(f"{title}\n\n{staging.badges(repository)}\n\n{rest}", encoding="utf-8")


def tutorials() -> str:
    """The page that lists the notebooks."""
    return markup.paragraphs(
        "# Tutorials",
        "Notebooks, run from top to bottom when this site was built; each takes seconds.",
        markup.toctree(TUTORIALS, hidden=False),
    )


def guide(source: Path) -> str:
    """The page that lists the guide."""
    pages = ["environments", "scenarios", "policies", "hd_bug", "training", "datasets", "evaluation"]
    others = sorted({path.stem for path in (source / "guide").glob("*.md")} - {*pages, "index"})
    return markup.paragraphs(
        "# Guide",
        "How to use it, subject by subject; the examples are run by the tests.",
        markup.toctree([*pages, *others, "../examples/README"], hidden=False),
    )


def build(out: Path, *, notebooks: bool, pictures: bool, online: bool) -> int:
    """Build the site.

    Args:
        out: the folder for sources, pages and the list of links to elsewhere.
        notebooks: whether to run them.
        pictures: whether to draw policies and scenarios.
        online: whether to fetch others' inventories, and ask their links.

    Returns:
        0 if all is well; else what Sphinx says, or 1 for links that lead nowhere.
    """
    shutil.rmtree(out / "html", ignore_errors=True)  # pages of a removed policy would stay
    gather(out / "source", pictures=pictures)
    os.environ["BUG_GYM_DOCS_NOTEBOOKS"] = "force" if notebooks else "off"
    os.environ["IPYTHONDIR"] = str(quiet_kernels(out / "ipython"))
    if online:
        os.environ["BUG_GYM_DOCS_ONLINE"] = "1"
    options = ["-W", "--keep-going", "-q", "-E", "-c", str(DOCS), "-d", str(out / "doctrees")]
    failed = build_main(["-b", "html", *options, str(out / "source"), str(out / "html")])
    if failed:
        return failed
    broken, elsewhere = links.check(out / "html")
    (out / "links-to-elsewhere.txt").write_text("".join(f"{link}\n" for link in elsewhere), encoding="utf-8")
    if broken:
        sys.stderr.write("".join(f"leads nowhere: {line}\n" for line in broken))
        return 1
    pages = len(list((out / "html").rglob("*.html")))
    sys.stdout.write(f"{pages} pages in {out / 'html'}, {len(elsewhere)} links to elsewhere\n")
    return build_main(["-b", "linkcheck", *options, str(out / "source"), str(out / "linkcheck")]) if online else 0


def main(arguments: list[str]) -> int:
    """Run the script."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=DOCS / "_build", help="folder (default: docs/_build)")
    parser.add_argument("--no-notebooks", action="store_true", help="do not run them")
    parser.add_argument("--no-pictures", action="store_true", help="draw none")
    parser.add_argument("--online", action="store_true", help="fetch others' inventories, and ask their links")
    options = parser.parse_args(arguments)
    return build(
        options.out.resolve(),
        notebooks=not options.no_notebooks,
        pictures=not options.no_pictures,
        online=options.online,
    )


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
