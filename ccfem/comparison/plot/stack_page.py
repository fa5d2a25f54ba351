"""Curved layers and the fibre on them in space: a picture, and a page on which they turn."""

import json
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from ccfem.base.arrays import FloatArray
from ccfem.geometry.polylines import resample
from ccfem.paths.toolpaths import FIBRE, Toolpaths
from ccfem.slicing.layers.layer import Layer

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_VIEWS = ((25.0, -35.0), (5.0, 0.0), (70.0, 0.0))
"""Elevation and azimuth, degrees, of each view."""
_STEP = 1.5
"""Distance of the points that are drawn, mm."""


def _axes_up(points: FloatArray, up: FloatArray) -> FloatArray:
    """Points with a direction turned to the third axis."""
    axis = int(np.argmax(np.abs(up)))
    return np.roll(points, 2 - axis, axis=-1) if up[axis] > 0.0 else points


def _lines(layers: Sequence[Layer], paths: Toolpaths) -> list[tuple[int, FloatArray]]:
    """Strands, thinned out, with the place of their layer in the stack."""
    place = {layer.index: k for k, layer in enumerate(layers)}
    fibre = paths.of_kind(FIBRE)
    points, offsets = resample(fibre.points, fibre.offsets, _STEP)
    lines = np.split(points, offsets[1:-1]) if len(fibre) else []
    return [(place[int(k)], line) for k, line in zip(fibre.layer, lines, strict=True)]


def space_picture(
    layers: Sequence[Layer],
    paths: Toolpaths,
    title: str = "",
    build: Sequence[float] = (0.0, 0.0, 1.0),
) -> "Figure":
    """Draw the strands in space from three sides, coloured from the first layer to the last.

    Parameters
    ----------
    layers : sequence of Layer
        Their borders are drawn in grey.
    build : sequence of 3 floats
        Upwards in the picture.
    """
    from matplotlib import colormaps
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    up = np.asarray(build, dtype=np.float64)
    lines = _lines(layers, paths)
    borders = [
        _axes_up(layer.points[np.append(loop, loop[:1])], up)
        for layer in layers[:: max(1, len(layers) // 30)]
        for loop in layer.loops
    ]
    colours = colormaps["viridis"](np.linspace(0.0, 0.95, max(len(layers), 2)))
    strands = [_axes_up(line, up) for _, line in lines]
    shades = [colours[k] for k, _ in lines]
    everything = np.concatenate([*borders, *strands])
    low, high = everything.min(axis=0), everything.max(axis=0)
    figure = Figure(figsize=(13.5, 5.0))
    FigureCanvasAgg(figure)
    for number, (elevation, azimuth) in enumerate(_VIEWS):
        axes = figure.add_subplot(1, len(_VIEWS), number + 1, projection="3d")
        axes.add_collection3d(Line3DCollection(borders, colors="0.75", linewidths=0.4))
        axes.add_collection3d(Line3DCollection(strands, colors=shades, linewidths=0.7))
        axes.set_proj_type("ortho")
        axes.view_init(elevation, azimuth)
        axes.set_box_aspect(np.maximum(high - low, 1e-3), zoom=0.98)
        for axis, a, b in zip("xyz", low, high, strict=True):
            getattr(axes, f"set_{axis}lim")(a, max(b, a + 1e-3))
        axes.set_axis_off()
    figure.suptitle(title)
    figure.subplots_adjust(0.0, 0.0, 1.0, 0.95, 0.0, 0.0)
    return figure


def turning_page(
    layers: Sequence[Layer],
    paths: Toolpaths,
    title: str,
    build: Sequence[float] = (0.0, 0.0, 1.0),
) -> str:
    """Write a page, complete in itself, on which the strands turn under the mouse.

    Parameters
    ----------
    build : sequence of 3 floats
        Upwards at the start.

    Returns
    -------
    str
        HTML. A slider cuts the stack off at a layer; dragging turns, the wheel zooms.
    """
    up = np.asarray(build, dtype=np.float64)
    place = {layer.index: k for k, layer in enumerate(layers)}
    rims = [
        (place[layer.index], _axes_up(layer.points[np.append(loop, loop[:1])], up))
        for layer in layers[:: max(1, len(layers) // 30)]
        for loop in layer.loops
    ]
    strands = [(k, _axes_up(line, up)) for k, line in _lines(layers, paths)]
    data = {
        name: [[k, line.round(2).tolist()] for k, line in lines]
        for name, lines in (("strands", strands), ("rims", rims))
    }
    text = json.dumps({**data, "count": len(layers)}, separators=(",", ":"))
    return _PAGE.replace("@TITLE@", escape(title)).replace("@DATA@", text)


_PAGE = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>@TITLE@</title>
<style>body{margin:0;font:14px sans-serif;background:#fff}canvas{display:block}
#bar{position:fixed;left:12px;top:10px}</style></head><body>
<div id="bar"><b>@TITLE@</b><br>
layers up to <input id="top" type="range" min="1"> <span id="said"></span></div>
<canvas id="view"></canvas><script>
const data=@DATA@,view=document.getElementById("view"),pen=view.getContext("2d"),
top_=document.getElementById("top"),said=document.getElementById("said");
top_.max=data.count;top_.value=data.count;
let low=[1e9,1e9,1e9],high=[-1e9,-1e9,-1e9];
for(const [k,line] of data.strands.concat(data.rims))for(const p of line)for(let i=0;i<3;i++){
low[i]=Math.min(low[i],p[i]);high[i]=Math.max(high[i],p[i]);}
const mid=low.map((v,i)=>(v+high[i])/2),half=low.map((v,i)=>(high[i]-v)/2);
let turn=-0.6,tilt=0.5,zoom=1;
const wide=Math.cos(turn)*half[0]-Math.sin(turn)*half[1],
deep=-Math.sin(turn)*half[0]+Math.cos(turn)*half[1],
tall=Math.cos(tilt)*half[2]+Math.sin(tilt)*deep;
function draw(){view.width=innerWidth;view.height=innerHeight;
const s=zoom*0.46*Math.min(view.width/wide,(view.height-60)/tall),ct=Math.cos(turn),
st=Math.sin(turn),ce=Math.cos(tilt),se=Math.sin(tilt),limit=+top_.value;
function at(p){const x=p[0]-mid[0],y=p[1]-mid[1],z=p[2]-mid[2],u=ct*x-st*y,v=st*x+ct*y;
return[view.width/2+s*u,view.height/2+25-s*(ce*z+se*v)];}
function stroke(line,colour,width){pen.strokeStyle=colour;pen.lineWidth=width;pen.beginPath();
line.forEach((p,i)=>{const q=at(p);i?pen.lineTo(q[0],q[1]):pen.moveTo(q[0],q[1]);});pen.stroke();}
for(const [k,line] of data.rims)if(k<limit)stroke(line,"#aaa",0.7);
for(const [k,line] of data.strands)if(k<limit)
stroke(line,"hsl("+(260-220*k/data.count)+",70%,42%)",1);
said.textContent=limit+" of "+data.count;}
let held=null;
view.onmousedown=e=>{held=[e.clientX,e.clientY];};
onmouseup=()=>{held=null;};
onmousemove=e=>{if(!held)return;turn+=(e.clientX-held[0])/200;tilt+=(e.clientY-held[1])/200;
held=[e.clientX,e.clientY];draw();};
view.onwheel=e=>{zoom*=Math.exp(-e.deltaY/800);draw();e.preventDefault();};
top_.oninput=draw;onresize=draw;draw();
</script></body></html>
"""
