"""What a printer takes its material from, and what material and its hours cost."""

from dataclasses import dataclass

from ccfem.base.errors import InputError, shown
from ccfem.machine.ranges import check_ranges


@dataclass(frozen=True)
class Spools:
    """Length on a full spool and on the one in the machine, in a part file ``[machine.spools]``.

    Nothing is said of spools whose length is not given.

    Attributes
    ----------
    fibre, matrix, coextruded : float, m, optional
        On a full spool of fibre, of matrix, and of the matrix that the fibre's head lays with it.
    fibre_left, matrix_left, coextruded_left : float, m, optional
        Left on the spool in the machine; by default it is full.
    """

    fibre: float | None = None
    matrix: float | None = None
    coextruded: float | None = None
    fibre_left: float | None = None
    matrix_left: float | None = None
    coextruded_left: float | None = None

    def __post_init__(self) -> None:
        check_ranges(self)
        for name in ("fibre", "matrix", "coextruded"):
            if getattr(self, name) is None and getattr(self, f"{name}_left") is not None:
                raise InputError(
                    f"spools.{name}_left needs spools.{name}, the length on a full spool: give both"
                )


@dataclass(frozen=True)
class Costs:
    """Prices, in a part file ``[machine.costs]``; nothing is said of what has none.

    Attributes
    ----------
    matrix : float, optional
        Of a kilogram of matrix.
    fibre : float, optional
        Of a metre of fibre.
    hour : float, optional
        Of an hour of the machine.
    currency : str
        Said behind the numbers.
    """

    matrix: float | None = None
    fibre: float | None = None
    hour: float | None = None
    currency: str = ""

    def __post_init__(self) -> None:
        check_ranges(self)
        if not self.currency.isprintable() or len(self.currency) > 12:
            raise InputError(
                f'costs.currency must be a short word, as "EUR"; got {shown(self.currency)}: '
                "write that"
            )
