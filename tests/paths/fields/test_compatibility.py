"""The incompatibility filter against the plain loops of its definition."""

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.paths.fields.tensile import incompatible


def plainly(direction, cells, defined, rule, limit):
    marked = []
    for e, cell in enumerate(cells):
        others = [
            k for k, other in enumerate(cells) if k != e and defined[k] and set(cell) & set(other)
        ]
        against = [direction[e] @ direction[k] <= limit for k in others]
        verdict = {
            "any": any(against),
            "majority": 2 * sum(against) > len(against),
            "all": bool(against) and all(against),
        }[rule]
        marked.append(bool(defined[e] and verdict))
    return np.array(marked)


@pytest.mark.parametrize("rule", ["any", "majority", "all"])
def test_equals_the_definition(rule: str) -> None:
    mesh = box_mesh((3.0, 3.0, 2.0), (3, 3, 2))
    random = np.random.default_rng(5)
    direction = random.normal([2.0, 0.0, 0.0], 1.0, (len(mesh.cells), 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    defined = random.random(len(direction)) > 0.2
    found = incompatible(direction, mesh.cells, defined, rule)
    np.testing.assert_array_equal(found, plainly(direction, mesh.cells, defined, rule, 0.5))


def test_unknown_rule_is_refused() -> None:
    with pytest.raises(InputError, match="any, majority, all, none"):
        incompatible(np.zeros((1, 3)), np.zeros((1, 4), int), np.ones(1, bool), "most")
