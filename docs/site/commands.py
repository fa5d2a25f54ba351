"""Page of the commands: what `ccfem COMMAND --help` says."""

from typing import Any

import typer
from table import table

from ccfem.cli.commands import app

__all__ = ["commands_page"]

_HEAD = """# Commands

Every command answers `--help`. Bad input ends in one line with the cure and exit code 2; nothing
half-written is left behind. Lengths are mm, forces N, stresses MPa.

"""


def commands_page() -> str:
    """Write a section for each command, with its arguments and options."""
    group: Any = typer.main.get_command(app)
    return _HEAD + "".join(_section(name, each) for name, each in group.commands.items())


def _section(name: str, command: Any) -> str:
    arguments = [each for each in command.params if each.param_type_name == "argument"]
    options = [each for each in command.params if each.param_type_name == "option"]
    words = [each.metavar or each.name.upper() for each in arguments]
    shown = [w if a.required else f"[{w}]" for w, a in zip(words, arguments, strict=True)]
    usage = " ".join(["ccfem", name, *shown])
    text = f"## {name}\n\n    {usage}{' [options]' if options else ''}\n\n{command.help}\n\n"
    text += f"{command.epilog}\n\n" if command.epilog else ""
    rows = [(f"`{word}`", "", each.help or "") for word, each in zip(words, arguments, strict=True)]
    rows += [(_flags(each), _default(each), each.help or "") for each in options]
    return text + (table(("argument or option", "default", "meaning"), rows) if rows else "")


def _flags(option: Any) -> str:
    value = "" if option.is_flag else f" {option.metavar or option.name.upper()}"
    return ", ".join(f"`{flag}{value}`" for flag in (*option.opts, *option.secondary_opts))


def _default(option: Any) -> str:
    if option.required:
        return "needed"
    return "" if option.default in (None, False, ()) else f"`{option.default}`"
