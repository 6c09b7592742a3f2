"""How an object shows itself: one line in a terminal, a small table in a notebook."""

from collections.abc import Mapping

from plumbob.core.text import visible


class Shown:
    """Mixin of what says of itself in `facts` what a reader wants to know first."""

    __slots__ = ()

    def facts(self) -> Mapping[str, str]:
        """What it is, by name; no value is longer than a few words."""
        raise NotImplementedError

    def __repr__(self) -> str:
        told = "; ".join(f"{name} {value}" for name, value in self.facts().items())
        return f"<{type(self).__name__}: {visible(told)}>"

    def _repr_html_(self) -> str:
        from html import escape

        rows = "".join(
            f"<tr><th>{escape(visible(name))}</th><td>{escape(visible(value))}</td></tr>"
            for name, value in self.facts().items()
        )
        return f"<table><caption>{escape(type(self).__name__)}</caption>{rows}</table>"
