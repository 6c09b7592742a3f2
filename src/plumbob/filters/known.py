"""Which filters there are, what each takes and claims, and the publications behind them."""

import re
import unicodedata
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any, Final, Protocol, cast

from plumbob.core.errors import ParameterError, unknown_name
from plumbob.core.extensions import ExtensibleTable
from plumbob.core.kernels import Kernel
from plumbob.core.resources import docs_folder
from plumbob.data import TRIADS

BUILT_IN: Final = (
    "complementary", "ekf7", "ekf_quaternion", "fuzzy_pi", "integrate", "integrate_first_order", "madgwick", "mahony",
    "mekf", "tilt_compass", "vqf",
)  # fmt: skip
"""Filters of attitudes that take sample by sample, of which C is made when Plumbob is built."""
RATE_FILTERS = ("scalar", "two_state", "moving_average")
"""Filters of one rate channel, which give no attitude: `plumbob.filters.channel`."""

ARRAY_FILTERS: Final = ("teaching_arm",)  # that take all units of an array: the whole scheme of that paper
ARRAY_SCHEMES: Final = (*ARRAY_FILTERS, "monitor")  # what makes one of several units on one body, as they come
_OF_UNITS: Final = (*ARRAY_SCHEMES, "chain")  # what takes several units, and is no filter of one
SMOOTHER = "smoother"  # what estimates where no filter is named: a whole recording, or a stream
CAUSAL_LAG = "0 s"
"""Its lag on a stream where none is given, and for what a live system would have known: nothing later is used."""


class FilterModule(Protocol):
    """What a filter's file must hold.

    It may hold more functions. ``covariance(q_nb, entries)`` gives the covariance of the attitude error in body axes,
    (N, 3, 3), rad², from the entries of the state that the slice ``COVARIANCE`` names. Of a filter that corrects
    nothing, ``sensitivity(q_nb, entries)``, from those of ``SENSITIVITY``, says in its place how that error answers to
    what a card leaves of the gyroscope's, (N, 3, 15). ``from_noise(card)`` gives parameters from a `NoiseCard`.
    """

    SUMMARY: str
    REFERENCES: tuple[str, ...]
    NEEDS: tuple[str, ...]
    STATE: int
    Params: Any
    step: Kernel[..., int]

    @staticmethod
    def coefficients(params: Any) -> tuple[float, ...]:
        """Own coefficients of the kernel."""


def _module(name: str, what: Any) -> FilterModule:
    """Module of a filter; that of another package must have what `FilterModule` says."""
    module: Any = import_module(what) if isinstance(what, str) else what
    parts = () if name in _TABLE else (*FilterModule.__annotations__, "coefficients")
    if lacking := [part for part in parts if not hasattr(module, part)]:
        raise ParameterError(f"it must have {', '.join(parts)}, but it lacks {', '.join(lacking)}")
    if parts and not (isinstance(module.NEEDS, tuple) and {*module.NEEDS} <= {*TRIADS}):
        raise ParameterError(f"NEEDS must be a tuple of {', '.join(TRIADS)}, but it is {module.NEEDS!r}")
    return cast("FilterModule", module)


_TABLE: Final = {name: f"plumbob.filters.{name}" for name in BUILT_IN} | {
    "scalar": "plumbob.filters.channel_scalar",
    "two_state": "plumbob.filters.channel_two_state",
    "moving_average": "plumbob.filters.channel_average",
    SMOOTHER: "plumbob.filters.smoother.model",
    "teaching_arm": "plumbob.arm.array.paper",
    "monitor": "plumbob.arm.array.monitoring",
    "chain": "plumbob.arm.estimation",
}
EXTENSIBLE: Final = ExtensibleTable[FilterModule]("filter", "filter", lambda: _TABLE, _module)
"""All filters; `plumbob.register` adds to them."""


def filter_names() -> tuple[str, ...]:
    """Names that `Filter` accepts: causal filters, sample by sample; those of other packages come last."""
    return (*BUILT_IN, *EXTENSIBLE.added())


def estimator_names() -> tuple[str, ...]:
    """Names that `plumbob.estimate` and the command line accept: the filters, and the smoother."""
    return (*filter_names(), SMOOTHER)


def load(name: str) -> FilterModule:
    """Module of a filter, or of the smoother, which has no step.

    Raises ParameterError if there is no filter of that name, or its package cannot be imported.
    """
    if isinstance(name, str) and name in RATE_FILTERS:
        raise ParameterError(
            f"'{name}' filters rates and gives no attitude: plumbob.filter_rates, or 'plumbob run --filter {name}', "
            "gives samples, which a filter of attitudes may then take."
        )
    module = EXTENSIBLE.find(name) if isinstance(name, str) and name not in _OF_UNITS else None
    if module is None:
        raise unknown_name("filter", name, estimator_names())
    return module


def takes_noise(name: str) -> bool:
    """Whether a filter takes parameters from a `NoiseCard`."""
    return hasattr(load(name), "from_noise")


_ACCENTS = {"`": "\u0300", "'": "\u0301", "^": "\u0302", '"': "\u0308"}
_SIGNS = (("--", "–"), (r"\alpha", "α"), (r"\&", "&"), (r"\_", "_"))


def cite(*names: str, bib: bool = False) -> str:
    """References of filters, to be cited beside their results.

    Parameters
    ----------
    *names : str
        Filters; all where none is named.
    bib : bool
        Return the BibTeX entries, each once, instead of a line for each reference below the filter's name.

    Raises
    ------
    ParameterError
        If there is no filter of a name.

    Examples
    --------
    >>> cite("mekf", bib=True).splitlines()[0]
    '@misc{Sola2017,'
    """
    modules = [(name, load(name)) for name in names] or EXTENSIBLE.usable(estimator_names())
    keys, entries = {name: module.REFERENCES for name, module in modules}, bibliography()
    if bib:
        every = dict.fromkeys(key for of in keys.values() for key in of)
        return "\n".join(entries.get(key, f"% {key}\n") for key in every)  # other packages may cite in plain words
    lines = {key: in_a_line(entry) for key, entry in entries.items()}
    return "".join("\n    ".join((name, *(lines.get(key, key) for key in of))) + "\n" for name, of in keys.items())


def bibliography() -> dict[str, str]:
    """BibTeX entries of docs/references.bib by their keys."""
    text = (docs_folder() / "references.bib").read_text(encoding="utf-8")
    return {key: entry for entry, key in re.findall(r"^(@\w+\{(\w+),$.*?^\}\n)", text, re.MULTILINE | re.DOTALL)}


def in_a_line(entry: str) -> str:
    """Entry as a line: key, authors, title, where and when it appeared."""
    key, raw = entry[entry.index("{") + 1 : entry.index(",")], dict(_fields(entry))
    fields, authors = {name: _plain(value) for name, value in raw.items()}, _authors(raw["author"])
    named = f"{authors}: {fields['title']}" if "title" in fields else authors
    return f"[{key}] {named}. {', '.join(filter(None, (_place(fields), fields.get('year'), _link(fields))))}"


def _fields(entry: str) -> Iterator[tuple[str, str]]:
    """Names and values of an entry; a value ends with the brace that its first one opened."""
    for field in re.finditer(r"(\w+)\s*=\s*\{", entry):
        depth, end = 1, field.end()
        while depth:
            depth += {"{": 1, "}": -1}.get(entry[end], 0)
            end += 1
        yield field[1], entry[field.end() : end - 1]


def _plain(text: str) -> str:
    """Value of a field without the marks of LaTeX."""
    text = re.sub(r"""\\([`'^"])\{?(\w)\}?""", lambda m: unicodedata.normalize("NFC", m[2] + _ACCENTS[m[1]]), text)
    for sign, written in _SIGNS:
        text = text.replace(sign, written)
    return " ".join(re.sub(r"[{}$]", "", text).split())


def _authors(text: str) -> str:
    """Family names; institutions, which stand in braces, as they are."""
    names = [_plain(person.partition(",")[0]) for person in re.split(r" and (?![^{]*\})", text)]
    return ", ".join(names).replace(", others", " et al.")


def _place(fields: Mapping[str, str]) -> str:
    """Journal, book or publisher, with volume, number and pages as far as there are any."""
    held = ("journal", "booktitle", "institution", "publisher", "howpublished")
    place = next((fields[name] for name in held if name in fields), "")
    number = f"({fields['number']})" if {"volume", "number"} <= fields.keys() else fields.get("number", "")
    numbers = f"{fields.get('volume', '')}{number}"
    return ", ".join(filter(None, (f"{place} {numbers}".strip(), fields.get("pages"))))


def _link(fields: Mapping[str, str]) -> str:
    """Where it is on the network."""
    if "doi" in fields:
        return f"doi:{fields['doi']}"
    return f"arXiv:{fields['eprint']}" if "eprint" in fields else fields.get("url", "")
