"""Page of the Python interface: what `import ccfem` offers, and the packages behind it."""

import importlib

import ccfem

__all__ = ["python_page"]

_HEAD = """# Python

`import ccfem` offers the functions of the flow; what they take and give lives in packages by name,
which need no import of their own: `ccfem.fem.elasticity.Force`, `ccfem.strategies.Isocurve`. Units
are mm, N and MPa; angles are degrees.

"""

_PACKAGES = {
    "fem.elasticity": "Problems, supports, loads and stress",
    "body.mesh": "Meshes and patches",
    "fem.materials": "Materials",
    "slicing.layers": "Layers",
    "machine": "Machine",
    "paths.toolpaths": "Paths",
    "fem.topopt": "Topology optimisation",
    "printing.export.gcode": "G-code",
    "printing.export.waypoints": "Waypoints",
    "printing.export.vtk": "Files for ParaView",
}


def python_page() -> str:
    """Write a section for the public face and one for each package that users meet."""
    face = "".join(_entry(ccfem, name, 3) for name in ccfem.__all__)
    rooms = "".join(_room(name, title) for name, title in _PACKAGES.items())
    return f"{_HEAD}## The flow\n\n{face}{rooms}"


def _room(name: str, title: str) -> str:
    module = importlib.import_module(f"ccfem.{name}")
    public = getattr(module, "__all__", None) or _defined(module)
    entries = [_entry(module, member, 3) for member in public if _documented(module, member)]
    return f"## {title}: `ccfem.{name}` {{ #{name.replace('.', '-')} }}\n\n" + "".join(entries)


def _defined(module: object) -> list[str]:
    """Public functions and classes that a module defines itself."""
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith("_") and getattr(value, "__module__", "") == module.__name__  # type: ignore[attr-defined]
    ]


def _documented(module: object, name: str) -> bool:
    """Whether a name is a function or class of this project, and not on the page already."""
    home = getattr(getattr(module, name), "__module__", "")
    return home.startswith("ccfem") and not hasattr(ccfem, name)


def _entry(module: object, name: str, level: int) -> str:
    found = getattr(module, name)
    shown = f"{module.__name__}.{name}"  # type: ignore[attr-defined]
    return (
        f"::: {found.__module__}.{found.__qualname__}\n    options:\n"
        f"      heading: {shown}\n      toc_label: {name}\n      heading_level: {level}\n\n"
    )
