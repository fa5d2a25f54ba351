"""The tab for runs: strategies to tick, progress and stop, the table, and strands by layer."""

import inspect
import mimetypes
import shlex
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from ccfem import strategies as strategy_modules
from ccfem.base.arrays import BoolArray, FloatArray, IntArray
from ccfem.base.errors import InputError
from ccfem.comparison.plot.colours import OUTLINE, gradient, rgb
from ccfem.comparison.report.print_view import BESIDE, COLOURS, FILLS, KINDS, MOVES
from ccfem.comparison.report.report_views import PrintLayer, RunResults, read_results, read_solution
from ccfem.comparison.request import STRATEGIES
from ccfem.paths.planning.strategy import Strategy
from ccfem.printing.support import propped_space
from ccfem.slicing.slicers.planar import Planar
from ccfem.workbench.bench import Opened
from ccfem.workbench.child_run import ChildRun, RunState
from ccfem.workbench.drawing import draw_label, draw_lines, linear
from ccfem.workbench.guard import Served, escaped
from ccfem.workbench.tab import FIBRE, MOVED, PART, PRINT, STRESS, Choice, Field, Tabbed

_NO_ONE, _FIRST, _ALL = "none", "the first", "all at once"
_PLAN, _BED = "G-code of the ticked strategy", "G-code of all parts in one file"
_BODY = "Support as STL"
Begun = tuple[str, list[str], str, str]
"""What is run: a command, its options, the end of the name of its results, the view of them."""
_BESIDE = 1.25
"""Distance of two strategies side by side, in widths of the part."""
_LINE = 0.6
"""Width of a drawn strand over the fibre width, so that neighbours stay apart."""


class CompareTab:
    """Runs in a process of their own, and what they found."""

    def __init__(self, page: Tabbed) -> None:
        self.page, gui = page, page.server.gui
        self.run: ChildRun | None = None
        self.results: RunResults | None = None
        self._ran = ""
        known = strategy_modules.named()
        self.ticks: dict[str, Field] = {}
        with gui.add_folder("Strategies"):
            self._add_ticks({name: known[name] for name in STRATEGIES})
        with gui.add_folder("More strategies", expand_by_default=False):
            self._add_ticks({k: v for k, v in known.items() if k not in STRATEGIES})
        case = gui.add_dropdown("Load case", (_FIRST,), visible=False)
        self.case = Field(page, case, lambda _: self.show())
        minutes = gui.add_number("Longest run, min", 120.0, min=0.1, step=10.0)
        self.minutes = Field(page, minutes)
        support = gui.add_checkbox("Print support", False)
        self.support = Field(page, support, lambda _: page.show())
        with gui.add_folder("With other parts on the bed", expand_by_default=False):
            self.offered = Choice(page, "Add a part", _NO_ONE, self._add_part)
            self.others = Field(page, gui.add_text("Other parts", ""), self._show_commands)
        self._begins: dict[str, Callable[[], Begun]] = {
            "Solve": self._solve,
            "Compare": self._compare,
            _PLAN: lambda: self._plan(self._only()),
            _BED: self._bed,
            _BODY: self._support,
        }
        self.starts = {name: gui.add_button(name, icon="player-play") for name in self._begins}
        for name, begin in self._begins.items():
            self.starts[name].on_click(page.on(partial(self._begin, begin)))
        self.ending = gui.add_button("Stop", icon="player-stop", visible=False, color="red")
        self.ending.on_click(page.on(self.stop))
        self.bar = gui.add_progress_bar(0.0, visible=False)
        self._said = gui.add_html("")
        old = "<p class='ccfem'><b>These results are of the part before it was changed.</b></p>"
        self._old = gui.add_html(old, visible=False)
        self._table = gui.add_html("", visible=False)
        self._found = gui.add_folder("Layers", visible=False)
        with self._found:
            left, right = (gui.add_dropdown(t, (_NO_ONE,)) for t in ("Strategy", "Beside it"))
            self.left, self.right = (
                Field(page, h, lambda _: self._redraw()) for h in (left, right)
            )
            self.layer = gui.add_slider("Layer", 0, 1, 1, 0)  # the newest place, not all between
            self.layer.on_update(page.on(self._draw))
            self.top = gui.add_slider("Printed up to", 0, 1, 1, 0, visible=False)
            self.alone = gui.add_checkbox("This layer alone", False, visible=False)
            self.travel = gui.add_checkbox("Moves and lifts", False, visible=False)
            for field in (self.top, self.alone, self.travel):
                field.on_update(page.on(self._show_print))
            self._layer_said = gui.add_html("")
            self.prints = gui.add_button("G-code of this strategy", icon="printer")
            self.prints.on_click(page.on(self._begin, lambda: self._plan(self.left.value)))
        self._links, self._command = gui.add_html(""), gui.add_html("")
        self._handles: list[Any] = []
        self._more: dict[str, Path] = {}
        self._body: tuple[Any, ...] = ("",)
        self.printed: list[PrintLayer] = []

    def _add_ticks(self, known: Mapping[str, type[Strategy]]) -> None:
        gui, lines = self.page.server.gui, []
        for name, strategy in known.items():
            about = (inspect.getdoc(strategy) or "").split("\n")[0]
            tick = gui.add_checkbox(name, name in STRATEGIES, hint=about)
            self.ticks[name] = Field(self.page, tick, lambda _: self.show())
            lines.append(f"<li><b>{name}</b> {escaped(about)}</li>")
        summary = f"<summary>What they do</summary><ul>{''.join(lines)}</ul>"
        gui.add_html(f'<details class="ccfem">{summary}</details>')

    # Running.

    @property
    def _running(self) -> bool:
        return self.run is not None and self.run.state.running

    def _ticked(self) -> list[str]:
        return [name for name, tick in self.ticks.items() if tick.value]

    def _only(self) -> str:
        """Return the one strategy that is ticked."""
        names = self._ticked()
        if len(names) != 1:
            raise InputError("a plan is of one strategy: tick one alone")
        return names[0]

    def _load_case(self) -> list[str]:
        if not self.case.handle.visible or self.case.value == _FIRST:
            return []
        return ["--load-case", "all" if self.case.value == _ALL else self.case.value]

    # What each button runs.

    def _solve(self) -> Begun:
        if self.case.value == _ALL:
            raise InputError("one load case is shown: choose one")
        first = ["--load-case", self.case.handle.options[1]] if self.case.handle.visible else []
        return "solve", self._load_case() or first, "-solved.vtu", STRESS

    def _compare(self) -> Begun:
        names = self._ticked()
        if not names:
            raise InputError("no strategy is ticked: tick one or more")
        chosen = [] if set(names) == set(STRATEGIES) else ["--strategies", ",".join(names)]
        return "compare", [*chosen, *self._load_case()], "", FIBRE

    def _plan(self, name: str) -> Begun:
        options = ["--strategy", name, "--gcode", *self._supported(), *self._load_case()]
        return "plan", options, f"-{name}", PRINT

    def _bed(self) -> Begun:
        try:
            parts = [self.page.bench.other_part(name) for name in shlex.split(self.others.value)]
        except ValueError as error:
            raise InputError(f"other parts are names, apart by spaces; got {error}") from None
        return "bed", [*parts, "--strategy", self._only(), *self._supported()], "-bed", PRINT

    def _support(self) -> Begun:
        return "support", [], "-support.stl", PART

    def _supported(self) -> list[str]:
        return ["--support"] if self.support.value else []

    def support_body(self) -> tuple[FloatArray, IntArray] | None:
        """Points and triangles of the support that is asked for, as far as it is known.

        Below flat layers that is before the part is solved, below others when "Support as STL" has
        found it.
        """
        page = self.page
        if not self.support.value or page.checked is None:
            return None
        case = page.checked.case
        if not isinstance(case.slicing, Planar):
            text, *body = self._body
            return (body[0], body[1]) if body and page.bench.is_of(text) else None
        space = propped_space(case.problem.mesh, case.build, case.machine)
        return None if space is None else (space.mesh.points, space.mesh.boundary)

    def _command_of(self, begun: Begun) -> tuple[list[str], str]:
        """Words of a command behind ``ccfem``, and where its results are."""
        verb, options, ending, _ = begun
        out = self.page.bench.result(ending)
        named = [] if verb in ("compare", "plan") else ["--out", out]
        return [verb, self.page.bench.part_argument(), *options, *named], out

    def _add_part(self, name: str) -> None:
        self.others.put(f"{self.others.value} {shlex.quote(name)}".strip())
        self._show_commands()

    def _begin(self, begin: Callable[[], Begun]) -> None:
        page, begun = self.page, begin()
        (arguments, out), view = self._command_of(begun), begun[-1]
        if self._running:
            raise InputError("a run is going on: stop it first")
        page.say("")
        page.bench.make(page.bench.results)
        part, text = page.bench.opened, page.bench.text
        self.run = ChildRun(
            arguments,
            page.bench.folder,
            lambda state: page.act(self._heed, state, page.bench.folder / out, view, part, text),
            float(self.minutes.value),
        )
        self._tell(self.run.state)

    def _heed(self, state: RunState, out: Path, view: str, part: Opened | None, text: str) -> None:
        self._tell(state)
        if state.written and part is not self.page.bench.opened:
            where = out.relative_to(self.page.bench.folder)
            self.page.say(f"the run of the part before has ended: its results are in {where}")
        elif state.written:
            if out.suffix == ".stl":
                import trimesh

                body: Any = trimesh.load_mesh(out, process=False)
                self._more[out.name], self._body = out, (text, body.vertices, body.faces)
                self.page.show()
            else:
                self.results = read_solution(out, text) if out.suffix else read_results(out)
            if out.suffix:  # what it found stands in no report
                log = escaped("\n".join(state.lines))
                self._said.content = f'<pre class="ccfem" tabindex="0">{log}</pre>'
            self._ran = (self.results and self.results.part_file) or text
            self._show_results()
            self._show_age()
            self.page.show_view(view)
        elif not state.running:
            self.page.say("" if state.stopped == "stopped" else state.complaint)

    def _tell(self, state: RunState) -> None:
        self.ending.visible = state.running
        self._show_starts()
        self.bar.visible, self.bar.value = state.running, 100.0 * state.share
        text = f"{100.0 * state.share:.0f} %: {state.step}" if state.running else state.complaint
        self._said.content = f'<p class="ccfem" role="status">{escaped(text)}</p>' if text else ""

    def stop(self) -> None:
        """Stop the run, if there is one."""
        if self.run is not None:
            self.run.stop()

    def forget(self) -> None:
        """Show no results: they are of another part."""
        self.results, self._more = None, {}
        self._table.visible = self._found.visible = self._old.visible = False
        self._links.content = ""
        self.page.view.value = PART
        self.shown(PART)

    # Showing.

    def show(self) -> None:
        """Show the load cases, and the command that does the same."""
        bench = self.page.bench
        if bench.opened is None:
            return
        loads, sums = (bench.content.get(key) for key in ("loads", "combinations"))
        names = [name for shares in (loads, sums) if isinstance(shares, dict) for name in shares]
        options = (_FIRST, *names, _ALL)
        case = self.case.handle
        if case.options != options:
            case.options, case.visible = options, len(names) > 1
            self.case.put(case.value)
        self.offered.offer(name for name in bench.offered() if name.endswith(".toml"))
        self._show_age()
        self._show_commands()

    def _show_commands(self, _: object = None) -> None:
        """Show what can be run, and the commands that do the same."""
        self._show_starts()
        commands = []
        for name, begin in self._begins.items():
            if self._offers(name):
                try:
                    command = shlex.join(["ccfem", *self._command_of(begin())[0]])
                except InputError as error:
                    command = str(error)
                commands.append(f"<p>{name}: <code>{escaped(command)}</code></p>")
        self._command.content = (
            f'<div class="ccfem"><h2>In a terminal</h2>{"".join(commands)}</div>'
        )

    def _offers(self, name: str) -> bool:
        only = len(self._ticked()) == 1
        needs = {_PLAN: only, _BED: bool(self.others.value.strip()), _BODY: self.support.value}
        return needs.get(name, True)

    def _show_starts(self) -> None:
        for name, button in self.starts.items():
            button.visible = not self._running and self._offers(name)

    def _show_age(self) -> None:
        self._old.visible = self.results is not None and not self.page.bench.is_of(self._ran)

    def _show_results(self) -> None:
        items = "".join(
            f'<li><a href="/files/{quote(name)}" target="_blank" rel="noopener">{escaped(name)}</a>'
            "</li>"
            for name in self._taken
        )
        folder = self.results.folder if self.results else self.page.bench.results
        where = folder.relative_to(self.page.bench.folder)
        self._links.content = (
            f'<div class="ccfem"><h2>Take away</h2><ul>{items}</ul><p>All of it is in '
            f"<code>{escaped(where)}</code>.</p></div>"
        )
        if self.results is None:
            return
        names, table = self.results.names, self.results.table
        several = names == ["bed"]  # parts, of which none is better than another
        kind, corner = ("wide", "part") if several else ("wide ranked", "strategy")
        shown = f'<div class="ccfem {kind}" tabindex="0">{table.html(corner)}</div>'
        self._table.content, self._table.visible = shown, bool(table.rows)
        self.left.handle.visible = not several
        self._found.visible = bool(names)
        if names:
            self.left.handle.options, self.right.handle.options = tuple(names), (_NO_ONE, *names)
            self.left.put(names[0])
            self.right.put(names[1] if names[1:] else _NO_ONE)
            self.layer.max = max(len(self.results.layers) - 1, 1)
            self.layer.value = self.results.first
            self.prints.visible = not any(name.endswith(".gcode") for name in self._taken)

    @property
    def _taken(self) -> dict[str, Path]:
        """Files that can be taken away."""
        return {**(self.results.files if self.results else {}), **self._more}

    def served(self, name: str) -> Served | None:
        """Serve a file of the results; None where it is none of them."""
        path = self._taken.get(name)
        if path is None or path.is_symlink() or not path.is_file():
            return None
        if name == "report.html":
            return Served(path.read_bytes(), "text/html; charset=utf-8")
        kind = mimetypes.guess_type(name)[0] or "application/octet-stream"
        return Served(path.read_bytes(), kind, name)

    def shown(self, view: str) -> tuple[FloatArray, FloatArray] | None:
        """Draw what a view shows of the results; opposite corners of that, mm; None of the part."""
        for handle in self._handles:
            handle.remove()
        self._handles = []
        self.layer.visible = self.right.handle.visible = view != PRINT
        for field in (self.top, self.alone, self.travel):
            field.visible = view == PRINT
        if view == PART or self.results is None:
            return None
        if view == FIBRE and not self.results.layers:
            raise InputError("the last run has no layers of fibre to show: compare strategies")
        if view in (STRESS, MOVED):
            return self._draw_surface(view)
        if view == PRINT:
            return self._draw_print()
        self._draw()
        points = self.results.rims(self._place).reshape(-1, 3)
        if not len(points):
            return None
        aside = self._aside(points) * (len(self._names) - 1)
        return points.min(axis=0), points.max(axis=0) + aside

    @property
    def _place(self) -> int:
        assert self.results is not None
        return min(int(self.layer.value), len(self.results.layers) - 1)

    @property
    def _names(self) -> list[str]:
        """Strategies that are shown: one, or two side by side."""
        shown = (self.left.value, self.right.value)
        return list(dict.fromkeys(name for name in shown if name != _NO_ONE))

    def _aside(self, points: FloatArray) -> FloatArray:
        """Step (3,), mm, from one strategy to the next: along x or y, as the part is narrower."""
        reach = np.ptp(points, axis=0)
        axis = int(np.argmin(np.where(reach > 1e-6 * reach.max(), reach, np.inf)[:2]))
        return np.asarray(_BESIDE * max(float(reach[axis]), 0.1 * reach.max()) * np.eye(3)[axis])

    def _draw_surface(self, view: str) -> tuple[FloatArray, FloatArray]:
        """Draw the part without fibre with its stress, or deformed."""
        import trimesh

        assert self.results is not None
        surface = self.results.surface("stress" if view == STRESS else "moved")
        if surface is None:
            raise InputError("the last run has no stress and no displacement to show")
        matt = trimesh.visual.material.PBRMaterial(metallicFactor=0.0, roughnessFactor=1.0)
        mesh = trimesh.Trimesh(surface.points, surface.triangles, process=False)
        mesh.visual = trimesh.visual.TextureVisuals(material=matt)
        mesh.visual.vertex_attributes["color"] = np.insert(linear(surface.colours), 3, 255, axis=1)
        scene, low, high = self.page.server.scene, surface.points.min(0), surface.points.max(0)
        above = (*(0.5 * (low + high))[:2], high[2] + 0.1 * np.ptp(surface.points))
        self._handles = [
            scene.add_mesh_trimesh("/surface", mesh, cast_shadow=False, receive_shadow=False),
            draw_label(scene, "/surface", surface.said, above),
        ]
        return low, high

    def _redraw(self) -> None:
        """Draw another strategy, from where one looks now."""
        self.shown(self.page.view.value)

    def _draw_print(self) -> tuple[FloatArray, FloatArray]:
        """Draw the whole print of a strategy, a line segment for each piece."""
        assert self.results is not None
        name = self.left.value
        self.printed = self.results.print_layers(name)
        if not self.printed:
            why = self.results.why_not(name) or "press “G-code of this strategy”"
            raise InputError(f"there is no print of {name} to show: {why}")
        # Of a layer that others lie on only what is seen is drawn.
        for k, layer in enumerate(self.printed):
            seen = (layer.kind != FILLS) & (layer.kind != MOVES)
            self._handles.append(self._lines(f"/print_{k}", layer, seen))
        self.top.max = max(len(self.printed) - 1, 1)
        self.top.value = len(self.printed) - 1
        self._show_print()
        parts = [layer.ends[layer.kind < BESIDE].reshape(-1, 3) for layer in self.printed]
        corners = np.concatenate(parts)
        return corners.min(axis=0), corners.max(axis=0)

    def _show_print(self) -> None:
        """Show the print up to a layer, or that alone, with what fills it and how one travels."""
        if self.page.view.value != PRINT or not self.printed:
            return
        count = len(self.printed)
        top = min(int(self.top.value), count - 1)
        for k, handle in enumerate(self._handles[:count]):
            visible = k == top or (k < top and not self.alone.value)
            if handle.visible != visible:
                handle.visible = visible
        for handle in self._handles[count:]:
            handle.remove()
        layer = self.printed[top]
        upper = (layer.kind == FILLS) | ((layer.kind == MOVES) & self.travel.value)
        self._handles[count:] = [self._lines("/print_top", layer, upper)]
        items = "".join(
            f'<li style="border-left: 0.8rem solid {colour}; padding-left: 0.4rem">{kind}</li>'
            for kind, colour in zip(KINDS, COLOURS, strict=True)
        )
        self._layer_said.content = (
            f'<div class="ccfem"><p>{escaped(layer.said)}. Below it only contours, fibre and '
            f'supports are drawn.</p><ul class="kinds">{items}</ul></div>'
        )

    def _lines(self, name: str, layer: PrintLayer, chosen: BoolArray) -> Any:
        """Pieces of a layer of the print, coloured by what they are."""
        shades = linear(layer.colours[chosen])
        return draw_lines(self.page.server.scene, name, layer.ends[chosen], shades)

    def _draw(self) -> None:
        """Draw a layer of one or two strategies, coloured by force."""
        if self.results is None or self.page.view.value != FIBRE:
            return
        results, scene = self.results, self.page.server.scene
        place, names = self._place, self._names
        rims = results.rims(place)
        corners = rims.reshape(-1, 3) if len(rims) else np.zeros((1, 3))
        step = self._aside(corners)
        low, middle = corners.min(axis=0), 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        drawn: list[Any] = []
        for k, name in enumerate(names):
            pieces = results.pieces(name, place)
            rim, width, shades = rgb(OUTLINE), _LINE * results.width, linear(pieces.colours)
            if len(rims):
                drawn.append(draw_lines(scene, f"/fibre_{k}_rim", rims + k * step, rim))
            if len(pieces.ends):
                ends = pieces.ends + k * step
                drawn.append(draw_lines(scene, f"/fibre_{k}_fibre", ends, shades, width, "world"))
            at = np.where(step > 0.0, low, middle) + k * step
            drawn.append(draw_label(scene, f"/fibre_{k}", name, at, "top-center"))
        kept = {handle.name for handle in drawn}
        for handle in self._handles:
            if handle.name not in kept:
                handle.remove()
        self._handles = drawn
        self._tell_layer(place, names)

    def _tell_layer(self, place: int, names: list[str]) -> None:
        assert self.results is not None
        results = self.results
        layer = results.layers[place]
        text = "".join(
            f"<li><b>{escaped(name)}</b> {escaped(results.caption(name, place))}</li>"
            for name in names
        )
        self._layer_said.content = (
            f'<div class="ccfem"><p>Layer {layer["index"]}, {escaped(layer["where"])}</p>'
            f"<ul>{text}</ul><div class='bar' style='background: {gradient('size')}'></div>"
            f"<p class='ends'><span>0 N</span><span>{results.most_force:.3g} N in the fibre"
            "</span></p></div>"
        )
