"""The protocol that slicers follow."""

from typing import Protocol, runtime_checkable

from ccfem.fem.elasticity.part_stress import PartStress
from ccfem.machine.machine import Machine
from ccfem.slicing.layers.layer import Layer

Vector = tuple[float, float, float]


@runtime_checkable
class Slicer(Protocol):
    """A frozen dataclass whose fields are the parameters, called with data.

    Each module of `ccfem.slicing.slicers` is one slicer. The name of the module is its name on the
    command line and in part files; the class has the same name in capitals (``load_oriented``
    holds ``LoadOriented``).
    """

    def __call__(self, stress: PartStress, build: Vector, machine: Machine) -> tuple[Layer, ...]:
        """Cut a part into layers, from the first printed to the last.

        Parameters
        ----------
        stress : PartStress
            The part's mesh, and the stress on it for slicers that follow the stress.
        build : tuple of 3 floats
            Build direction in the frame of the mesh, of any length.
        """
        ...


def slicer_remarks(slicer: Slicer, stress: PartStress) -> tuple[str, ...]:
    """Ask a slicer with a method ``remarks`` what it has to say of a part, one line each."""
    remarks = getattr(slicer, "remarks", None)
    return () if remarks is None else tuple(remarks(stress))
