"""Planning the paths of a whole part."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ccfem.base.arrays import IntArray
from ccfem.base.checks import check_instance
from ccfem.base.errors import InputError
from ccfem.base.parallel import in_processes, in_threads, one_blas_thread
from ccfem.fem.elasticity import PartStress
from ccfem.geometry.even_steps import OFF, even_steps
from ccfem.machine.machine import Machine
from ccfem.paths.fields.chart import chart_of, flat_view
from ccfem.paths.planning.alike import on_layer
from ccfem.paths.planning.strategy import LayerPlanner, PartStrategy, Strategy
from ccfem.paths.planning.unfolding import may_fold, unfolded_paths
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer, curved_layers, stress_on
from ccfem.slicing.layers.slicer import check_pitch


@one_blas_thread
def plan(
    strategy: Strategy,
    layers: Sequence[Layer],
    stress: PartStress,
    machine: Machine,
    alike: IntArray | None = None,
) -> Toolpaths:
    """Plan the paths of a whole part, several layers at a time.

    A strategy that works in a plane (`in_plane`) plans on curved layers by their charts.

    Parameters
    ----------
    strategy : Strategy
        Called from several processes, each time with a layer of its own.
    stress : PartStress
        A `StressField`, or a `GivenStress` for strategies that do not solve the part again.
    alike : (n,) int array, optional
        Position of the layer whose paths each layer takes (`ccfem.paths.planning.alike`), of use
        for strategies that plan `by_layer`. Default: all layers are planned.

    Returns
    -------
    Toolpaths
        The paths of all layers, in their order, in steps of at most a fibre width.

    Raises
    ------
    InputError
        When the strategy plans on flat layers only and a layer is curved, when layers are nearer
        than a strand is high; and whatever the strategy raises.
    """
    check_instance("strategy", strategy)
    check_layers(strategy, layers, machine)
    if alike is not None and plans_alike(strategy):
        chosen, number = np.unique(alike, return_inverse=True)
        some = [layers[k] for k in chosen.tolist()]
        paths = plan(strategy, some, stress, machine)
        of_layer = [paths.on_layer(layer.index) for layer in some]
        return Toolpaths.concatenate(
            on_layer(of_layer[k], layer) for k, layer in zip(number.tolist(), layers, strict=True)
        )
    in_plane = getattr(strategy, "in_plane", False)
    views: Sequence[Layer] = layers
    if in_plane:
        views = in_threads(flat_view, layers)
    if isinstance(strategy, PartStrategy):
        planner: LayerPlanner = strategy.for_part(stress, views, machine)
    else:
        planner = strategy
    return plan_layers(planner, layers, views, stress, machine, may_fold(strategy))


def plans_alike(strategy: Strategy) -> bool:
    """Whether layers that are alike get the same paths of a strategy."""
    return bool(getattr(strategy, "by_layer", False))


def plan_layers(
    planner: LayerPlanner,
    layers: Sequence[Layer],
    views: Sequence[Layer],
    stress: PartStress,
    machine: Machine,
    fold: bool = False,
) -> Toolpaths:
    """Paths of all layers by one planner, in steps of at most a fibre width.

    This is the last that changes strands: unless they may fold they are led round folds or cut
    there (`ccfem.paths.planning.unfolding`).

    Parameters
    ----------
    planner : LayerPlanner
        Called from several processes, each time with a layer of its own.
    views : sequence of Layer
        The same layers as passed to the planner: laid flat if it works in a plane.
    fold : bool, default False
        Whether strands may fold.
    """

    def planned(layer: Layer, view: Layer) -> Toolpaths:
        paths = planner(view, stress_on(view, stress), machine)
        if not fold:
            paths = unfolded_paths(paths, view, machine)
        paths = in_even_steps(paths, machine.fibre_width)
        paths = paths if view is layer else chart_of(layer).lifted(paths)
        return paths if fold else unfolded_paths(paths, None, machine)

    return Toolpaths.concatenate(in_processes(planned, layers, views, shared=[planner, stress]))


def check_layers(strategy: Strategy, layers: Sequence[Layer], machine: Machine) -> None:
    """Refuse layers that no strategy, or not this strategy, can plan on."""
    curved = [layer.index for layer in curved_layers(layers)]
    if curved and getattr(strategy, "flat_layers_only", False):
        raise InputError(
            f"{type(strategy).__name__} plans on flat layers only; {len(curved)} of {len(layers)} "
            f"layers are curved, the first is layer {curved[0]}: choose a planar slicing, or a "
            "strategy for curved layers"
        )
    check_pitch(layers, machine)


# Final form of planned paths: steps of about a fibre width, and no paths of zero length.


_SHORTEST = 1e-6
"""Length, in steps, up to which a path counts as having none."""


def in_even_steps(toolpaths: Toolpaths, step: float) -> Toolpaths:
    """Paths in steps no longer than a length, mm, and shorter only where paths bend.

    Parameters
    ----------
    step : float, mm
        Machines that get more points than they need stutter, while indices sampled at points need
        no fewer.

    Returns
    -------
    Toolpaths
        The same paths within 0.005 steps; corners and ends are exact. Paths of no length are left
        out.
    """
    paths = toolpaths.select(toolpaths.lengths > _SHORTEST * step)
    if not len(paths):
        return paths
    # Where a link begins or ends, its first step is the first that is one, or is none any more.
    inner = np.ones(len(paths.points), dtype=bool)
    inner[paths.offsets[:-1]] = False
    changes = inner & (paths.link != np.roll(paths.link, 1))
    points, offsets, source, share = even_steps(
        paths.points, paths.offsets, changes, step, OFF * step
    )
    before, after = (paths.normals[source[:, k]] for k in (0, 1))
    normals = before + share[:, None] * (after - before)
    link = paths.link[source[:, 0]]
    link[offsets[1:] - 1] = False
    return replace(
        paths,
        points=points,
        normals=normals / np.linalg.norm(normals, axis=1)[:, None],
        offsets=offsets,
        link=link,
    )
