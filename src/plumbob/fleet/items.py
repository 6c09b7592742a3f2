"""What a batch works on: files, folders, patterns, URLs and recordings in memory, each under a name of its own."""

import glob
import hashlib
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final
from urllib.parse import quote

from plumbob.core.errors import ParameterError
from plumbob.core.files import existing_file, file_sha256, profile_paths
from plumbob.core.text import first_words
from plumbob.data import ImuData
from plumbob.data.recording import Recording, unsaved
from plumbob.files.columns import to_columns
from plumbob.files.formats import FORMATS, is_recording
from plumbob.files.header import dump, file_header
from plumbob.fleet.urls import fetched, filesystem, is_url, reaching

Source = str | os.PathLike[str] | Recording | ImuData
Note = Callable[[str], object]

JOBS: Final = "_jobs"  # folder of a dataset by which it is known
_LONGEST: Final = 180
_DEEPEST: Final = 32
_BESIDE: Final = (".toml", ".json", ".md")  # suffixes of what lies beside recordings: profiles, cards, words
# Suffixes of recordings alone: whatever is in such a file, it counts as one, be it damaged.
_OF_RECORDINGS: Final = frozenset(suffix for kind in FORMATS for suffix in kind.suffixes) - {"", ".bin"}


@dataclass(frozen=True, eq=False)
class Item:
    """One recording of a batch."""

    # what the dataset calls it: of a file its path in the folder, or behind the pattern's fixed part, that was given
    name: str
    source: str | Recording  # its path or URL, or the recording itself

    @property
    def where(self) -> str:
        """Its path or URL; none of a recording in memory."""
        return self.source if isinstance(self.source, str) else ""

    @property
    def key(self) -> str:
        """Name of its file and folder in a dataset: quoted as in a URL, and cut where it is long."""
        key = quote(self.name, safe=" ()+,")
        if len(key) <= _LONGEST:
            return key
        return f"{key[: _LONGEST - 17].rstrip('%')}~{hashlib.sha256(self.name.encode()).hexdigest()[:16]}"

    @contextmanager
    def local(self, most: int) -> Iterator[Path | Recording]:
        """The recording, or its file on this machine; errors as of `plumbob.fleet.urls.fetched`."""
        if isinstance(self.source, Recording):
            yield self.source
        elif is_url(self.source):
            with fetched(self.source, most) as path:
                yield path
        else:
            yield Path(self.source)


def input_digest(given: Path | Recording) -> str:
    """SHA-256 of a file, of a file and those that are read with it, of a folder's, or of a recording's columns."""
    if isinstance(given, Recording):
        columns = to_columns(given)
        digest = hashlib.sha256(dump(file_header(given, list(columns))))
        for name, values in sorted(columns.items()):
            digest.update(name.encode())
            digest.update(values.tobytes())
        return digest.hexdigest()
    if given.is_dir():
        home, files = given, sorted(path for path in given.rglob("*") if path.is_file())
    else:
        home, files = given.parent, [existing_file(given), *_read_with(given)]
    if files == [given]:
        return file_sha256(given)[0]
    combined = hashlib.sha256()
    for path in files:
        combined.update(f"{path.relative_to(home).as_posix()}\0{file_sha256(path)[0]}".encode())
    return combined.hexdigest()


def _read_with(file: Path) -> list[Path]:
    """Files that are read with a file: the profile of a table, EuRoC's sensor.yaml, further parts of a stream."""
    if profiles := profile_paths(file):
        return [path for path in (*profiles, file.with_name("sensor.yaml")) if path.is_file()]
    if file.suffix != ".mcap":
        return []
    from plumbob.files.mcap.layout import existing_parts

    return [path for path in existing_parts(file) if path != file]


def batch_items(sources: Source | Iterable[Source], note: Note) -> Iterator[Item]:
    """Each recording of what was given, under a name of its own; a note says what is left out."""
    if isinstance(sources, str | os.PathLike | Recording | ImuData):
        sources = [sources]
    origins: dict[str, str] = {}
    for number, source in enumerate(sources, 1):
        for item in _items(source, number, note):
            if item.key in origins:
                raise ParameterError(
                    f"two recordings are called {item.name}: {origins[item.key] or 'one in memory'} and "
                    f"{item.where or 'another one'}. Name a folder above both, or name recordings in memory "
                    "differently."
                )
            origins[item.key] = item.where
            yield item


def _items(source: Source, number: int, note: Note) -> Iterator[Item]:
    if isinstance(source, ImuData):
        source = unsaved(source, f"samples-{number:06d}")
    if isinstance(source, Recording):
        yield Item(source.name or f"recording-{number:06d}", source)
        return
    text = os.fspath(source)
    if is_url(text):
        yield from _behind_url(text)
        return
    path = Path(text)
    if not path.exists() and glob.has_magic(text):
        yield from _of_pattern(text, note)
    elif not path.exists():
        raise ParameterError(f"{text} does not exist. Check the path; a pattern has *, ? or [.")
    elif path.is_dir() and not is_recording(path):
        yield from _of_folder(path, path, note)
    else:
        yield Item(path.name, text)


def _is_read_with_first(file: Path) -> bool:
    if file.suffix != ".mcap":
        return False
    from plumbob.files.mcap.layout import is_further_part

    return is_further_part(file)


def _of_pattern(text: str, note: Note) -> Iterator[Item]:
    base = Path(*_fixed(Path(text).parts))
    paths = sorted(glob.glob(text, recursive=True))  # noqa: PTH207 - a pattern with folders, absolute or not
    if not paths:
        raise ParameterError(f"nothing matches {text}. Check the pattern; ** stands for folders in folders.")
    for name in paths:
        path = Path(name)
        if path.is_dir() and not is_recording(path):
            if "**" not in text:  # there its files match, too
                yield from _of_folder(path, base, note)
        elif not _is_read_with_first(path):
            yield Item(path.relative_to(base).as_posix(), name)


def _fixed(parts: tuple[str, ...]) -> Iterator[str]:
    """Folders before the first part with a wildcard."""
    for part in parts[:-1]:
        if glob.has_magic(part):
            return
        yield part


def _of_folder(folder: Path, base: Path, note: Note, depth: int = 0) -> Iterator[Item]:
    """Recordings in a folder and those in it, in the order of their names."""
    if (folder / JOBS).is_dir():
        note(f"{folder} is a dataset of a batch; it is left out")
        return
    skipped: list[str] = []
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or _is_read_with_first(path):
            continue
        if is_recording(path) or (path.suffix.lower() in _OF_RECORDINGS and not path.is_dir()):
            yield Item(path.relative_to(base).as_posix(), str(path))
        elif path.is_dir() and not path.is_symlink() and depth < _DEEPEST:
            yield from _of_folder(path, base, note, depth + 1)
        elif path.suffix.lower() not in _BESIDE:
            skipped.append(path.name)
    if skipped:
        note(f"{folder}: left out, no recordings by their suffix or content: {first_words(skipped, 5)}")


def _behind_url(url: str) -> Iterator[Item]:
    """What a URL names, matches, or holds."""
    system, path = filesystem(url)
    scheme, magic = url.partition("://")[0], glob.has_magic(path)
    with reaching(url):
        system.invalidate_cache()  # it may have listed the folder for an earlier batch
        if not magic and system.isfile(path):
            yield Item(PurePosixPath(path).name, url)
            return
        paths = sorted(map(str, system.glob(path) if magic else system.find(path)))
        taken = [ref for ref in paths if system.isfile(ref) and (magic or is_recording(Path(PurePosixPath(ref).name)))]
    if not taken:
        raise ParameterError(f"no recording is at {url}. Check the URL.")
    base = "/".join(_fixed(tuple(path.split("/")))) if magic else path.rstrip("/")
    for ref in taken:
        yield Item(ref[len(base) :].lstrip("/"), f"{scheme}://{ref.lstrip('/') if scheme != 'file' else ref}")
