"""What ``ccfem mesh`` does: a surface or a CAD file to a mesh with its faces as patches."""

from pathlib import Path
from typing import Any

from ccfem.base.errors import InputError
from ccfem.base.whole import check_writable
from ccfem.body.files.mesh_file import check_mesh_name, write_mesh
from ccfem.body.files.surface import is_surface
from ccfem.body.mesh.in_metres import in_metres
from ccfem.body.meshing.cad import is_cad
from ccfem.body.meshing.meshed_body import mesh_body


def mesh_file(body: Path, size: float, out: Path, scale: float, mesher: Any) -> None:
    """Mesh a file, write the mesh, and say what it is."""
    check_mesh_name(out)
    check_writable(out)
    if not is_surface(body) and not is_cad(body):
        raise InputError(
            f"cannot mesh {body}: its name must end in .stl, .obj, .ply, .step, .stp, .iges, .igs "
            "or .brep"
        )
    mesh, findings = mesh_body(body, size, scale, mesher)
    write_mesh(mesh, out)
    for line in findings:
        print(line)
    doubt = in_metres(mesh.points)
    if doubt:
        print(f"warning: {doubt}")
    print(f"{out}: {len(mesh.cells):,} cells, patches {', '.join(sorted(mesh.patches)) or 'none'}")
