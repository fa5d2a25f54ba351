"""``ccfem optimise``: the stiffest part with a share of the volume, as a part file."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from os.path import lexists
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ccfem.base.checks import check_number
from ccfem.base.errors import InputError
from ccfem.base.toml import assignment
from ccfem.cli.arguments import names_of, numbers_of, option, path_of
from ccfem.cli.options import grouped
from ccfem.cli.part_choices import GivenPart

if TYPE_CHECKING:
    from ccfem.base.progress import Progress
    from ccfem.cases.case import Case
    from ccfem.cases.optimised import Optimisation, Optimised

_TENTH = 0.1
"""Share of the iterations after which the next one is named."""


@dataclass(frozen=True)
class OptimisationOptions:
    """How a part is optimised."""

    volume_fraction: Annotated[
        float, option("F", "Share of the volume that is left, above 0, below 1.")
    ]
    method: Annotated[
        str,
        option(
            "somp|simp", "Densities and the axis of a laminate, for plates; or densities alone."
        ),
    ] = "somp"
    element_size: Annotated[
        float | None, option("MM", "Element size of a plate; by default it has 4000 square cells.")
    ] = None
    radius: Annotated[
        float | None, option("MM", "Radius of the filter; default two element sizes.")
    ] = None
    filter_: Annotated[str, option("sensitivity|density", "What is filtered.", "--filter")] = (
        "sensitivity"
    )
    orientation: Annotated[
        str, option("gradient|principal|fixed", "How somp turns the axis of the laminate.")
    ] = "gradient"
    laminate: Annotated[
        str | None,
        option(
            "E1,E2,NU12,G12",
            "Of somp, MPa; default the part's own material where it has an axis, else the woven "
            "laminate of Wang et al. 2021.",
        ),
    ] = None
    weight: Annotated[
        list[str] | None, option("CASE=W", "Weight of a load case, default 1; repeatable.")
    ] = None
    keep: Annotated[
        str | None,
        option(
            "A,B,..",
            "Patches around which the part stays solid; default loaded patches and supported "
            "holes; '' for none.",
        ),
    ] = None
    solid: Annotated[
        list[str] | None,
        option(
            "X,Y,R", "Disc to keep solid, or X,Y,X,Y a rectangle, X,Y,Z,X,Y,Z a box; repeatable."
        ),
    ] = None
    void: Annotated[list[str] | None, option("X,Y,R", "The same, to keep empty; repeatable.")] = (
        None
    )
    iterations: Annotated[int, option("N", "Iterations at most.")] = 200
    in_space: Annotated[
        bool, typer.Option("--in-space", help="Optimise a flat part in 3D too (simp).")
    ] = False

    def __post_init__(self) -> None:
        check_number("--iterations", self.iterations, at_least=1)
        if self.radius is not None:
            check_number("--radius", self.radius, above=0.0, unit="mm")

    def asked(self, part: "Case") -> "Optimisation":
        """Return what is asked of an optimisation of a part."""
        from ccfem.cases.optimised import Optimisation

        weights = dict(assignment(text) for text in self.weight or ())
        return Optimisation(
            volume_fraction=self.volume_fraction,
            method=self.method,  # type: ignore[arg-type]
            element_size=self.element_size,
            radius=self.radius,
            filter=self.filter_,  # type: ignore[arg-type]
            orientation=self.orientation,  # type: ignore[arg-type]
            laminate=None if self.laminate is None else numbers_of(self.laminate),
            weights=dict.fromkeys(part.problem.loads, 1.0) | weights if weights else None,
            keep=None if self.keep is None else names_of(self.keep),
            solid=[numbers_of(place) for place in self.solid or ()],
            void=[numbers_of(place) for place in self.void or ()],
            max_iterations=self.iterations,
            in_space=self.in_space,
        )


@grouped
def optimise(
    given: GivenPart,
    how: OptimisationOptions,
    out: Annotated[
        Path | None,
        option(
            "PART.toml",
            "Part file; beside it mesh, picture and history. Default NAME-optimised.toml.",
            parser=path_of,
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that are there.")] = False,
) -> None:
    """Optimise the topology of a part; the new part is a part file with its mesh.

    Supports, loads and their patches are carried over. Beside PART.toml lie its mesh (.npz), a
    picture of densities and outline (.png) and the compliance of every iteration (.csv).
    """
    from ccfem.base.progress import progress_bar
    from ccfem.cases.optimised import find_design

    whole = given.read()
    asked = how.asked(whole)
    files = _files(Path(f"{whole.name}-optimised.toml") if out is None else out, force)
    with progress_bar(lines=True) as progress:
        optimised = find_design(whole, asked, _now_and_then(progress))
    # Another run may have written them since.
    files = _files(files[0], force)
    _write(optimised, files, given.case)
    _say(optimised, files)


def _now_and_then(progress: "Progress") -> "Progress":
    """Progress that names a step only where a tenth of the work is done since the one before."""
    shown, at = "", -1.0

    def tell(what: str, share: float) -> None:
        nonlocal shown, at
        if share >= at + _TENTH or share >= 1.0:
            shown, at = what, share
        progress(shown, share)

    return tell


def _files(part: Path, force: bool) -> tuple[Path, Path, Path, Path]:
    """Part file, mesh, picture and history, none of which is there already."""
    from ccfem.base.whole import check_writable

    if part.suffix != ".toml":
        raise InputError(f"a part file ends in .toml; got --out {part}: name it so")
    files = (part, *(part.with_suffix(suffix) for suffix in (".npz", ".png", ".csv")))
    for file in files:
        check_writable(file)
        if lexists(file) and not force:
            raise InputError(f"{file} is there already: name another part (--out), or --force")
    return files  # type: ignore[return-value]


def _write(optimised: "Optimised", files: Sequence[Path], case: str) -> None:
    """Write all files, or none of them."""
    import shlex
    import sys

    from ccfem.base.whole import whole_file
    from ccfem.body.files.formats import npz
    from ccfem.cases.part_writing import part_text
    from ccfem.comparison.plot.canvas import png
    from ccfem.comparison.plot.part_views import design_picture

    _, mesh, picture, history = files
    design, new = optimised.design, optimised.case
    text = part_text(
        new,
        mesh.name,
        f"{case}, optimised by: {shlex.join(['ccfem', *sys.argv[1:]])}\n"
        f"Densities: {picture.name}; compliance of every iteration: {history.name}",
    )
    heading = f"{new.name}: {design.compliance[-1]:.4g} N mm, {design.volume_fraction:.0%}"
    rows = [
        f"{k},{value:.10g},{change}"
        for k, (value, change) in enumerate(
            zip(design.compliance, ("", *(f"{c:.6g}" for c in design.change)), strict=True)
        )
    ]
    with ExitStack() as stack:
        to_part, to_mesh, to_picture, to_history = (
            stack.enter_context(whole_file(file)) for file in files
        )
        figure = design_picture(design, optimised.planform, new.problem.mesh, heading)
        to_picture.write_bytes(png(figure))
        to_history.write_text(
            "\n".join(["iteration,compliance_N_mm,largest_change", *rows, ""]), encoding="utf-8"
        )
        npz.write(new.problem.mesh, to_mesh)
        to_part.write_text(text, encoding="utf-8")


def _say(optimised: "Optimised", files: Sequence[Path]) -> None:
    """Print what was found."""
    design, mesh = optimised.design, optimised.case.problem.mesh
    part, _, picture, history = files
    print(
        f"{design.iterations} iterations: compliance {design.compliance[0]:.4g} to "
        f"{design.compliance[-1]:.4g} N mm at {design.volume_fraction:.3f} of the volume"
    )
    for line in optimised.remarks:
        print(f"note: {line}")
    print(
        f"{part}: {len(mesh.cells):,} cells, patches {mesh.patch_list}; "
        f"picture {picture}, history {history}"
    )
    print(f"try: ccfem plan {part} --strategy svt")
