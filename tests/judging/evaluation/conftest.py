"""Parts with stress written by hand, and their layers."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from ccfem.body.mesh import TetMesh
from ccfem.body.mesh.box import box_mesh
from ccfem.fem.elasticity.problem import Problem
from ccfem.fem.elasticity.stress_field import SolveRecord, StressField
from ccfem.fem.materials import isotropic
from ccfem.judging.evaluation.layer_paths import PlanePaths, plane_paths
from ccfem.paths.toolpaths import Toolpaths
from ccfem.slicing.layers.layer import Layer
from ccfem.slicing.slicers.planar import Planar


class Part:
    """A part with its stress and layers."""

    def __init__(self, stress: StressField, layers: tuple[Layer, ...]) -> None:
        self.stress, self.layers = stress, layers

    def __repr__(self) -> str:
        return f"Part of {len(self.stress.mesh.cells)} cells"

    def paths(
        self,
        *lines: Sequence[Sequence[float]],
        layer: int = 0,
        links: Sequence[Sequence[int]] | None = None,
    ) -> Toolpaths:
        """Toolpaths on a layer from lists of plane points; `links`: which steps of each are."""
        marks = None
        if links is not None:
            marks = [np.isin(np.arange(len(x)), y) for x, y in zip(lines, links, strict=True)]
        points = [np.array(x, dtype=float) for x in lines]
        return Toolpaths.from_plane(points, self.layers[layer], link=marks)

    def plane(
        self,
        *lines: Sequence[Sequence[float]],
        layer: int = 0,
        links: Sequence[Sequence[int]] | None = None,
    ) -> PlanePaths:
        """Paths of a layer as the indices take them."""
        return plane_paths(self.paths(*lines, layer=layer, links=links), self.layers[layer])


def make_part(
    stress: Callable[[np.ndarray], np.ndarray],
    size: tuple[float, float, float] = (60.0, 40.0, 2.0),
    divisions: tuple[int, int, int] = (12, 8, 1),
    mesh: TetMesh | None = None,
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0),
    count: int = 1,
) -> Part:
    """A box (or a given mesh) whose nodal stress is a function (n, 3) -> (n, 3, 3) of the place."""
    mesh = box_mesh(size, divisions) if mesh is None else mesh
    problem = Problem(mesh, isotropic(1000.0, 0.3), ())
    nothing, record = np.zeros_like(mesh.points), SolveRecord("by hand", 0, 0.0, 0.0, 0.0, 0)
    cell = stress(mesh.points[mesh.corners].mean(axis=1))
    field = StressField(problem, "pull", nothing, cell, stress(mesh.points), nothing, 0.0, record)
    return Part(field, Planar(count=count).cut(mesh, direction))


def uniform(s11: float, s22: float = 0.0, s12: float = 0.0) -> Callable[[np.ndarray], np.ndarray]:
    """The same plane stress, MPa, everywhere."""
    tensor = np.array([[s11, s12, 0.0], [s12, s22, 0.0], [0.0, 0.0, 0.0]])
    return lambda points: np.broadcast_to(tensor, (len(points), 3, 3)).copy()


@pytest.fixture(name="make_part", scope="session")
def make_part_fixture() -> Callable[..., Part]:
    return make_part


@pytest.fixture(name="uniform", scope="session")
def uniform_fixture() -> Callable[..., Callable[[np.ndarray], np.ndarray]]:
    return uniform


@pytest.fixture(scope="session")
def framed() -> Part:
    """That plate with a window of 20 x 10 mm round (30, 20)."""
    mesh = box_mesh((60.0, 40.0, 2.0), (12, 8, 1))
    x, y, _ = mesh.points[mesh.corners].mean(axis=1).T
    window = (np.abs(x - 30.0) < 10.0) & (np.abs(y - 20.0) < 5.0)
    return make_part(uniform(10.0), mesh=type(mesh)(mesh.points, mesh.cells[~window]))


@pytest.fixture(scope="session")
def pulled() -> Part:
    """A plate of 60 x 40 x 2 mm under 10 MPa along x."""
    return make_part(uniform(10.0))
