"""Part files to start from: one for a body, and examples."""

import json
import os
import re
from collections.abc import Iterable, Sequence
from importlib.resources import files
from pathlib import Path
from string import Template

import numpy as np

from ccfem.base.checks import check_known
from ccfem.base.errors import InputError
from ccfem.base.whole import existing_file, whole_file
from ccfem.body.files.surface import is_surface
from ccfem.body.mesh.face_places import BodyFaces
from ccfem.body.mesh.smooth_faces import Face, place_text
from ccfem.body.meshing.cad import is_cad
from ccfem.cases.inspection.body_faces import faces as faces_of
from ccfem.cases.inspection.face_choice import coplanar, face_rule
from ccfem.cases.reading import is_analysis, read

_LISTED = 40
"""Faces that are listed in a new part file."""
_MOST_HELD = 0.5
"""Share of the surface that may be held: beyond it the faces are too few to choose from."""
_END = 0.15
"""Share of the height that is held, and pulled, at the ends of such a body."""
_CELLS = 100_000
"""Cells up to which they are as short as walls are thick."""


def new_part(
    body: str | os.PathLike[str], out: str | os.PathLike[str] | None = None, force: bool = False
) -> Path:
    """Write a part file for a body: its faces listed, a support and a load to be changed.

    The largest plane that faces down is held, with all others at its height, as the feet of a part
    are; and the face farthest from there is pulled away with 100 N. Of a body of so few faces that
    most of it would be held, as a scan is, the lower end is held and the upper one pulled up. Cells
    are a twenty-fifth of the diagonal long, and no longer than walls are thick, up to about 100,000
    of them. Where the lengths look like metres (`BodyFaces.doubt`), the file scales them by 1000.
    A deck with steps has supports and loads of its own: they are taken over.

    Parameters
    ----------
    body : path
        Surface, CAD file or mesh.
    out : path, optional
        Default the name of the body with ``.toml``, in the current folder.
    force : bool
        Replace a file that is there.

    Returns
    -------
    Path
        The file that was written.

    Raises
    ------
    InputError
        Where the body cannot be read, or the file is there.
    """
    body = Path(body)
    if body.suffix in ("", ".toml"):
        raise InputError(
            f"ccfem new takes a body, such as lever.stl or lever.step; got '{body}': name its file"
        )
    existing_file(body, "the body")
    out = Path(f"{body.stem}.toml" if out is None else out)
    _refuse_present(out, force)
    if is_analysis(body):
        with whole_file(out) as temporary:
            temporary.write_text(_of_deck(body, read(body).problem.loads), "utf-8")
        return out
    listing, doubt = faces_in_mm(body)
    edge = usual_edge_length(listing)
    held, pulled, pull = _ends(listing, edge)
    with whole_file(out) as temporary:
        cells = edge if is_surface(body) or is_cad(body) else None
        temporary.write_text(_text(body, cells, listing, held, pulled, pull, doubt), "utf-8")
    return out


def _of_deck(deck: Path, cases: Iterable[str]) -> str:
    """Text of the part file of a deck with its analysis."""
    return f'''# A part file for {deck}, whose supports, loads and materials are taken over.
mesh = "{_plain(deck)}"
analysis = "deck"            # its load cases: {", ".join(cases)}
build = "z"                  # CHANGE: direction of printing
layers = 12                  # CHANGE: layers of fibre
'''


def usual_edge_length(listing: BodyFaces) -> float:
    """Length of the edges of cells, mm: see `new_part`.

    A wall that is much wider than thick has a thickness of twice its volume over its surface, and a
    regular tetrahedron a volume of its edge to the third over 6 sqrt(2).
    """
    a, b, c = np.moveaxis(listing.points[listing.triangles] - listing.points.mean(axis=0), 1, 0)
    volume = abs(float(np.einsum("ij,ij->", np.cross(a, b), c))) / 6.0
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    shortest = np.cbrt(6.0 * np.sqrt(2.0) * volume / _CELLS)
    return float(min(listing.size / 25.0, max(2.0 * volume / area, shortest)))


def _ends(listing: BodyFaces, edge: float) -> tuple[list[str], list[str], list[float]]:
    """Rules of what is held and what is pulled, and the force, N: see `new_part`."""
    faces = listing.faces
    held = max(range(len(faces)), key=lambda k: (_faces_down(faces[k]), faces[k].area))
    feet = [listing.numbers.index(number) for number in coplanar(listing, listing.numbers[held])]
    areas = [max(faces[k].area, 1e-300) for k in feet]
    if sum(areas) > _MOST_HELD * sum(face.area for face in faces):
        height = listing.points[listing.triangles][..., 2]
        low, high = float(height.min()), float(height.max())
        depth = max(_END * (high - low), 2.0 * edge)
        ends = (
            ("[-inf, -inf, -inf]", f"[inf, inf, {low + depth:.4g}]"),
            (f"[-inf, -inf, {high - depth:.4g}]", "[inf, inf, inf]"),
        )
        lower, upper = (['rule = "box"', f"lower = {a}", f"upper = {b}"] for a, b in ends)
        return lower, upper, [0.0, 0.0, 100.0]
    centre = np.average([faces[k].centre for k in feet], axis=0, weights=areas)
    away = [float(np.linalg.norm(face.centre - centre)) for face in faces]
    others = [k for k in range(len(faces)) if k not in feet]
    meshable = [k for k in others if faces[k].area > edge**2]
    pulled = max(meshable or others, key=away.__getitem__, default=0)
    pull = faces[pulled].centre - centre
    pull = 100.0 * pull / max(float(np.linalg.norm(pull)), 1e-300)
    return _rule(listing, feet), _rule(listing, [pulled]), pull.tolist()


def _faces_down(face: Face) -> bool:
    return face.kind == "plane" and bool(face.direction[2] < -0.9)


def _refuse_present(out: Path, force: bool) -> None:
    if os.path.lexists(out) and not force:
        raise InputError(f"{out} is there already: name another file (--out), or --force")


def faces_in_mm(body: Path) -> tuple[BodyFaces, str]:
    """Faces of a body, times 1000 where its lengths look like metres, and what is said of that."""
    listing = faces_of(body)
    doubt = listing.doubt
    return faces_of(body, scale=1000.0) if doubt else listing, doubt


def empty_part(body: Path, listing: BodyFaces, doubt: str = "") -> str:
    """Text of a part file for a body on which nothing is held and nothing loaded yet."""
    edge = usual_edge_length(listing) if is_surface(body) or is_cad(body) else None
    head = "# Made with ccfem open. Lengths in mm, forces in N, stresses in MPa."
    lines = [head, "", *_body_lines(body, edge, doubt), 'material = "pla"', ""]
    return "\n".join(lines)


def _plain(path: Path) -> str:
    return str(path).replace("\\", "/")


def _body_lines(body: Path, edge: float | None, doubt: str) -> list[str]:
    """Lines of a part file that say what its body is."""
    name = json.dumps(_plain(body), ensure_ascii=False)
    lines = [f"mesh = {name}"]
    if edge is not None:
        lines = [f"surface = {name}", f"edge_length = {edge:.3g}           # mm; of the cells"]
    if doubt:
        lines.append(f"scale = 1000                 # CHANGE: {doubt.partition(': scale')[0]}")
    return lines


def _text(
    body: Path,
    edge: float | None,
    listing: BodyFaces,
    held: Sequence[str],
    pulled: Sequence[str],
    pull: Sequence[float],
    doubt: str,
) -> str:
    """Text of the part file."""
    path = _plain(body)
    listed = [
        f"#   {number:>3}  at {place_text(listing.point_on(face))}, {face.shape}"
        + (f"  ({listing.names[k]})" if any(listing.names) else "")
        for k, (number, face) in enumerate(zip(listing.numbers, listing.faces, strict=True))
    ][:_LISTED]
    more = len(listing.faces) - len(listed)
    if more > 0:
        listed.append(f"#   and {more} smaller ones: ccfem faces {path}")
    template = Template(files(__package__).joinpath("new_part.toml").read_text(encoding="utf-8"))
    return template.substitute(
        path=path,
        name="".join(c if c.isalnum() or c in "-_" else "_" for c in body.stem),
        body="\n".join(_body_lines(body, edge, doubt)),
        faces="\n".join(listed),
        held="\n".join(held),
        pulled="\n".join(pulled),
        pull=", ".join(f"{x + 0.0:.1f}" for x in pull),
    )


def _rule(listing: BodyFaces, chosen: Sequence[int]) -> list[str]:
    """Lines of the rule for faces, by their places."""
    numbers = [listing.numbers[k] for k in chosen]
    named = f"face{'s' if len(numbers) > 1 else ''} {', '.join(map(str, numbers))}"
    lines = [f"{key} = {_toml(value)}" for key, value in face_rule(listing, numbers).items()]
    lines[1] += f"   # on {named} of the list above"
    return lines


def _toml(value: object) -> str:
    """Text of a value in TOML: whole numbers without a point."""
    return re.sub(r"\.0(?=[,\]]|$)", "", json.dumps(value))


def examples() -> dict[str, str]:
    """Return the text of each example by its name."""
    folder = files("ccfem.cases").joinpath("examples")
    texts = {file.name: file.read_text(encoding="utf-8") for file in folder.iterdir()}
    return {k.removesuffix(".toml"): texts[k] for k in sorted(texts) if k.endswith(".toml")}


def write_example(
    name: str, out: str | os.PathLike[str] | None = None, force: bool = False
) -> Path:
    """Write an example to a file, by default NAME.toml; returns its path."""
    texts = examples()
    check_known("example", name, texts)
    out = Path(f"{name}.toml" if out is None else out)
    _refuse_present(out, force)
    with whole_file(out) as temporary:
        temporary.write_text(texts[name], encoding="utf-8")
    return out
