"""What ``ccfem mesh`` does: a surface, CAD file or stack of layers to a mesh."""

from pathlib import Path
from typing import Any

from ccfem.base.errors import InputError
from ccfem.base.whole import check_writable
from ccfem.body.files import surface
from ccfem.body.files.mesh_file import check_mesh_name, write_mesh
from ccfem.body.mesh.check import in_metres
from ccfem.body.meshing import cad
from ccfem.body.meshing.meshed_body import mesh_body


def mesh_file(body: Path, size: float, out: Path, scale: float, mesher: Any) -> None:
    """Mesh a file, write the mesh, and say what it is."""
    check_mesh_name(out)
    check_writable(out)
    if not body.is_dir() and not surface.is_surface(body) and not cad.is_cad(body):
        *others, last = (*surface.SUFFIXES, *cad.SUFFIXES)
        names = f"{', '.join(others)} or {last}"
        raise InputError(
            f"cannot mesh {body}: its name must end in {names}, or be that of a folder of layers"
        )
    mesh, findings = mesh_body(body, size, scale, mesher)
    write_mesh(mesh, out)
    for line in findings:
        print(line)
    doubt = in_metres(mesh.points)
    if doubt:
        print(f"warning: {doubt}")
    print(f"{out}: {len(mesh.cells):,} cells, patches {mesh.patch_list}")
