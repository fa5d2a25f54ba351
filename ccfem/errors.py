"""The two ways in which ccfem refuses to go on."""

__all__ = ["InputError", "SolveError"]


class InputError(ValueError):
    """Input that nothing sensible can follow from.

    The message is one line that says what was expected, what came and the cure; the command line
    prints it and exits with code 2.
    """


class SolveError(RuntimeError):
    """A solve that missed its tolerance; the message names the backend and the residual."""
