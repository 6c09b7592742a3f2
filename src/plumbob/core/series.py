"""Values over time as a table for pandas and as a picture: one home for every result that has them."""

from abc import abstractmethod
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import MissingExtraError
from plumbob.core.text import FactsText

_HEIGHT = 1.8  # of a panel, inches


class Series(FactsText):
    """Mixin of what has values over time, which says in `columns` what they are."""

    __slots__ = ()

    @abstractmethod
    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Values (N,) by name with unit, as ``gyr_x [rad/s]``; the first are the times of all others."""

    def to_frame(self) -> Any:
        """Table for pandas, a column each."""
        return data_frame(self.columns())

    def plot(self, path: str | Path | None = None, *, overwrite: bool = False) -> Any:
        """Draw the values over time, a panel for those of one kind.

        Parameters
        ----------
        path : path, optional
            Picture to write, too; its suffix chooses the format (png, svg, pdf).
        overwrite : bool
            Whether a picture that lies there may be replaced.

        Returns
        -------
        matplotlib.figure.Figure
            A notebook shows it.

        Raises
        ------
        MissingExtraError
            If matplotlib is not installed.
        """
        (time, t), *others = self.columns().items()
        panels: dict[str, dict[str, NDArray[Any]]] = {}
        for name, values in others:
            panels.setdefault(_kind(name), {})[name.partition(" [")[0]] = values
        figure = needed("matplotlib.figure", "plots", "plumbob[plot]").Figure(
            figsize=(7.5, _HEIGHT * len(panels) + 0.5), layout="constrained"
        )
        axes = figure.subplots(len(panels), sharex=True, squeeze=False)[:, 0]
        for panel, (kind, lines) in zip(axes, panels.items(), strict=True):
            for name, values in lines.items():
                panel.plot(t, values, linewidth=0.8, label=name)
            panel.set_ylabel(kind)
            panel.legend(loc="upper right")
        axes[-1].set_xlabel(time)
        if path is not None:
            from plumbob.core.files import replacing

            with replacing(Path(path), overwrite=overwrite) as temporary:
                figure.savefig(temporary, format=Path(path).suffix.lstrip(".") or "png", dpi=200)
        return figure


def data_frame(columns: Mapping[str, NDArray[Any]]) -> Any:
    """Table for pandas of columns by name; errors as of `Series.to_frame`."""
    return needed("pandas", "tables", "pandas").DataFrame({name: np.array(values) for name, values in columns.items()})


def _kind(name: str) -> str:
    """What values of a panel have in common: their name before the axis, or their unit alone."""
    word, bracket, unit = name.partition(" [")
    stem = word.rpartition("_")[0] or word.rpartition(".")[0]
    return f"{stem}{bracket}{unit}" if stem else bracket.strip() + unit or word


def needed(module: str, what: str, package: str) -> Any:
    """Import a module that an extra brings, or say which one: `what` needs it, and `package` has it."""
    try:
        return import_module(module)
    except ImportError as error:
        name = module.partition(".")[0]
        raise MissingExtraError(f'{what} need {name}: pip install "{package}".') from error
