"""Formulas in x, y and z, read from files: arithmetic alone, nothing is executed."""

import ast
import operator
import warnings
from collections.abc import Callable, Mapping

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.base.errors import InputError, shown

_FUNCTIONS: Mapping[str, Callable[..., FloatArray]] = {
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "abs": np.abs,
    "min": np.minimum,
    "max": np.maximum,
}
_TWO = ("min", "max")
_OPERATORS: Mapping[type, Callable[..., FloatArray]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_LONGEST = 1000
"""Characters of a formula that are read."""


def check_formula(text: str) -> None:
    """Refuse what is no formula.

    Raises
    ------
    InputError
        For anything but numbers, x, y, z, pi, ``+ - * / **``, brackets and the functions sqrt, exp,
        log, sin, cos, tan (of radians), abs, min and max (of two).
    """
    _evaluated(text, dict.fromkeys("xyz", np.ones(1)))


def formula_values(text: str, points: FloatArray) -> FloatArray:
    """Values (n,) of a formula at points (n, 3), mm.

    Raises
    ------
    InputError
        As `check_formula`, and where a value is not finite.

    Examples
    --------
    >>> formula_values("sqrt(x**2 + y**2) + z", np.array([[3.0, 4.0, 1.0]]))
    array([6.])
    """
    names = dict(zip("xyz", np.asarray(points, dtype=np.float64).T, strict=True))
    with np.errstate(all="ignore"):
        values = np.broadcast_to(_evaluated(text, names), len(points)).copy()
    if not np.isfinite(values).all():
        at = points[np.flatnonzero(~np.isfinite(values))[0]].tolist()
        raise InputError(
            f"the formula {shown(text)} has no finite value at {at} mm: write one that has"
        )
    return values


def _evaluated(text: str, names: Mapping[str, FloatArray]) -> FloatArray:
    """Value of a formula."""
    try:
        return _value(_parsed(text), names, text)
    except RecursionError:
        raise _no_formula(text, text) from None


def _parsed(text: str) -> ast.expr:
    """Tree of a formula."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # what is no formula is refused anyway
            if len(text) > _LONGEST:
                raise ValueError
            return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        pass
    raise _no_formula(text, text)


def _value(node: ast.expr, names: Mapping[str, FloatArray], text: str) -> FloatArray:
    """Value of a part of a formula."""
    match node:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            if abs(number) < 1e300:
                return np.float64(number)  # type: ignore[return-value]
        case ast.Name(id="pi"):
            return np.float64(np.pi)  # type: ignore[return-value]
        case ast.Name(id=name) if name in names:
            return names[name]
        case ast.UnaryOp(op=op, operand=inner) if type(op) in _OPERATORS:
            return _OPERATORS[type(op)](_value(inner, names, text))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
            with np.errstate(all="ignore"):
                return _OPERATORS[type(op)](_value(left, names, text), _value(right, names, text))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if (
            name in _FUNCTIONS and len(arguments) == 1 + (name in _TWO)
        ):
            with np.errstate(all="ignore"):
                return _FUNCTIONS[name](*(_value(inner, names, text) for inner in arguments))
    raise _no_formula(text, ast.unparse(node))


def _no_formula(text: str, wrong: str) -> InputError:
    return InputError(
        f"a formula has numbers, x, y, z, pi, + - * / ** and {', '.join(_FUNCTIONS)}; got "
        f"{shown(wrong)} in {shown(text)}: write it with these, as 'sqrt(x**2 + y**2) + z'"
    )
