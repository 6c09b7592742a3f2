"""One page about the noise of a unit: coefficients first, then what they were read from."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path

from plumbob.core.files import write_text
from plumbob.core.units import written
from plumbob.noise.datasheet import figure, table
from plumbob.noise.datasheet.numbers import Triad, rows, triads
from plumbob.noise.findings import Analysis
from plumbob.noise.terms import DEVIATION
from plumbob.report import LABELS, document, html_table
from plumbob.report import figure as framed

_ROWS = 60  # of a curve's table
FOLDED = """\
details { margin-top: 1rem; }
summary { cursor: pointer; font-weight: 600; }
"""
"""Style of tables that are folded away."""

_STYLE = f"""\
{LABELS}\
.scroll {{ margin-top: 1.25rem; }}
.scroll + .note {{ margin-top: 1.5rem; }}
thead th:first-child {{ text-align: left; }}
td.text {{ white-space: nowrap; }}
{FOLDED}"""
_DEFINITIONS = (
    "The Allan variance of a signal at the averaging time τ is half the mean square difference of its means over "
    "neighbouring stretches of length τ. Its terms: quantization 3 Q²/τ², white noise N²/τ, bias instability "
    "(2 ln 2/π) B², random walk K² τ/3, ramp R² τ²/2; on their lines, Q is read at τ = √3 s, N at 1 s, K at 3 s, R at "
    "√2 s, and B is the flat deviation divided by 0.664. ± is an interval of 68.3 %; &lt; is a limit that holds with "
    "95 % where a record does not show the term. The floor of the curve is the point whose interval ends lowest, which "
    "need not be the least value. Intervals of the deviation are those of χ² with the degrees of "
    "freedom (edf) of overlapping averages under the identified noise. The error of IEEE Std 952, "
    "1/√(2(N/n − 1)), is one for every noise and meant for disjoint averages."
)


def write_html(
    path: str | Path,
    analyses: Sequence[Analysis],
    *,
    title: str,
    facts: Mapping[str, str],
    sections: Iterable[str] = (),
    overwrite: bool = False,
) -> Path:
    """Write a self-contained page with tables and figures.

    Parameters
    ----------
    path : path_like
        File to write.
    analyses : sequence of Analysis
        Channels; names such as "gyr x" say which belong together.
    title : str
        Of the page.
    facts : mapping of str to str
        Provenance as name and value: device, recording, versions, date. Any text is safe.
    sections : iterable of str
        Further sections, as HTML, such as `fin_section` gives.
    overwrite : bool
        Whether a file that lies there may be replaced.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    ShapeError
        If there is no analysis, or two share a name.
    MissingExtraError
        If matplotlib is not installed.
    """
    return write_text(path, page(analyses, title=title, facts=facts, sections=sections), overwrite=overwrite)


def page(analyses: Sequence[Analysis], *, title: str, facts: Mapping[str, str], sections: Iterable[str] = ()) -> str:
    """Text of the page that `write_html` writes."""
    found = triads(analyses)
    body = ["<section><h2>Coefficients</h2>", *map(_coefficients, found), *map(_notes, found), "</section>"]
    body += [_triad(i, triad) for i, triad in enumerate(found)]
    return document(title, facts, [*body, *sections], footer=_DEFINITIONS, style=_STYLE)


def _coefficients(triad: Triad) -> str:
    """The answer: coefficients of all axes with units."""
    return html_table(f"{triad.title}: {table.facts(triad)}", ["", *triad.channels], table.triad_rows(triad))


def _notes(triad: Triad) -> str:
    items = "".join(f"<li>{escape(triad.title)}: {escape(remark)}</li>" for remark in table.remarks(triad))
    return f"<ul class='note'>{items}</ul>" if items else ""


def _triad(i: int, triad: Triad) -> str:
    parts = [f"<section><h2>{escape(triad.title)}</h2>"]
    if len(triad.channels) > 1:
        caption = f"Allan deviation of all axes; {figure.BANDS}"
        parts.append(framed(caption, figure.triad_figure(triad, str(i)), figure.triad_key(triad)))
    parts += [_channel(f"{i} {k}", a) for k, a in enumerate(triad.channels.values())]
    return "\n".join([*parts, "</section>"])


def _channel(salt: str, a: Analysis) -> str:
    parts = [
        f"<h3>{escape(a.name)}</h3>",
        framed("Allan deviation, model and terms", figure.channel_figure(a, salt), figure.channel_key(a)),
        html_table("Coefficients by method", ["", *(e.method for e in table.estimates(a))], table.method_rows(a)),
        _models(a),
        _curve(a),
    ]
    return "\n".join(part for part in parts if part)


def _models(a: Analysis) -> str:
    if not a.candidates:
        return ""
    body = [(terms, bic, "chosen" if chosen else "") for terms, bic, chosen in table.models(a)]
    return html_table("Candidate models", ["terms", "ΔBIC", ""], body, words=(2,))


def _curve(a: Analysis) -> str:
    unit = written(DEVIATION[a.quantity])
    use = rows(a.curve, _ROWS)
    some = "" if use.size == a.curve.n.size else f", {use.size} of {a.curve.n.size} averaging times"
    head = (
        "averaging time [s]",
        f"deviation [{unit}]",
        f"from [{unit}]",
        f"to [{unit}]",
        "edf",
        "IEEE Std 952 (for disjoint averages) [%]",
        "noise",
    )
    body = (table.curve_cells(a, int(k)) for k in use)
    caption = f"Intervals of {100.0 * a.curve.confidence:.1f} %{some}"
    return f"<details><summary>Table of the curve</summary>{html_table(caption, head, body, words=(6,))}</details>"
