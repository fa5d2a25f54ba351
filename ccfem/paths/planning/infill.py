"""Common base of strategies that fill a section with strands at a spacing."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Literal

import numpy as np

from ccfem.base.arrays import BoolArray, FloatArray
from ccfem.base.checks import check_choices, check_fields
from ccfem.base.threads import in_threads
from ccfem.fem.elasticity.part_stress import PartStress
from ccfem.geometry.sections import corners_only
from ccfem.geometry.shapes import Region
from ccfem.machine.machine import Machine
from ccfem.paths.linking.cut_turns import cut_turns
from ccfem.paths.linking.joining import Joined
from ccfem.paths.planning.strategy import Amount, LayerPlanner
from ccfem.paths.raster.bitmap import Bitmap, bitmap
from ccfem.paths.raster.patterns import Regions
from ccfem.paths.raster.raster_plan import RasterPlan, raster_plan
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.layers.layer_stress import LayerStress

SPACING = Amount("spacing", most=1.0, least=20.0)
"""Amount of a strategy whose parameter `spacing` is the distance of strands in fibre widths."""

Turns = Literal["tight", "printable", "cut"]
"""How turns tighter than the machine's minimum radius are treated. "tight": strands follow them;
"printable": they are cut if both sides are long enough for the cutter; "cut": they are all cut, and
parts that are too short are dropped."""


def check_fill(strategy: object) -> None:
    """Check the parameters of strategies with a `spacing`: also choices and a `minimum_length`.

    Raises
    ------
    InputError
    """
    check_choices(strategy)
    check_fields(strategy, "spacing", at_least=1.0, unit="fibre width")
    if hasattr(strategy, "minimum_length"):
        check_fields(strategy, "minimum_length", at_least=0.0, unit="mm")


def check_shells(strategy: object) -> None:
    """Check the parameters `shells` and `closest` of a strategy.

    Raises
    ------
    InputError
    """
    check_fields(strategy, "shells", at_least=0)
    check_fields(strategy, "closest", at_least=0.5, at_most=1.0, unit="spacings")


def long_enough(paths: Toolpaths, least: float | None, machine: Machine) -> Toolpaths:
    """Paths no shorter than `least`, mm; None for the shortest that the machine can cut."""
    return paths.select(paths.lengths >= (machine.minimum_length if least is None else least))


def with_turns(
    strategy: Any,
    lines: Sequence[FloatArray],
    machine: Machine,
    link: Sequence[BoolArray] | None = None,
) -> Joined:
    """Cut strands at turns that the machine's fibre cannot follow, if the strategy says so.

    Parameters
    ----------
    strategy : object
        With `turns`; optionally with a `spacing` in fibre widths and a `minimum_length`.
    lines : sequence of (n_i, 2) arrays, mm
    machine : Machine
    link : sequence of (n_i,) bool arrays, optional
        Which of their steps are marked as links.
    """
    lines = list(lines)
    none = [np.zeros(len(line), dtype=bool) for line in lines]
    joined = Joined(lines, none if link is None else list(link))
    if strategy.turns == "tight":
        return joined
    width, least = machine.fibre_width, getattr(strategy, "minimum_length", None)
    least = max(machine.minimum_length, least or 0.0)  # the cutter cannot make shorter pieces
    spacing = strategy.spacing if strategy.amount.parameter == "spacing" else 1.0
    every, radius = strategy.turns == "cut", machine.minimum_radius
    return cut_turns(joined, radius, width, least, spacing * width, every)


class Infill(ABC):
    """A strategy that lays polylines, or paths of pixels where its `mode` is "raster".

    Everything that depends only on the section of a layer is computed once for all layers of a part
    with equal sections: see `prepare`.
    """

    spacing: float
    minimum_length: float | None
    mode: Literal["polyline", "raster"]
    turns: Turns = "tight"

    amount: ClassVar[Amount] = SPACING
    in_plane: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_fill(self)

    @property
    def on_axes(self) -> bool:
        """Whether paths keep to the axes of the layer, as those of pixels do."""
        return self.mode == "raster"

    def prepare(self, section: Region, machine: Machine) -> Any:
        """Compute what layers of equal sections share; passed to `strands`, in several threads."""
        return None

    @abstractmethod
    def strands(
        self, layer: Layer, stress: LayerStress, machine: Machine, prepared: Any
    ) -> list[FloatArray]:
        """Strands (n_i, 2), mm, in the plane of a layer, however short."""

    def linked(self, lines: list[FloatArray], prepared: Any, machine: Machine) -> Joined:
        """Strands cut at turns; a strategy may also join their ends by marked links."""
        return with_turns(self, lines, machine)

    @abstractmethod
    def regions(self, image: Bitmap, layer: Layer, stress: LayerStress) -> Regions:
        """Pattern of pixels of a layer."""

    def raster(self, layer: Layer, stress: LayerStress, machine: Machine) -> RasterPlan:
        """Plan one layer on a bitmap of pixels a spacing wide, whatever the mode."""
        image = bitmap(layer.plane.polygon, self.spacing * machine.fibre_width)
        return raster_plan(image, self.regions(image, layer, stress))

    def for_part(
        self, stress: PartStress | None, layers: Sequence[Layer], machine: Machine
    ) -> LayerPlanner:
        """Prepare the sections of a part; `stress` is not used for that."""
        if self.mode == "raster":
            return _Prepared(self, {})
        sections = [corners_only(layer.plane.polygon) for layer in layers]
        unequal = list(dict.fromkeys(sections))
        made = in_threads(partial(self.prepare, machine=machine), unequal)
        known = dict(zip(unequal, made, strict=True))
        index = [layer.index for layer in layers]
        return _Prepared(self, {k: known[s] for k, s in zip(index, sections, strict=True)})

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        """Plan the paths of one layer; none where the section is thinner than a fibre."""
        return self.for_part(None, [layer], machine)(layer, stress, machine)


@dataclass(frozen=True)
class _Prepared:
    """An infill with its prepared data for each layer of a part, by `Layer.index`."""

    infill: Infill
    known: dict[int, Any]

    def __call__(self, layer: Layer, stress: LayerStress, machine: Machine) -> Toolpaths:
        infill = self.infill
        if infill.mode == "raster":
            found = with_turns(infill, infill.raster(layer, stress, machine).lines(), machine)
        else:
            prepared = self.known[layer.index]
            lines = infill.strands(layer, stress, machine, prepared)
            found = infill.linked(lines, prepared, machine)
        paths = Toolpaths.from_plane(found.lines, layer, link=found.link)
        return long_enough(paths, infill.minimum_length, machine)
