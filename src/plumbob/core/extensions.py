"""What other packages add: filters, files and frames of bytes, by `register` or by entry points.

Entry points are looked for where no other name will do, and each is imported when it is asked for.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from importlib import import_module
from typing import Any, Final, Generic, Literal, TypeVar

from plumbob.core.errors import ParameterError

T = TypeVar("T")
_Loader = tuple[str, Callable[[], Any]]

_HOMES: Final = {"filter": "filters.known", "file": "files.formats", "format": "protocols.format_toml"}
"""Modules with the table of each kind, ``EXTENSIBLE``, which are imported at their first use, as the front door's."""


class ExtensibleTable(Generic[T]):
    """Names of one kind, and what `make` makes of what is given for them: Plumbob's, and those of other packages."""

    def __init__(self, kind: str, builtin: Callable[[], Mapping[str, Any]], make: Callable[[str, Any], T]) -> None:
        self._kind, self._builtin, self._make = kind, builtin, make
        self._registered: dict[str, _Loader] = {}
        self._made: dict[str, T] = {}

    @cached_property
    def _entries(self) -> dict[str, _Loader]:
        """What entry points load; those whose name is taken are left out, with a note."""
        from importlib.metadata import entry_points

        loaders: dict[str, _Loader] = {}
        for entry in entry_points(group=f"plumbob.{self._kind}s"):
            whose = f"of {entry.dist.name} {entry.dist.version}" if entry.dist else f"of {entry.value}"
            if entry.name in self._builtin() or entry.name in loaders:
                other = "Plumbob" if entry.name in self._builtin() else f"that {loaders[entry.name][0]}"
                _note(f"the {self._kind} '{entry.name}' {whose} is not used, but {other}: the name is taken.")
            else:
                loaders[entry.name] = (whose, entry.load)
        return loaders

    def added(self) -> tuple[str, ...]:
        """Names that other packages add; none of them is imported for it."""
        return tuple(sorted({*self._registered, *self._entries}))

    def add(self, name: str, what: Any) -> None:
        """Add a name that is not taken."""
        if not re.fullmatch(r"[a-z0-9][a-z0-9_-]*", name):
            raise ParameterError(f"name must have a-z, 0-9, _ and - only, but it is '{name}'; choose another one.")
        if name in self._builtin() or name in self.added():
            raise ParameterError(f"the {self._kind} '{name}' exists already; choose another name.")
        self._registered[name] = ("that was registered", lambda: what)

    def find(self, name: str) -> T | None:
        """What a name means; None where nobody has it. What another package has and cannot be used is refused."""
        if name in self._made:
            return self._made[name]
        if name in (builtin := self._builtin()):
            self._made[name] = self._make(name, builtin[name])
        elif loader := self._registered.get(name) or self._entries.get(name):
            whose, load = loader
            try:
                self._made[name] = self._make(name, load())
            except Exception as error:  # other packages raise what they like
                why = f"{type(error).__name__}: {error}".rstrip(".")
                raise ParameterError(f"the {self._kind} '{name}' {whose} cannot be used ({why}).") from error
        return self._made.get(name)

    def usable(self, names: Iterable[str]) -> Iterator[tuple[str, T]]:
        """Names with what they mean; a note says of each that cannot be used why."""
        for name in names:
            try:
                meaning = self.find(name)
            except ParameterError as error:
                meaning = None
                _note(str(error))
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
        If there is no such kind, or the name is taken.
    """
    if kind not in _HOMES:
        raise ParameterError(f"kind must be one of {', '.join(_HOMES)}, but it is {kind!r}.")
    import_module(f"plumbob.{_HOMES[kind]}").EXTENSIBLE.add(name, what)


def _note(text: str) -> None:
    import logging

    logging.getLogger("plumbob").warning("note: %s", text)
