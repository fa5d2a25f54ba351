"""How functions are compiled."""

from collections.abc import Callable
from typing import Any

from numba import njit


def compiled(
    function: Callable[..., Any] | None = None, *, fastmath: object = False, inline: str = "never"
) -> Any:
    """Compile a function of numbers and arrays when it is first called, and store it.

    All are compiled alike: numba compiles functions of its own, as ``np.empty``, anew for each set
    of options that their callers have. Entries for callers in C are left out, since nobody calls
    them. The function runs without Python's lock: what it writes belongs to its caller alone.

    Parameters
    ----------
    function : callable
        With at most eight parameters, working number by number.
    fastmath : bool or set of str, default False
        What may be rearranged in sums, as of numba.
    inline : {"never", "always"}
        Whether it becomes a part of its callers before they are compiled.
    """
    decorate = njit(cache=True, nogil=True, no_cfunc_wrapper=True, fastmath=fastmath, inline=inline)
    return decorate if function is None else decorate(function)
