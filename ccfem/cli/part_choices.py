"""The part of a command, and what its options change of it: a value that a command takes whole."""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from ccfem.base.errors import InputError
from ccfem.base.toml import assignment
from ccfem.cli.arguments import argument, numbers_of, option
from ccfem.cli.machines import MachineName, SetMachine, machine_choice

if TYPE_CHECKING:
    from ccfem.cases.case import Case
    from ccfem.paths.placement.fibre_places import FibrePlaces
    from ccfem.paths.plastic.plastic import Plastic

SetPlastic = Annotated[
    list[str] | None,
    option(
        "KEY=VALUE,..",
        "Walls, skins, infill and seam, by keys of [plastic] in a part file: "
        "infill=gyroid,density=0.2,walls=2,skins=3,fibre_skins=1,seam=behind; repeatable.",
    ),
]


@dataclass(frozen=True)
class GivenPart:
    """A part as its file or its name says."""

    case: Annotated[
        str,
        argument(
            "CASE_OR_PART.toml", "Name of a case, a part file, or a deck with its analysis (.inp)."
        ),
    ]
    set_case: Annotated[
        list[str] | None,
        option("NAME=VALUE", "Set a parameter of the case, as element_size=3; repeatable."),
    ] = None

    def change(self) -> "Callable[[Case], Case]":
        """Return what makes the part that is asked for of the part that was read."""
        return lambda case: case

    def read(self, refine: bool = False) -> "Case":
        """Read the part file, or make the case.

        Parameters
        ----------
        refine : bool, default False
            Refine cells until they are fine enough by the estimated error.
        """
        from ccfem.cases.reading import read

        change = self.change()
        _refuse_body(self.case)
        parameters = dict(assignment(text) for text in self.set_case or ())
        if parameters and self.case.endswith(".toml"):
            raise InputError(
                f"--set-case is for cases by name; '{self.case}' is a part file: change the file"
            )
        case = change(read(self.case, **parameters))
        return _refined(case) if refine else case


@dataclass(frozen=True)
class PrintedPart(GivenPart):
    """A part with the machine that prints it, and with what it is filled."""

    machine: MachineName = None
    set_machine: SetMachine = None
    set_fibre: Annotated[
        list[str] | None,
        option(
            "KEY=VALUE",
            "Which layers get fibre, by a key of [fibre] in a part file: layers=3:20:2, from=0.4, "
            "to=9.6, every=2, between=1, covered=true; repeatable.",
        ),
    ] = None
    set_plastic: SetPlastic = None

    def change(self) -> "Callable[[Case], Case]":
        """Return what sets machine, fibre and plastic of a part."""
        machine = machine_choice(self.machine, self.set_machine)
        fibre, plastic = fibre_choice(self.set_fibre), plastic_choice(self.set_plastic)

        def changed(case: "Case") -> "Case":
            case = case if machine is None else replace(case, machine=machine(case.machine))
            case = case if fibre is None else replace(case, fibre=fibre(case.fibre))
            return case if plastic is None else replace(case, plastic=plastic(case.plastic))

        return changed


@dataclass(frozen=True)
class TurnedPart(PrintedPart):
    """A part that is turned on the bed."""

    turn: Annotated[
        list[str] | None,
        option(
            "AXIS=DEGREES",
            "Turn the part on the bed, as z=37; x and y change the build direction; repeatable, "
            "one after the other.",
        ),
    ] = None

    @property
    def bed(self) -> dict[str, object]:
        """Table ``[bed]`` of what is given."""
        return {} if self.turn is None else {"turn": self.turn}

    def change(self) -> "Callable[[Case], Case]":
        """Return what sets machine, fibre, plastic and bed of a part."""
        change, bed = super().change(), self.bed
        return lambda case: change(case).on_bed(bed) if bed else change(case)


@dataclass(frozen=True)
class PlacedPart(TurnedPart):
    """A part, or several copies of it, at a place on the bed."""

    centre: Annotated[
        str | None, option("X,Y", "Middle of the part, or of all copies, on the bed, mm.")
    ] = None
    copies: Annotated[
        str | None, option("N|NXxNY", "Print several in one file, as 4, or 2x3 by X and Y.")
    ] = None

    @property
    def bed(self) -> dict[str, object]:
        """Table ``[bed]`` of what is given."""
        centre = {} if self.centre is None else {"centre": list(numbers_of(self.centre))}
        return super().bed | centre | ({} if self.copies is None else {"copies": self.copies})


def fibre_choice(
    texts: Sequence[str] | None,
) -> "Callable[[FibrePlaces | None], FibrePlaces] | None":
    """Turn ``--set-fibre`` into what it makes of a part's choice; None where it is not given."""
    if not texts:
        return None
    from ccfem.cases.part_fibre import fibre_of

    table = dict(assignment(text) for text in texts)
    if "regions" in table:
        raise InputError("--set-fibre sets no regions: write [[fibre.regions]] in a part file")
    if isinstance(table.get("layers"), int):
        table["layers"] = [table["layers"]]
    fibre_of(table)
    return lambda places: fibre_of(table, base=places)


def plastic_choice(texts: Sequence[str] | None) -> "Callable[[Plastic], Plastic] | None":
    """Turn ``--set-plastic`` into what it makes of a part's plastic; None where it is not given."""
    if not texts:
        return None
    from ccfem.cases.part_tables import plastic_of

    table = dict(assignment(piece) for text in texts for piece in text.split(","))
    plastic_of(table)
    return lambda plastic: plastic_of(table, plastic)


def _refuse_body(name: str) -> None:
    """Say what a part file is to who gives the body instead."""
    from ccfem.body.files.formats import suffixes
    from ccfem.body.files.surface import is_surface
    from ccfem.body.meshing.cad import is_cad
    from ccfem.cases.reading import is_analysis

    body = Path(name)
    if is_analysis(body):
        return
    if is_surface(body) or is_cad(body) or body.suffix.lower() in suffixes():
        raise InputError(
            f"{name} is a body without material, loads and supports; a part file (TOML) adds "
            f"these: 'ccfem new {shlex.quote(name)}' writes one to fill in"
        )


def _refined(case: "Case") -> "Case":
    """Case on cells that are fine enough by the estimated error; a finding says how many."""
    from ccfem.fem.elasticity.statics import refine

    problem = refine(case.problem)
    before, after = (len(solved.mesh.cells) for solved in (case.problem, problem))
    # Between walls and infill the stress jumps: there cells of any size have an estimated error.
    solid = "" if case.plastic.solid else " with solid plastic"
    remark = f"{before:,} cells were refined to {after:,} by their estimated error{solid}"
    findings = (*case.findings, remark) if after > before else case.findings
    return replace(case, problem=problem, findings=findings)
