"""The material that the cases are printed of."""

from ccfem.materials import Material, isotropic, named_material

__all__ = ["printed_pla"]


def printed_pla() -> Material:
    """PLA+ with the modulus taken for the parts of Chen et al. 2021: 3500 MPa, nu 0.35.

    Both are assumed, as for a dense print; the strengths are those of ``pla_plus`` in the table of
    materials.
    """
    table = named_material("pla_plus")
    return isotropic(
        3500.0,
        0.35,
        "PLA+",
        table.tensile_strength,
        table.compressive_strength,
        f"assumed: modulus and Poisson's ratio; strengths: {table.source}",
    )
