"""Files that VTK reads: grids and surfaces, to plain arrays."""

import copy
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

_FACETS = {5: 3, 22: 6, 9: 4, 23: 8, 28: 9}
_SOLIDS = {10: 4, 24: 10, 14: 5, 27: 13, 13: 6, 26: 15, 32: 18, 11: 8, 12: 8, 25: 20, 29: 27}
_NODES = {**_FACETS, **_SOLIDS}
"""Nodes of the cells whose nodes are wanted, by VTK's number of their type."""
_LAGRANGE = {
    (69, 3): 5,
    (69, 6): 22,
    (70, 4): 9,
    (71, 4): 10,
    (71, 10): 24,
    (72, 8): 12,
    (73, 6): 13,
    (74, 5): 14,
}
"""Types of the same cells, by that of Lagrange cells, as DOLFINx writes them, and their nodes."""


def read_grid(path: str) -> dict[str, Any]:
    """Points, types and nodes of cells, and data of an unstructured grid (.vtu, .vtk).

    Names are ``points``, ``types``, ``cells:TYPE``, ``point:NAME``, ``cell:NAME``, ``field:NAME``,
    and ``components:point:NAME`` where components have names.
    """
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOLegacy import vtkUnstructuredGridReader
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    if path.lower().endswith(".vtk"):
        legacy = vtkUnstructuredGridReader()
        for attribute in ("Scalars", "Vectors", "Tensors", "Fields"):
            getattr(legacy, f"ReadAll{attribute}On")()  # it reads the first of each otherwise
        grid = _output(legacy, path)
    else:
        grid = _output(vtkXMLUnstructuredGridReader(), path)
    if grid.GetPoints() is None or not grid.GetNumberOfCells():
        raise ValueError("no points or no cells")
    arrays: dict[str, Any] = {"points": vtk_to_numpy(grid.GetPoints().GetData())}
    types = vtk_to_numpy(grid.GetCellTypesArray()).copy()
    offsets = vtk_to_numpy(grid.GetCells().GetOffsetsArray()).astype(np.int64)
    nodes = vtk_to_numpy(grid.GetCells().GetConnectivityArray()).astype(np.int64)
    if len(offsets) != len(types) + 1:
        raise ValueError("cells do not fit their types")
    for (kind, count), same in _LAGRANGE.items():
        types[(types == kind) & (np.diff(offsets) == count)] = same
    arrays["types"] = types
    for kind in np.unique(types).tolist():
        arrays[f"cells:{kind}"] = _node_table(nodes, offsets, types == kind, _NODES.get(kind, 0))
    for where, data in (
        ("point", grid.GetPointData()),
        ("cell", grid.GetCellData()),
        ("field", grid.GetFieldData()),
    ):
        for k in range(data.GetNumberOfArrays()):
            array = data.GetAbstractArray(k)
            name = f"{where}:{array.GetName()}"
            if not hasattr(array, "GetComponentName") or array.IsA("vtkStringArray"):
                arrays[name] = np.array(
                    [array.GetValue(i) for i in range(array.GetNumberOfValues())]
                )
                continue
            arrays[name] = vtk_to_numpy(array)
            names = [array.GetComponentName(i) or "" for i in range(array.GetNumberOfComponents())]
            if any(names):
                arrays[f"components:{name}"] = np.array(names)
    return arrays


def read_xdmf(path: str, step: int = 1) -> dict[str, Any]:
    """Points, types, nodes and data of the cells of an XDMF file, as `read_grid`.

    Of a series one step counts, from 1; ``steps`` is how many it has. Data of all grids of the same
    points and cells, as DOLFINx writes functions beside their mesh, come together. Grids of facets
    on the same points, as it writes their tags, join that of the solids; their numbers become the
    cell array ``patch``.
    """
    import pyvista
    from vtkmodules.vtkIOXdmf2 import vtkXdmfReader

    reader = vtkXdmfReader()
    plain, steps = _plain_xdmf(path, step)
    _output(reader, plain)
    output = reader.GetOutputDataObject(0)
    whole = not output.IsA("vtkMultiBlockDataSet")
    blocks = [output] if whole else [output.GetBlock(k) for k in range(output.GetNumberOfBlocks())]
    blocks = [block for block in blocks if block is not None and block.IsA("vtkUnstructuredGrid")]
    grids = [_grid_arrays(block) for block in blocks]
    volumes = [k for k, grid in enumerate(grids) if set(_SOLIDS) & set(grid["types"].tolist())]
    if not volumes:
        raise ValueError("no grid of cells with a volume")
    main = grids[volumes[0]]
    for other in (grids[k] for k in volumes[1:]):
        if len(other["points"]) == len(main["points"]) and len(other["types"]) == len(
            main["types"]
        ):
            data = {key: a for key, a in other.items() if key.startswith(("point:", "cell:"))}
            main = {**data, **main}
    main["steps"] = np.array(steps)
    for k, grid in enumerate(grids):
        cells = {name: nodes for name, nodes in grid.items() if name.startswith("cells:")}
        if k in volumes or not set(cells) <= {f"cells:{kind}" for kind in _FACETS}:
            continue
        if len(grid["points"]) != len(main["points"]):
            raise ValueError("its grids do not share their points")
        arrays = pyvista.wrap(blocks[k]).cell_data.values()
        numbers = next((a for a in arrays if a.dtype.kind in "iu" and a.ndim == 1), None)
        before = main.get("cell:patch", np.zeros(len(main["types"]), dtype=np.int64))
        added = np.zeros(len(grid["types"]), dtype=np.int64) if numbers is None else numbers
        main["cell:patch"] = np.concatenate([before, added])
        main["types"] = np.concatenate([main["types"], grid["types"]])
        for name, nodes in cells.items():
            main[name] = np.concatenate([main[name], nodes]) if name in main else nodes
    return main


def _grid_arrays(grid: Any) -> dict[str, Any]:
    """Points, types and nodes of the cells of a grid, whose arrays may be implicit ones."""
    import pyvista

    seen = pyvista.wrap(grid)
    cells = {f"cells:{kind}": nodes for kind, nodes in seen.cells_dict.items()}
    for where, data in (("point", seen.point_data), ("cell", seen.cell_data)):
        cells |= {f"{where}:{name}": np.asarray(data[name]) for name in data}
    return {"points": np.asarray(seen.points), "types": np.asarray(seen.celltypes), **cells}


def _plain_xdmf(path: str, step: int) -> tuple[str, int]:
    """Copy of an XDMF file in the folder of this process, and the number of steps of its series.

    What VTK cannot follow is put in its place: inclusions of the geometry and topology of another
    grid, all steps but one, and relative names of the files that hold the numbers.
    """
    steps = 1
    root = ElementTree.parse(path).getroot()
    parents = {child: parent for parent in root.iter() for child in parent}
    for series in root.iter("Grid"):
        if series.get("CollectionType") == "Temporal":
            known = series.findall("Grid")
            steps = max(steps, len(known))
            if step > len(known):
                raise ValueError(f"its series has {len(known)} steps, and no step {step}")
            for other in (grid for k, grid in enumerate(known, 1) if k != step):
                series.remove(other)
    for element in list(root.iter()):
        if not element.tag.endswith("}include"):
            continue
        grid, at = parents[element], list(parents[element]).index(element)
        grid.remove(element)
        for name in ("Topology", "Geometry"):
            source = root.find(f".//Grid/{name}") if name in element.get("xpointer", "") else None
            if source is not None:
                grid.insert(at, copy.deepcopy(source))
    for item in root.iter("DataItem"):
        if item.get("Format") == "HDF" and item.text:
            file, _, place = item.text.strip().rpartition(":")
            item.text = f"{Path(path).resolve().parent / file}:{place}"
    ElementTree.ElementTree(root).write("copy.xdmf")
    return "copy.xdmf", steps


def _node_table(
    nodes: NDArray[Any], offsets: NDArray[Any], chosen: NDArray[Any], count: int
) -> NDArray[Any]:
    """Nodes (m, count) of the chosen cells; of types whose nodes are not wanted, (m, 0)."""
    start, stop = offsets[:-1][chosen], offsets[1:][chosen]
    if count and (stop - start != count).any():
        raise ValueError("cells have the wrong number of nodes")
    return nodes[start[:, None] + np.arange(count)]


def read_surface(path: str) -> dict[str, Any]:
    """Points and triangles of a surface (.stl, .obj, .ply)."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkFiltersCore import vtkTriangleFilter
    from vtkmodules.vtkIOGeometry import vtkOBJReader, vtkSTLReader
    from vtkmodules.vtkIOPLY import vtkPLYReader

    make = {"stl": vtkSTLReader, "obj": vtkOBJReader, "ply": vtkPLYReader}[path[-3:].lower()]
    surface = _output(make(), path)
    cut = vtkTriangleFilter()
    cut.PassVertsOff()
    cut.PassLinesOff()
    cut.SetInputData(surface)
    cut.Update()
    surface = cut.GetOutput()
    if surface.GetPoints() is None or not surface.GetNumberOfPolys():
        raise ValueError("it holds no triangles")
    triangles = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    if triangles.min() < 0 or triangles.max() >= surface.GetNumberOfPoints():
        raise ValueError("a triangle names a point that is not there")
    return {
        "points": vtk_to_numpy(surface.GetPoints().GetData()).astype(np.float64),
        "triangles": triangles.astype(np.int64),
    }


def _output(reader: Any, path: str) -> Any:
    """Return what a reader makes of a file; its complaints are exceptions."""
    complaints: list[str] = []
    reader.AddObserver("ErrorEvent", lambda *_: complaints.append(""))
    reader.SetFileName(path)
    reader.Update()
    if complaints or reader.GetErrorCode():
        raise ValueError("VTK cannot make sense of it")
    return reader.GetOutput()
