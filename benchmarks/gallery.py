"""Draw the pictures of the documentation: cases, strategies on the loop, turns, and a trade.

Run ``python -m benchmarks.gallery`` whenever a case or a strategy changes; it takes minutes. Names
after it draw only those: ``python -m benchmarks.gallery loop isocurve``.
"""

import io
import sys
from pathlib import Path

from PIL import Image

import ccfem
from benchmarks.studies.confirmed_gain import LAYERS, posed
from ccfem.base.errors import InputError
from ccfem.cases import named_cases
from ccfem.comparison.front_plans import fibre_front
from ccfem.comparison.plot.canvas import png
from ccfem.comparison.plot.fields import tension_picture
from ccfem.comparison.plot.part_picture import part_picture
from ccfem.comparison.plot.paths import layer_picture
from ccfem.machine.machine import Machine
from ccfem.paths.planning import plan
from ccfem.slicing.layers.layer import stress_on
from ccfem.slicing.slicers.planar import Planar
from ccfem.strategies import create, named

PICTURES = Path(__file__).resolve().parents[1] / "docs" / "pictures"


def write(figure, path: Path) -> None:
    """Write a figure with 64 colours, which pictures of few colours do not miss."""
    path.parent.mkdir(parents=True, exist_ok=True)
    picture = Image.open(io.BytesIO(png(figure, dpi=110))).convert("RGB")
    picture.quantize(64).save(path, optimize=True)
    print(f"{path.relative_to(PICTURES)}  {path.stat().st_size / 1e3:.0f} kB", flush=True)


def draw_cases(chosen: set[str]) -> None:
    """Draw every case with its patches and loads."""
    for name in sorted(named_cases()):
        if not chosen or name in chosen:
            write(part_picture(ccfem.check(name)), PICTURES / "cases" / f"{name}.png")


def draw_strategies(chosen: set[str]) -> None:
    """Draw the tension in the middle layer of the loop, and every strategy's paths there."""
    case = ccfem.read("loop")
    stress = ccfem.solve(case.problem)["pull"]
    layers = Planar(count=1).cut(case.problem.mesh, case.build)
    on_layer = stress_on(layers[0], stress)
    if not chosen or "tension" in chosen:
        write(tension_picture(on_layer), PICTURES / "tension.png")
    for name in sorted(named()):
        if chosen and name not in chosen:
            continue
        try:
            paths = plan(create(name), layers, stress, case.machine)
        except InputError as error:
            print(f"{name}: {error}", flush=True)
            continue
        figure = layer_picture(layers[0], on_layer, paths, case.machine.fibre_width)
        write(figure, PICTURES / "strategies" / f"{name}.png")


def draw_turns(chosen: set[str]) -> None:
    """Draw a bracket's fibre with tight turns, and where these are cut."""
    if chosen and "turns" not in chosen:
        return
    stress, machine = ccfem.solve(posed("bracket"))["planned"], Machine()
    layers = Planar(count=LAYERS).cut(stress.mesh)
    for turns in ("tight", "cut"):
        strategy = create("stream_function", {"turns": turns})
        paths = plan(strategy, layers, stress, machine).on_layer(0)
        on_layer = stress_on(layers[0], stress)
        figure = layer_picture(layers[0], on_layer, paths, machine.fibre_width)
        write(figure, PICTURES / "turns" / f"{turns}.png")


def draw_trade(chosen: set[str]) -> None:
    """Draw what strength costs in stiffness on the loop; takes longest of all."""
    if chosen and "trade" not in chosen:
        return
    case = ccfem.read("loop")
    front = fibre_front(
        case,
        ccfem.solve(case.problem)["pull"],
        "stream_function",
        create("stream_function"),
        (12,),
        points=4,
        strengths=(0.0, 0.2, 0.4, 0.6),
    )
    write(front.plot_trade(), PICTURES / "trade.png")


if __name__ == "__main__":
    draw_cases(set(sys.argv[1:]))
    draw_strategies(set(sys.argv[1:]))
    draw_turns(set(sys.argv[1:]))
    draw_trade(set(sys.argv[1:]))
