"""Load cases of one part with weights, as the basis of planning for all of them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ccfem.base.arrays import FloatArray, freeze, read_only
from ccfem.base.checks import check_known, check_number
from ccfem.base.errors import InputError
from ccfem.body.mesh.tet_mesh import TetMesh
from ccfem.fem.elasticity.stress_field import StressField


@dataclass(frozen=True)
class WeightedCases:
    """Solutions of one part without fibre under one or several load cases, and their weights.

    The cases may belong to one problem or to several, such as with other supports, on one mesh.

    Attributes
    ----------
    fields : tuple of StressField
        One for each case, with different names.
    weights : (n,) array
        Of the cases: positive, scaled so that their sum is 1.

    Raises
    ------
    InputError
        For no case, duplicate names, different meshes, and weights that are not positive numbers.
    """

    fields: tuple[StressField, ...]
    weights: FloatArray

    def __post_init__(self) -> None:
        freeze(self, fields=tuple, weights=float)
        if not self.fields or self.weights.shape != (len(self.fields),):
            raise InputError(
                f"expected load cases with a weight each; got {len(self.fields)} cases and "
                f"{self.weights.size} weights: give one a case"
            )
        for name, weight in zip(self.names, self.weights, strict=True):
            _check_weight(name, float(weight))
        repeated = {name for name in self.names if self.names.count(name) > 1}
        if repeated:
            raise InputError(f"two load cases are named '{min(repeated)}': rename one of them")
        for field in self.fields:
            self._check_case(field)
        object.__setattr__(self, "weights", read_only(self.weights / self.weights.sum()))

    def _check_case(self, field: StressField) -> None:
        first, mesh = self.fields[0].mesh, field.mesh
        same = mesh is first or (
            np.array_equal(mesh.cells, first.cells) and np.array_equal(mesh.points, first.points)
        )
        if not same:
            raise InputError(
                f"load case '{field.case}' is solved on another mesh than '{self.names[0]}': "
                "solve all cases on one"
            )

    @classmethod
    def of(
        cls,
        fields: "StressField | WeightedCases | Mapping[str, StressField]",
        weights: Mapping[str, float] | None = None,
    ) -> "WeightedCases":
        """Cases by name, as `ccfem.solve` returns them, with weights; one case is a list of one.

        Parameters
        ----------
        fields : StressField, WeightedCases, or mapping of name to StressField
            Weighted cases without other weights are returned as they are.
        weights : mapping of name to float, optional
            Positive; cases that are not named do not count. Default: all count equally.

        Raises
        ------
        InputError
            For weights of unknown cases, and as the class.
        """
        if isinstance(fields, WeightedCases):
            if weights is None:
                return fields
            fields = dict(zip(fields.names, fields.fields, strict=True))
        if isinstance(fields, StressField):
            fields = {fields.case: fields}
        chosen = weights or dict.fromkeys(fields, 1.0)
        for name, weight in chosen.items():
            check_known("load case", name, fields)
            _check_weight(name, weight)
        return cls(tuple(fields[name] for name in chosen), np.array(list(chosen.values()), float))

    def __len__(self) -> int:
        return len(self.fields)

    def __repr__(self) -> str:
        said = (f"{n} {w:.3g}" for n, w in zip(self.names, self.weights, strict=True))
        return f"WeightedCases({', '.join(said)})"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cases."""
        return tuple(field.case for field in self.fields)

    @property
    def heaviest(self) -> StressField:
        """Case of the largest weight, the first one of several."""
        return self.fields[int(np.argmax(self.weights))]

    @property
    def mesh(self) -> TetMesh:
        """Mesh of all cases."""
        return self.fields[0].mesh


def _check_weight(name: str, weight: float) -> None:
    check_number(f"weight of load case '{name}'", weight, above=0.0)
