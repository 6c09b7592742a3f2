"""Pages of the site that stand nowhere in docs/: those of the repository, and the reference of the public names."""

import inspect
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import plumbob

ROOT = Path(__file__).parents[1]
PAGES = {
    "index.md": "README.md",
    "changelog.md": "CHANGELOG.md",
    "contributing.md": "CONTRIBUTING.md",
    "security.md": "SECURITY.md",
}
LOADED = re.compile(r"""<(?:script|link|img|iframe|source)\b[^>]*\b(?:src|href)=["']?(?:https?:)?//[^>]*>""")
UNSEARCHED = "---\nsearch: {exclude: true}\n---\n"
TO_PAGE = {"examples": "examples.md", **{name: page for page, name in PAGES.items()}}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made here."""
    for page, name in PAGES.items():
        text = as_page((ROOT / name).read_text(encoding="utf-8"))
        files.append(File.generated(config, page, content=UNSEARCHED + text if page == "changelog.md" else text))
    files.append(File.generated(config, "examples.md", content=examples()))
    files.append(File.generated(config, "reference.md", content=reference()))
    return files


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Refuse a page that would load something from a network."""
    if found := LOADED.search(output):
        raise PluginError(f"{page.file.src_uri} loads from a network: {found[0]}")
    return output


def as_page(text: str) -> str:
    """Text of the repository's root with its links as they are in docs/; one to what is not a page becomes its text."""
    text = text.replace("](docs/", "](")
    text = re.sub(r"\[([^]]+)\]\(CITATION.cff\)", r"\1 (CITATION.cff)", text)
    return re.sub(r"\]\(([\w]+(?:\.md)?)\)", lambda link: f"]({TO_PAGE.get(link[1], link[1])})", text)


def examples() -> str:
    """One page of all numbered scripts."""
    parts = [
        "# Examples",
        "The scripts of `examples/`, smallest first. Each says what it prints, which the tests check.",
    ]
    for path in sorted((ROOT / "examples").glob("*.py")):
        parts.append(f"## {path.stem.replace('_', ' ')}\n\n```python\n{path.read_text(encoding='utf-8')}```")
    return "\n\n".join(parts) + "\n"


def reference() -> str:
    """One page of all public names, by kind; where each is defined is known to the running package alone."""
    kinds: dict[str, list[str]] = {"Functions": [], "Types": [], "Errors": [], "Modules": []}
    for name in plumbob.__all__:
        if name == "__version__":
            continue
        public = getattr(plumbob, name)
        kinds[_kind(public)].append(
            public.__name__ if inspect.ismodule(public) else f"{public.__module__}.{public.__qualname__}"
        )
    parts = ["# Reference", "What `import plumbob` gives. The words are those of the [conventions](conventions.md)."]
    for title, places in kinds.items():
        parts += [f"## {title}", *(f"::: {place}" for place in places)] if places else []
    return "\n\n".join(parts) + "\n"


def _kind(public: object) -> str:
    if inspect.isclass(public):
        return "Errors" if issubclass(public, Exception) else "Types"
    return "Modules" if inspect.ismodule(public) else "Functions"
