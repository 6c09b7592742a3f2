"""What other packages add: filters, files and frames of bytes, by `register` or by entry points.

Entry points are looked for where no other name will do, and each is imported when it is asked for.
"""

import re
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Generic, Literal, TypeVar

from plumbob.core.errors import ParameterError, one_line

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")
_Loader = tuple[str, Callable[[], Any]]  # whose it is, and what loads it
_NAME: Final = re.compile(r"[a-z0-9][a-z0-9_-]*")
_NAMES_HAVE: Final = "have a-z, 0-9, _ and - only"

_HOMES: Final = {"filter": "filters.known", "file": "files.formats", "format": "protocols.format_toml"}
"""Modules with the table of each kind, ``EXTENSIBLE``, which are imported at their first use, as the front door's."""


class ExtensibleTable(Generic[T]):
    """Names of one kind, and what `make` makes of what is given for them: Plumbob's, and those of other packages."""

    def __init__(
        self, kind: str, title: str, builtin: Callable[[], Mapping[str, Any]], make: Callable[[str, Any], T]
    ) -> None:
        self._kind, self._title, self._builtin, self._make = kind, title, builtin, make
        self._registered: dict[str, _Loader] = {}
        self._made: dict[str, T] = {}

    @cached_property
    def _entries(self) -> dict[str, _Loader]:
        """What entry points load; a note says of those that no name can mean why. A name of two packages is refused."""
        from importlib.metadata import entry_points

        loaders, entries = dict[str, _Loader](), entry_points()
        for group in (g for g in sorted(entries.groups) if g.startswith("plumbob.") and g[8:-1] not in _HOMES):
            whose = ", ".join(sorted({_whose(entry) for entry in entries.select(group=group)}))
            groups = ", ".join(f"plumbob.{kind}s" for kind in _HOMES)
            note(f"nothing is made of the entry points '{group}' {whose}; the groups that are known are {groups}.")
        for entry in sorted(entries.select(group=f"plumbob.{self._kind}s"), key=_whose):
            whose, called = _whose(entry), f"the {self._title} '{entry.name}' {_whose(entry)}"
            if not _NAME.fullmatch(entry.name):
                note(f"{called} is not used: names {_NAMES_HAVE}.")
            elif entry.name in self._builtin():
                note(f"{called} is not used, but Plumbob's own: the name is taken.")
            elif entry.name in loaders:
                loaders[entry.name] = (f"{loaders[entry.name][0]} and {whose}", _refuse_twice)
            else:
                loaders[entry.name] = (whose, entry.load)
        return loaders

    def added(self) -> tuple[str, ...]:
        """Names that other packages add; none of them is imported for it."""
        return tuple(sorted({*self._registered, *self._entries}))

    def add(self, name: str, what: Any) -> None:
        """Add a name that is not taken, or what a name that was registered now means."""
        if not _NAME.fullmatch(name):
            raise ParameterError(f"name must {_NAMES_HAVE}, but it is '{name}'; choose another one.")
        if name in self._builtin() or name in self._entries:
            raise ParameterError(f"the {self._title} '{name}' exists already; choose another name.")
        self._made.pop(name, None)
        self._registered[name] = ("that was registered", lambda: what)

    def whose(self, name: str) -> str:
        """Package of a name, as in ``of plumbob-lean 1.0``; empty where it is Plumbob's own."""
        return "" if name in self._builtin() else (self._registered.get(name) or self._entries[name])[0]

    def unusable(self, name: str, error: BaseException, what: str = "cannot be used") -> ParameterError:
        """Error that names the package whose code raised another, and the place there."""
        at = [frame for frame in traceback.extract_tb(error.__traceback__) if not frame.filename.startswith("<")]
        why = one_line(error).rstrip(".: ")
        if not isinstance(error, ParameterError):
            why = f"{type(error).__name__}: {why}, {Path(at[-1].filename).name}:{at[-1].lineno}" if at else why
        return ParameterError(f"the {self._title} '{name}' {self.whose(name)} {what} ({why}).")

    def find(self, name: str) -> T | None:
        """What a name means; None where nobody has it. What another package has and cannot be used is refused."""
        if name in self._made:
            return self._made[name]
        if name in (builtin := self._builtin()):
            self._made[name] = self._make(name, builtin[name])
        elif loader := self._registered.get(name) or self._entries.get(name):
            try:
                self._made[name] = self._make(name, loader[1]())
            except (Exception, SystemExit) as error:  # other packages raise what they like
                raise self.unusable(name, error) from error
        return self._made.get(name)

    def usable(self, names: Iterable[str]) -> Iterator[tuple[str, T]]:
        """Names with what they mean; a note says of each that cannot be used why."""
        for name in names:
            try:
                meaning = self.find(name)
            except ParameterError as error:
                meaning = None
                note(str(error))
            if meaning is not None:
                yield name, meaning


def register(kind: Literal["filter", "file", "format"], name: str, what: Any) -> None:
    """Add a filter, a format of files, or a format of bytes, for as long as this Python runs.

    A package adds one for every Python and for the command line by an entry point; docs/extend.md shows how.

    Parameters
    ----------
    kind : {"filter", "file", "format"}
        What it is.
    name : str
        Its name; of files, their suffix without its dot.
    what : module, str, Path or Format
        Of a filter or of files the module, or where it is imported from. Of bytes the format, its TOML as text, or the
        path of that.

    Raises
    ------
    ParameterError
        If there is no such kind, or the name is taken: by Plumbob or by an entry point. What was registered before
        under the name goes.
    """
    if kind not in _HOMES:
        raise ParameterError(f"kind must be one of {', '.join(_HOMES)}, but it is {kind!r}.")
    import_module(f"plumbob.{_HOMES[kind]}").EXTENSIBLE.add(name, what)


def _whose(entry: "EntryPoint") -> str:
    return f"of {entry.dist.name} {entry.dist.version}" if entry.dist else f"of {entry.value}"


def _refuse_twice() -> None:
    raise ParameterError("both have this name; uninstall one of them")


@cache
def note(text: str) -> None:
    """Say something, once."""
    import logging

    logging.getLogger("plumbob").warning("note: %s", text)
