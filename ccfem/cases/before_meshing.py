"""What can be known of patches and supports before a surface is meshed, which may take minutes."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from ccfem.base.errors import Mistakes
from ccfem.body.files.surface import Surface
from ccfem.body.mesh.cell_mesh import CellMesh
from ccfem.body.mesh.face_names import face_name
from ccfem.body.mesh.patches import PatchRule, patches_from_rules
from ccfem.body.mesh.shell import Shell, refined
from ccfem.body.mesh.smooth_faces import FEATURE_ANGLE, smooth_faces
from ccfem.fem.elasticity.body import LoadedBody
from ccfem.fem.elasticity.load_kinds import Load, PointForce, SurfaceLoad, patches_in_use
from ccfem.fem.elasticity.loads import nodal_forces
from ccfem.fem.elasticity.support_kinds import AnySupport
from ccfem.fem.elasticity.supports import held


@dataclass(frozen=True)
class _Outline:
    """Supports and loads on a surface alone."""

    mesh: CellMesh
    body: LoadedBody
    supports: tuple[AnySupport, ...]
    loads: Mapping[str, tuple[Load, ...]]


def check_before_meshing(
    surface: Surface,
    edge_length: float,
    rules: Mapping[str, PatchRule],
    supports: tuple[AnySupport, ...],
    loads: Mapping[str, tuple[Load, ...]],
    case_supports: Mapping[str, tuple[AnySupport, ...]] = MappingProxyType({}),
    angle: float = FEATURE_ANGLE,
) -> None:
    """Try rules, supports and loads on the surface, cut finer than the mesh will be.

    The feature angle, degrees, is that between the faces of the surface.

    Raises
    ------
    InputError
        For rules that choose nothing, unknown patches, loads that their patch cannot take, and
        motions that no support hinders.
    """
    found = Mistakes()
    points, triangles, origin = refined(surface.points, surface.triangles, 0.5 * edge_length)
    groups = {
        face_name(k): triangles[np.isin(origin, face.facets)]
        for k, face in enumerate(smooth_faces(surface.points, surface.triangles, angle), 1)
    }
    shell = Shell(points, triangles, groups)
    for name, rule in rules.items():
        with found.noted():
            shell = patches_from_rules(shell, {name: rule})
    own = [support for each in case_supports.values() for support in each]
    for name in set(patches_in_use((*supports, *own), loads)) - set(rules):
        with found.noted():
            shell.patch(name)
    found.complain()
    sets = [(*supports, *case_supports.get(name, ())) for name in loads] or [supports]
    for k, one in enumerate(sets):
        if one not in sets[:k]:
            with found.noted():
                held(_Outline(shell, shell, one, loads))
    for those in loads.values():
        for load in those:
            if isinstance(load, SurfaceLoad) and not isinstance(load, PointForce):
                with found.noted():
                    nodal_forces(shell, load)
    found.complain()
