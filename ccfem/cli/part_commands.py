"""Commands round a part: ``open``, ``mesh``, ``new``, ``example``, ``cite``, ``solve``."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from ccfem.base.errors import InputError
from ccfem.cli.arguments import argument, option, path_of
from ccfem.cli.options import Backend, Refine, grouped
from ccfem.cli.part_choices import GivenPart

_Out = Annotated[Path | None, option("PART.toml", "File that is written.", parser=path_of)]
_Force = Annotated[bool, typer.Option("--force", help="Replace a file that is there.")]


def _open(
    what: Annotated[
        str | None,
        argument(
            "BODY_OR_PART_OR_CASE",
            "Body (.step, .stl, mesh), part file (.toml) or case; by default one is chosen on the "
            "page.",
        ),
    ] = None,
    port: Annotated[int, option("N", "Port on this machine; default any that is free.")] = 0,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Show the page in the browser.")
    ] = True,
) -> None:
    """Open the workbench in a browser: set up a part by clicks, check, compare, take away."""
    from ccfem.cli.stopping import Stopped, end
    from ccfem.workbench.opening import serve

    try:
        serve(what, port, browser)
    except Stopped:
        end()  # a thread of the page may be at work on a body, and would be waited for


def _new(
    body: Annotated[Path, argument("BODY", "Surface (.stl), CAD file (.step) or mesh.")],
    out: _Out = None,
    force: _Force = False,
) -> None:
    """Write a part file for a body: its faces listed, a support and a load to be changed."""
    from ccfem.cases.inspection.beginning import new_part

    written = new_part(body, out, force)
    if "\nscale = " in written.read_text(encoding="utf-8"):
        print(f"{written}: the lengths of {body} look like metres, so scale = 1000 is set")
    print(f"{written}: change what is marked, then: ccfem check {written}")


def _example(
    name: Annotated[str | None, argument("NAME", "Write this one; without it, list them.")] = None,
    out: _Out = None,
    force: _Force = False,
) -> None:
    """List the part files that come with ccfem, or write one of them here."""
    import tomllib

    from ccfem.cases.inspection.beginning import examples, write_example

    if name is None:
        for known, text in examples().items():
            print(f"{known}  {tomllib.loads(text)['title']}")
        print("ccfem example NAME writes NAME.toml here")
    else:
        written = write_example(name, out, force)
        print(f"{written}: try: ccfem check {written}")


def _cite(
    whats: Annotated[
        list[str] | None,
        argument("FOLDER_OR_METHOD", "Folders of results, or strategies and slicers."),
    ] = None,
) -> None:
    """Print BibTeX of ccfem, and of the papers whose methods a result used."""
    from ccfem.base.checks import check_known
    from ccfem.comparison.citations import METHODS, bibtex, cited, methods_of_results

    methods: list[str] = []
    for what in whats or ():
        path = Path(what)
        if path.suffix == ".json" or path.is_dir():
            methods += methods_of_results(path / "results.json" if path.is_dir() else path)
        else:
            check_known("method or folder of results", what, sorted(METHODS))
            methods.append(what)
    print(bibtex(cited(methods)))


def _mesh(
    body: Annotated[
        Path,
        argument(
            "BODY",
            "Surface ({surfaces}), CAD file ({cad_files}), or folder of curved layers of a solid "
            "(.obj).",
        ),
    ],
    size: Annotated[float, option("MM", "Edge length of the cells.")],
    out: Annotated[Path, option("MESH", "Mesh ({meshes}).", "-o", "--out", parser=path_of)],
    scale: Annotated[float, option("S", "Factor that converts a file's coordinates to mm.")] = 1.0,
    mesher: Annotated[str, option("auto|gmsh|ftetwild", "What meshes a surface.")] = "auto",
) -> None:
    """Mesh a surface or CAD file, faces as patches (face_1, or their names), or curved layers."""
    from ccfem.base.whole import check_writable
    from ccfem.body.files import surface
    from ccfem.body.files.mesh_file import check_mesh_name, write_mesh
    from ccfem.body.mesh.check import in_metres
    from ccfem.body.meshing import cad
    from ccfem.body.meshing.meshed_body import mesh_body

    check_mesh_name(out)
    check_writable(out)
    if not body.is_dir() and not surface.is_surface(body) and not cad.is_cad(body):
        *others, last = (*surface.SUFFIXES, *cad.SUFFIXES)
        names = f"{', '.join(others)} or {last}"
        raise InputError(
            f"cannot mesh {body}: its name must end in {names}, or be that of a folder of layers"
        )
    kind: Any = mesher
    mesh, findings = mesh_body(body, size, scale, kind)
    write_mesh(mesh, out)
    for line in findings:
        print(line)
    if doubt := in_metres(mesh.points):
        print(f"warning: {doubt}")
    print(f"{out}: {len(mesh.cells):,} cells, patches {mesh.patch_list}")


@grouped
def _solve(
    given: GivenPart,
    out: Annotated[
        Path, option("RESULT.vtu", "File that is written.", "-o", "--out", parser=path_of)
    ],
    load_case: Annotated[
        str | None,
        option(
            "NAME",
            "Only this one; default all, the name of each behind that of the file where there are "
            "several.",
        ),
    ] = None,
    backend: Backend = "auto",
    refine: Refine = False,
) -> None:
    """Solve a part and write displacement, strain, stress, reactions and error for ParaView."""
    from ccfem.base.checks import check_known
    from ccfem.base.progress import progress_bar
    from ccfem.base.whole import check_writable
    from ccfem.cli.screen import print_solution
    from ccfem.fem.elasticity.statics import solve
    from ccfem.printing.export.vtk import result_path, write_result

    part = given.read(refine)
    names = part.problem.cases
    if load_case is not None:
        check_known("load case", load_case, names)
        names = (load_case,)
    files = {name: out if len(names) == 1 else result_path(out, name) for name in names}
    for file in files.values():
        check_writable(result_path(file))
    with progress_bar(lines=True) as progress:
        fields = solve(part.printed_problem(), backend=backend, progress=progress)
    for name, file in files.items():
        write_result(fields[name], file)
        print_solution(fields[name], part.findings, file)


_COMMANDS: dict[str, Callable[..., None]] = {
    "open": _open,
    "mesh": _mesh,
    "new": _new,
    "example": _example,
    "cite": _cite,
    "solve": _solve,
}


class _NamingFormats(TyperCommand):
    """A command whose help names the suffixes of all files that are read and written.

    They are looked for when the help is printed: the modules of the formats import what is slow.
    """

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help."""
        from ccfem.body.files import surface
        from ccfem.body.files.formats import suffixes
        from ccfem.body.meshing import cad

        known = {
            "surfaces": surface.SUFFIXES,
            "cad_files": cad.SUFFIXES,
            "meshes": suffixes(writable=True),
        }
        names = {kind: ", ".join(members) for kind, members in known.items()}
        for parameter in self.params:
            text = getattr(parameter, "help", None)
            if text:
                parameter.help = text.format(**names)  # type: ignore[attr-defined]
        super().format_help(ctx, formatter)


def add_part_commands(app: typer.Typer) -> None:
    """Add the commands of this module to the command line."""
    for name, command in _COMMANDS.items():
        app.command(name, cls=_NamingFormats if command is _mesh else None)(command)
