"""Drawings of layers: read again by other programs, with their lengths and areas in mm."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from ccfem.base.errors import InputError
from ccfem.body.mesh.box import box_mesh
from ccfem.paths.toolpaths import Toolpaths
from ccfem.printing.export.layer_drawings import draw_layer
from ccfem.slicing.slicers import Planar

(LAYER,) = Planar(count=1).cut(box_mesh((80.0, 60.0, 4.0), (8, 6, 1)), (0.0, 1.0, 0.0))
LINE = np.array([[10.0, 1.0], [20.0, 1.0], [20.0, -9.0], [10.0, -9.0]])
LINK = np.array([False, True, False, False])
PATHS = Toolpaths.from_plane([LINE], LAYER, link=[LINK])


def length(points):
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def test_svg_is_to_scale(tmp_path):
    draw_layer(PATHS, LAYER, 0.8, tmp_path / "a.svg")
    root = ET.parse(tmp_path / "a.svg").getroot()
    ends = np.array([LAYER.plane.points.min(axis=0), LAYER.plane.points.max(axis=0)])
    ends = np.array([np.minimum(ends[0], LINE.min(axis=0)), np.maximum(ends[1], LINE.max(axis=0))])
    box = np.array(root.get("viewBox").split(), dtype=float)
    np.testing.assert_allclose(box[2:], np.ptp(ends, axis=0) + 4.0)
    assert root.get("width") == f"{box[2]:.4f}mm"
    drawn = {}
    for group in root:
        lines = [
            np.array([pair.split(",") for pair in each.get("points").split()], dtype=float)
            for each in group
        ]
        drawn[group.get("id")] = lines
        for line in lines:
            assert (line >= box[:2] - 1e-9).all()
            assert (line <= box[:2] + box[2:] + 1e-9).all()
    assert [length(line) for line in drawn["fibre"]] == pytest.approx([10.0, 10.0])
    assert [length(line) for line in drawn["link"]] == pytest.approx([10.0])
    assert sum(map(length, drawn["border"])) == pytest.approx(2.0 * (80.0 + 4.0))
    np.testing.assert_allclose(drawn["fibre"][0], [[10.0, -1.0], [20.0, -1.0]])  # y downwards


def test_dxf_is_read_by_another_program(tmp_path):
    ezdxf = pytest.importorskip("ezdxf")
    draw_layer(PATHS, LAYER, 0.8, tmp_path / "a.dxf")
    drawing = ezdxf.readfile(tmp_path / "a.dxf")
    assert drawing.dxfversion == "AC1009"
    assert not drawing.audit().errors
    drawn = {name: [] for name in ("BORDER", "FIBRE", "LINK")}
    for each in drawing.modelspace().query("POLYLINE"):
        drawn[each.dxf.layer].append(np.array([(p.x, p.y) for p in each.points()]))
    np.testing.assert_allclose(drawn["FIBRE"][1], LINE[2:])
    assert [length(line) for line in drawn["LINK"]] == pytest.approx([10.0])
    assert sum(map(length, drawn["BORDER"])) == pytest.approx(2.0 * (80.0 + 4.0))


def test_what_cannot_be_drawn_is_said(tmp_path):
    with pytest.raises(InputError, match=r"as \.svg or \.dxf; got"):
        draw_layer(PATHS, LAYER, 0.8, tmp_path / "a.png")
    with pytest.raises(InputError, match="layer 0 is curved"):
        draw_layer(PATHS, replace(LAYER, flat=None), 0.8, tmp_path / "a.svg")
    draw_layer(Toolpaths.empty(), LAYER, 0.8, tmp_path / "empty.svg")
