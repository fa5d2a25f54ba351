"use strict";
// Draws the report from the data in it. Order: data, table, part, layers, space, print, breaking, charts, start.

const byId = (id) => document.getElementById(id);
const SCALES = {
  tension: ["#ececea", "#f9e9cc", "#fbd9a5", "#f5b36b", "#e58646"],
  value: ["#a9bdd6", "#7ba1cf", "#4f83bd", "#265a94", "#0d2f5c"],
  order: ["#440154", "#3b528b", "#21918c", "#5ec962", "#fde725"],
};
const INK = "#1d2430", LINK = "#4a8fd4", NONE = "#b9c2cd", RED = "#b3261e";
const UNITS = { force: " N", angle: "°", curvature: " 1/mm" };

// ---- data -------------------------------------------------------------------------------------

async function inflate(id) {
  const text = atob(byId(id).textContent), bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// What ccfem/comparison/report/packing.py wrote: JSON, and behind it the arrays that it names.
function unpack(bytes) {
  const length = new DataView(bytes.buffer).getUint32(0, true), start = 4 + length;
  const kinds = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, f4: Float32Array };
  const array = (entry) => {
    const kind = kinds[entry.$], size = kind.BYTES_PER_ELEMENT;
    const raw = new Uint8Array(entry.n * size), from = start + entry.at;
    for (let b = 0; b < size; b++)
      for (let k = 0; k < entry.n; k++) raw[k * size + b] = bytes[from + b * entry.n + k];
    const values = new kind(raw.buffer);
    if (!entry.low) return values;
    const rows = entry.n / entry.low.length; // steps, a column after the other
    return entry.low.map((low, c) => {
      const column = new Float32Array(rows);
      let sum = 0;
      for (let k = 0; k < rows; k++) {
        sum = (sum + values[c * rows + k]) & 65535;
        column[k] = low + entry.step * sum;
      }
      return column;
    });
  };
  return JSON.parse(new TextDecoder().decode(bytes.subarray(4, start)), (key, value) =>
    value && value.$ ? array(value) : value);
}

// Plotly reads a few marks of HTML in texts: names are none.
const plain = (text) => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");

const ramps = {};
function ramp(name) {
  if (ramps[name]) return ramps[name];
  const stops = SCALES[name].map((c) => [1, 3, 5].map((k) => parseInt(c.slice(k, k + 2), 16)));
  return (ramps[name] = Array.from({ length: 256 }, (_, k) => {
    const at = (Math.min(k, 254) / 254) * (stops.length - 1), i = Math.min(Math.floor(at), stops.length - 2);
    return stops[i].map((v, c) => Math.round(v + (at - i) * (stops[i + 1][c] - v)));
  }));
}
const css = (rgb) => `rgb(${rgb})`;
const gradient = (name) => `linear-gradient(90deg,${SCALES[name]})`;
const short = (x) => (x === 0 ? "0" : +x.toPrecision(3) + "");

// ---- tables -----------------------------------------------------------------------------------

function sortable(table) {
  const heads = [...table.tHead.rows[0].cells], body = table.tBodies[0];
  const key = (row, k) => {
    const cell = row.cells[k], text = cell ? cell.dataset.value : "";
    return text === undefined || text === "" || text === "nan" ? null : isNaN(text) ? text : +text;
  };
  function sort(k, down) {
    const rows = [...body.rows].map((row) => [key(row, k), row]);
    rows.sort(([a], [b]) => {
      if (a === null || b === null) return (a === null) - (b === null); // what failed stays last
      const order = typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b));
      return down ? -order : order;
    });
    rows.forEach(([, row]) => body.append(row));
    heads.forEach((head, i) => {
      if (i === k) head.setAttribute("aria-sort", down ? "descending" : "ascending");
      else head.removeAttribute("aria-sort");
    });
  }
  heads.forEach((head, k) => {
    const turn = () => sort(k, head.getAttribute("aria-sort") !== "descending" && k > 0);
    head.tabIndex = 0;
    head.addEventListener("click", turn);
    head.addEventListener("keydown", (e) => e.key === "Enter" && turn());
  });
  const bar = document.createElement("div"), choice = document.createElement("select");
  const flip = document.createElement("button");
  bar.className = "sorter";
  heads.forEach((head, k) => choice.add(new Option(head.dataset.title, k)));
  flip.textContent = "⇅";
  flip.setAttribute("aria-label", "turn the order round");
  let down = true;
  choice.onchange = () => sort(+choice.value, (down = +choice.value > 0));
  flip.onclick = () => sort(+choice.value, (down = !down));
  choice.setAttribute("aria-label", "sort by");
  bar.append("sort by", choice, flip);
  table.parentElement.before(bar);
}

function tooltips() {
  const tip = byId("tip");
  const show = (target) => {
    tip.textContent = target.dataset.tip;
    tip.hidden = false;
    const box = target.getBoundingClientRect(), own = tip.getBoundingClientRect();
    tip.style.left = Math.max(8, Math.min(box.left, innerWidth - own.width - 8)) + "px";
    const above = box.top - own.height - 6;
    tip.style.top = (above > 8 ? above : box.bottom + 6) + "px";
  };
  for (const target of document.querySelectorAll("[data-tip]")) {
    target.addEventListener("pointerenter", () => show(target));
    target.addEventListener("focus", () => show(target));
    for (const end of ["pointerleave", "blur"]) target.addEventListener(end, () => (tip.hidden = true));
  }
  addEventListener("scroll", () => (tip.hidden = true), { passive: true });
}

// ---- scenes in space --------------------------------------------------------------------------

// Ranges of the axes, and the sizes in space by which all that is drawn fits into the view: half of
// the view is 1 high, seen from EYE without perspective.
const EYE = { x: -0.8, y: -1.3, z: 1.2 }, FILLED = 0.8, WORDS = 120; // pixels beside the part for words at its ends
function fitted(view, traces) {
  const names = ["x", "y", "z"], away = Math.hypot(EYE.x, EYE.y, EYE.z), flat = Math.hypot(EYE.x, EYE.y);
  const right = [-EYE.y / flat, EYE.x / flat, 0], e = names.map((n) => EYE[n] / away);
  const up = [-e[2] * (e[0] / Math.hypot(e[0], e[1])), -e[2] * (e[1] / Math.hypot(e[0], e[1])), Math.hypot(e[0], e[1])];
  const ranges = names.map((name) => {
    let low = Infinity, high = -Infinity;
    for (const trace of traces)
      for (const v of trace[name]) if (v !== null) { low = Math.min(low, v); high = Math.max(high, v); }
    return [low, high];
  });
  const most = Math.max(...ranges.map(([low, high]) => high - low)) || 1;
  const sizes = ranges.map((range) => {
    const size = Math.max(range[1] - range[0], 1e-3 * most), middle = (range[0] + range[1]) / 2;
    range.splice(0, 2, middle - size / 2, middle + size / 2);
    return size;
  });
  const half = (along) => sizes.reduce((sum, size, c) => sum + 0.5 * size * Math.abs(along[c]), 0);
  const free = Math.max(view.clientWidth - WORDS, 0.5 * view.clientWidth), wide = free / Math.max(view.clientHeight, 1);
  const scale = FILLED * Math.min(1 / half(up), wide / half(right));
  return { ranges, ratio: Object.fromEntries(names.map((name, c) => [name, sizes[c] * scale])) };
}

// The layout of a scene; its words lie above everything, at places in space.
function scene(view, words, traces) {
  const { ranges, ratio } = fitted(view, traces);
  return {
    margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, uirevision: 1,
    scene: {
      aspectmode: "manual", aspectratio: ratio, dragmode: "orbit", camera: { projection: { type: "orthographic" }, eye: EYE },
      ...Object.fromEntries(["xaxis", "yaxis", "zaxis"].map((axis, c) => [axis, { visible: false, range: ranges[c] }])),
      annotations: words.map(({ text, at, colour }) => ({ text: plain(text), x: at[0], y: at[1], z: at[2], showarrow: false, yshift: 12,
        font: { color: colour || INK, size: 13 }, bgcolor: "#ffffffc0" })),
    },
  };
}
const CONFIG = { responsive: true, displaylogo: false, displayModeBar: false };

// Calls once the element is near the screen, for a scene takes time; or when there is time for it.
const WAITING = [];
function whenSeen(element, draw) {
  let drawn = null;
  const once = () => (drawn = drawn || draw());
  new IntersectionObserver((entries, watch) => {
    if (!entries.some((e) => e.isIntersecting)) return;
    watch.disconnect();
    once();
  }, { rootMargin: "200px" }).observe(element);
  let wide = element.clientWidth;
  new ResizeObserver(() => {
    if (!drawn || !element.clientWidth || element.clientWidth === wide) return; // on paper it is hidden
    wide = element.clientWidth;
    draw();
  }).observe(element);
  WAITING.push(async () => {
    await once();
    await printed(element);
  });
}

// A picture of a view, for paper: scenes cannot be printed, and charts keep the width of the screen.
async function printed(element) {
  const wide = element.clientWidth || 600, high = element.clientHeight || 400;
  let picture = element.nextElementSibling;
  if (!picture || picture.className !== "printed") {
    picture = document.createElement("img");
    picture.className = "printed";
    picture.alt = element.getAttribute("aria-label") || "chart";
    element.after(picture);
  }
  picture.src = await Plotly.toImage(element, { format: "png", width: wide, height: high, scale: 1.5 });
}

async function printable() {
  const idle = window.requestIdleCallback || ((then) => setTimeout(then, 50));
  for (const work of WAITING) {
    await new Promise((then) => idle(then));
    await work();
  }
  document.body.dataset.printable = "yes";
}

const MATT = { lighting: { ambient: 0.7, diffuse: 0.5, specular: 0.03, facenormalsepsilon: 0, vertexnormalsepsilon: 0 } };

function partScene(part) {
  const view = byId("part-view"), [x, y, z] = part.points;
  const t = [0, 1, 2].map((c) => Array.from({ length: part.triangles.length / 3 }, (_, k) => part.triangles[3 * k + c]));
  const body = { type: "mesh3d", i: t[0], j: t[1], k: t[2], flatshading: true, hoverinfo: "skip", ...MATT };
  let words = [];
  const facecolor = Array.from(part.colour, (k) => part.colours[k]);
  function setUp() {
    const column = (points, c) => points.map((p) => p[c]), tips = part.arrows.map((a) => a.ends[1]);
    const along = (c) => part.arrows.map(({ ends: [tail, tip] }) => (tip[c] - tail[c]) / (part.size / 4));
    words = [...part.labels, ...part.arrows.map((a) => ({ ...a, colour: RED }))];
    const traces = [{ ...body, x, y, z, facecolor }];
    if (part.supports.length)
      traces.push({ type: "scatter3d", mode: "markers", name: "held", hovertemplate: "held<extra></extra>",
        x: column(part.supports, 0), y: column(part.supports, 1), z: column(part.supports, 2),
        marker: { symbol: "diamond", size: 5, color: "#fff", line: { color: INK, width: 2 } } });
    for (const { ends } of part.arrows)
      traces.push({ type: "scatter3d", mode: "lines", x: column(ends, 0), y: column(ends, 1), z: column(ends, 2),
        line: { color: RED, width: 7 }, hoverinfo: "skip" });
    if (part.arrows.length)
      traces.push({ type: "cone", anchor: "tip", sizemode: "absolute", sizeref: part.size / 28, showscale: false,
        colorscale: [[0, RED], [1, RED]], hoverinfo: "skip", x: column(tips, 0), y: column(tips, 1), z: column(tips, 2),
        u: along(0), v: along(1), w: along(2) });
    byId("part-said").textContent = "Red: resultants of the loads; diamonds: what is held; coloured: patches that carry " +
      "loads or supports. Drag to turn, wheel or pinch to zoom." + (part.coarser ? " Drawn with fewer facets than the mesh has." : "");
    return traces;
  }
  function deformed() {
    words = [];
    const times = +byId("part-scale").value * part.scale;
    byId("part-scale-said").textContent = short(times);
    byId("part-said").textContent = `Displacements are drawn ${short(times)} times as large as they are; the largest is ` +
      `${short(part.most)} mm. Grey: the part as it was. Without fibre.`;
    const moved = [x, y, z].map((values, c) => values.map((v, k) => v + times * part.moved[c][k]));
    const size = Array.from(part.moved_size, (v) => (v / 254) * part.most);
    return [
      { ...body, x, y, z, color: "#9aa4b1", opacity: 0.18 },
      { ...body, x: moved[0], y: moved[1], z: moved[2], intensity: size, flatshading: false, cmin: 0, cmax: part.most,
        colorscale: SCALES.value.map((c, k) => [k / 4, c]), hoverinfo: "text", text: size.map((v) => short(v) + " mm"),
        colorbar: { title: { text: "mm" }, thickness: 10, len: 0.6 } },
    ];
  }
  function stressed() {
    words = [];
    byId("part-said").textContent = `Von Mises stress of the part without fibre; above ${short(part.most_stress)} MPa, ` +
      "in half a percent of the surface's nodes, the colour stays the same.";
    const size = Array.from(part.stress, (v) => (v / 254) * part.most_stress);
    return [{ ...body, x, y, z, intensity: size, flatshading: false, cmin: 0, cmax: part.most_stress,
      colorscale: SCALES.value.map((c, k) => [k / 4, c]), hoverinfo: "text", text: size.map((v) => short(v) + " MPa"),
      colorbar: { title: { text: "MPa" }, thickness: 10, len: 0.6 } }];
  }
  const modes = byId("part-mode");
  if (!part.moved) modes.options[1].disabled = modes.options[2].disabled = true;
  const draw = () => {
    const moved = modes.value === "moved";
    byId("part-scale-label").hidden = !moved;
    const traces = moved ? deformed() : modes.value === "stress" ? stressed() : setUp();
    return Plotly.react(view, traces, scene(view, words, traces), CONFIG);
  };
  modes.onchange = byId("part-scale").oninput = draw;
  modes.addEventListener("change", () => printed(view));
  whenSeen(view, draw);
}

// ---- layers -----------------------------------------------------------------------------------

// Place of each piece in the order in which the fibre of a layer is laid, 0 to 254.
function orderOf(paths) {
  if (paths.order) return paths.order;
  const n = paths.points[0].length;
  return (paths.order = Uint8Array.from({ length: n }, (_, k) => Math.round((254 * k) / Math.max(n - 1, 1))));
}
const valuesOf = (paths, colour) => (colour === "order" ? orderOf(paths) : paths[colour]);

function legendOf(colour, scales, tested, broken) {
  const red = broken ? ` <i class="short" style="background:${RED}"></i>not printable` : "";
  return valueLegend(colour, scales, tested) + red;
}

function valueLegend(colour, scales, tested) {
  if (colour === "strand") return `<i class="short" style="background:${INK}"></i>strand <i class="short" style="background:${LINK}"></i>link`;
  if (colour === "order") return `first<i style="background:${gradient("order")}"></i>last`;
  if (colour === "layer") return `bottom<i style="background:${gradient("order")}"></i>top`;
  const what = { force: "axial force, tension only", angle: "angle to the tension", curvature: "curvature" }[colour];
  const none = colour === "force" && !tested ? "; not tested" : "";
  return `${what} 0<i style="background:${gradient("value")}"></i>${short(scales[colour])}${UNITS[colour]}` +
    ` <i class="short" style="background:${NONE}"></i>not known${none}`;
}

function layersView(layers) {
  const at = { stack: 0, layer: 0, x: 0, y: 0, zoom: 1 };
  const views = byId("layer-views"), slider = byId("layer"), colour = byId("colour"), below = byId("below");
  const stackChoice = byId("stack");
  let figures = [];
  layers.stacks.forEach((stack, k) => stackChoice.add(new Option(stack.name, k)));
  if (layers.stacks.length > 1) document.querySelectorAll(".stack").forEach((label) => (label.hidden = false));
  const stack = () => layers.stacks[at.stack];

  function build() {
    views.replaceChildren();
    figures = stack().runs.map((run, number) => {
      const figure = document.createElement("figure"), canvas = document.createElement("canvas");
      const words = document.createElement("figcaption");
      canvas.tabIndex = 0;
      canvas.setAttribute("role", "img");
      figure.append(words, canvas);
      views.append(figure);
      moves(canvas);
      return { run, number, canvas, words };
    });
    slider.max = stack().layers.length - 1;
    slider.value = at.layer = stack().first;
    const shown = stack().layers.length, left = stack().count - shown;
    byId("layer-note").textContent = (left > 0 ? `${shown} of ${stack().count} layers are drawn; all are in paths.vtp. ` : "") +
      "Drag to move; + and − zoom, and so does the wheel once a picture was clicked, or two fingers. " +
      `Points of the paths stand about ${short(layers.step)} mm apart here.`;
    whole();
  }

  // Screen coordinates from mm: scale, and the point in the middle.
  function frame(canvas) {
    const [left, bottom, right, top] = box();
    const fit = Math.min(canvas.width / (right - left), canvas.height / (top - bottom)) / 1.05;
    return { s: fit * at.zoom, x: at.x, y: at.y };
  }
  function box() {
    const all = stack().layers.map((l) => l.box);
    return [0, 1, 2, 3].map((k) => Math[k < 2 ? "min" : "max"](...all.map((b) => b[k])));
  }
  function whole() {
    const [left, bottom, right, top] = box();
    Object.assign(at, { x: (left + right) / 2, y: (bottom + top) / 2, zoom: 1 });
    draw();
  }

  const maps = new Map();
  function mapOf(layer, name) { // a small picture of a map, drawn once
    const key = name + layer.index + "/" + at.stack;
    if (maps.has(key)) return maps.get(key);
    const picture = document.createElement("canvas"), colours = ramp("tension");
    [picture.width, picture.height] = layer.shape;
    const pen = picture.getContext("2d"), image = pen.createImageData(...layer.shape);
    layer[name].forEach((value, k) => value < 255 && image.data.set([...colours[value], 255], 4 * k));
    pen.putImageData(image, 0, 0);
    maps.set(key, picture);
    return picture;
  }

  function drawOne({ run, canvas, words }) {
    const layer = stack().layers[at.layer], paths = run.layers[at.layer];
    const [left, bottom, right, top] = box();
    const ratio = Math.min(devicePixelRatio || 1, 2), wide = canvas.clientWidth || 300;
    const high = wide * Math.min(Math.max((top - bottom) / (right - left), 0.25), 1.4);
    canvas.style.height = high + "px";
    canvas.width = wide * ratio;
    canvas.height = high * ratio;
    const pen = canvas.getContext("2d"), f = frame(canvas);
    pen.setTransform(f.s, 0, 0, -f.s, canvas.width / 2 - f.s * f.x, canvas.height / 2 + f.s * f.y);
    const rim = new Path2D();
    for (let k = 0; k + 1 < layer.rim_offsets.length; k++)
      for (let p = layer.rim_offsets[k]; p < layer.rim_offsets[k + 1]; p++)
        rim[p === layer.rim_offsets[k] ? "moveTo" : "lineTo"](layer.rims[0][p], layer.rims[1][p]);
    pen.save();
    pen.clip(rim, "evenodd");
    pen.fillStyle = colour.value === "strand" ? "#ececea" : "#fafaf9";
    pen.fill(rim, "evenodd");
    if (below.value !== "none") {
      const side = Math.max(layer.box[2] - layer.box[0], layer.box[3] - layer.box[1]) / Math.max(...layer.shape);
      pen.save();
      if (colour.value !== "strand") pen.globalAlpha = 0.35; // so that the colours of the strands are seen
      pen.scale(1, -1);
      pen.drawImage(mapOf(layer, below.value === "error" ? "error" : "tension"), layer.box[0], -layer.box[3],
        side * layer.shape[0], side * layer.shape[1]);
      pen.restore();
    }
    pen.restore();
    pen.strokeStyle = "#5d6878";
    pen.lineWidth = (0.8 * ratio) / f.s;
    pen.stroke(rim);
    if (below.value === "direction") strokes(pen, layer);
    strands(pen, paths);
    if (run.failure && run.failure.layer === at.layer) failure(pen, run.failure, f.s / ratio);
    words.replaceChildren();
    const mark = document.createElement("i"), name = document.createElement("b");
    mark.className = "swatch";
    mark.style.background = run.colour;
    name.textContent = run.name;
    words.append(mark, name, " " + paths.caption);
    canvas.setAttribute("aria-label", `${run.name}, layer ${layer.index}: ${paths.caption}`);
    scaleBar(pen, canvas, f.s, ratio);
  }

  function strokes(pen, layer) {
    const [columns, rows] = layer.stroke_shape;
    const side = Math.max(layer.box[2] - layer.box[0], layer.box[3] - layer.box[1]) / Math.max(columns, rows);
    pen.beginPath();
    layer.strokes.forEach((value, k) => {
      if (value === 255) return;
      const angle = (value / 254) * Math.PI, dx = 0.42 * side * Math.cos(angle), dy = 0.42 * side * Math.sin(angle);
      const x = layer.box[0] + ((k % columns) + 0.5) * side, y = layer.box[3] - (Math.floor(k / columns) + 0.5) * side;
      pen.moveTo(x - dx, y - dy);
      pen.lineTo(x + dx, y + dy);
    });
    pen.strokeStyle = "#b0741c";
    pen.lineWidth = side * 0.08;
    pen.stroke();
  }

  // Pieces of one colour are drawn together; strands that break a rule are red in every colouring.
  function strands(pen, paths) {
    const [x, y] = paths.points, values = colour.value === "strand" ? null : valuesOf(paths, colour.value);
    const colours = ramp(colour.value === "order" ? "order" : "value"), groups = new Map();
    for (let k = 0; k + 1 < paths.offsets.length; k++)
      for (let p = paths.offsets[k]; p < paths.offsets[k + 1] - 1; p++) {
        const key = paths.broken && paths.broken[k] ? 256 : values ? (values[p] === 255 ? -1 : values[p] & ~3) : paths.link && paths.link[p] ? -2 : 0;
        if (!groups.has(key)) groups.set(key, []);
        groups.get(key).push(p);
      }
    pen.lineWidth = 0.45 * layers.width;
    pen.lineCap = pen.lineJoin = "round";
    for (const key of [...groups.keys()].sort((a, b) => a - b)) {
      pen.strokeStyle = key === 256 ? RED : key === -2 ? LINK : key === -1 ? NONE : values ? css(colours[key]) : INK;
      pen.beginPath();
      let last = -2;
      for (const p of groups.get(key)) {
        if (p !== last + 1) pen.moveTo(x[p], y[p]);
        pen.lineTo(x[p + 1], y[p + 1]);
        last = p;
      }
      pen.stroke();
    }
  }

  function failure(pen, spot, scale) {
    const [x, y] = spot.at;
    for (const [colour, width] of [["#fff", 4], [RED, 2]]) {
      pen.beginPath();
      pen.arc(x, y, 8 / scale, 0, 7);
      pen.strokeStyle = colour;
      pen.lineWidth = width / scale;
      pen.stroke();
    }
    pen.save();
    pen.scale(1, -1);
    pen.font = `600 ${12 / scale}px sans-serif`;
    pen.lineWidth = 3 / scale;
    pen.strokeStyle = "#fff";
    pen.fillStyle = RED;
    const said = `${spot.what} fails first, at ${Math.round(spot.load)} N`;
    const right = x > (stack().layers[at.layer].box[0] + stack().layers[at.layer].box[2]) / 2;
    pen.textAlign = right ? "right" : "left";
    for (const how of ["strokeText", "fillText"]) pen[how](said, x + (right ? -12 : 12) / scale, -y - 10 / scale);
    pen.restore();
  }

  function scaleBar(pen, canvas, s, ratio) {
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const most = (0.25 * canvas.width) / s, power = 10 ** Math.floor(Math.log10(most));
    const length = power * [5, 2, 1].find((k) => k * power <= most), y = canvas.height / ratio - 8;
    pen.fillStyle = "#ffffffc0";
    pen.fillRect(4, y - 10, (length * s) / ratio + 54, 16);
    pen.fillStyle = INK;
    pen.fillRect(8, y - 1, (length * s) / ratio, 2);
    pen.font = "11px sans-serif";
    pen.fillText(`${+length.toPrecision(3)} mm`, 12 + (length * s) / ratio, y + 4);
  }

  let asked = false;
  function draw() { // once a frame, however often it is asked
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      figures.forEach(drawOne);
      const layer = stack().layers[at.layer];
      byId("layer-said").textContent = `${layer.index} of ${stack().count}, ${layer.where}`;
      byId("path-legend").innerHTML = legendOf(colour.value, layers.scales, stack().runs.some((run) => run.tested),
        stack().runs.some((run) => run.layers.some((layer) => layer.broken)));
      byId("map-legend").innerHTML = below.value === "none" ? "" : below.value === "error"
        ? `error over mean stress 0<i style="background:${gradient("tension")}"></i>${short(layer.error_limit)}`
        : `tension 0<i style="background:${gradient("tension")}"></i>${short(layers.scales.tension)} MPa` +
          (below.value === "direction" ? ' <i class="short" style="background:#b0741c"></i>its direction' : "");
    });
  }

  function zoomBy(times, canvas, event) {
    const before = frame(canvas), ratio = canvas.width / canvas.clientWidth, own = canvas.getBoundingClientRect();
    const px = event ? (event.clientX - own.left) * ratio - canvas.width / 2 : 0;
    const py = event ? (event.clientY - own.top) * ratio - canvas.height / 2 : 0;
    at.zoom = Math.min(Math.max(at.zoom * times, 1), 80);
    const after = frame(canvas);
    at.x += px / before.s - px / after.s;
    at.y -= py / before.s - py / after.s;
    figures.forEach(({ canvas }) => canvas.classList.toggle("near", at.zoom > 1));
    if (at.zoom === 1) whole();
    draw();
  }

  function moves(canvas) {
    const held = new Map();
    let apart = 0;
    canvas.addEventListener("pointerdown", (e) => {
      held.set(e.pointerId, e);
      canvas.setPointerCapture(e.pointerId);
      apart = 0;
    });
    canvas.addEventListener("pointermove", (e) => {
      if (!held.has(e.pointerId)) return;
      const before = held.get(e.pointerId), f = frame(canvas), ratio = canvas.width / canvas.clientWidth;
      held.set(e.pointerId, e);
      if (held.size === 1) {
        at.x -= ((e.clientX - before.clientX) * ratio) / f.s;
        at.y += ((e.clientY - before.clientY) * ratio) / f.s;
        draw();
      } else {
        const [a, b] = [...held.values()], now = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
        if (apart) zoomBy(now / apart, canvas, { clientX: (a.clientX + b.clientX) / 2, clientY: (a.clientY + b.clientY) / 2 });
        apart = now;
      }
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => held.delete(e.pointerId));
    canvas.addEventListener("wheel", (e) => {
      if (!e.ctrlKey && document.activeElement !== canvas) return;
      e.preventDefault();
      zoomBy(Math.exp(-e.deltaY / 400), canvas, e);
    }, { passive: false });
  }

  slider.oninput = () => {
    at.layer = +slider.value;
    draw();
  };
  colour.onchange = below.onchange = draw;
  stackChoice.onchange = () => {
    at.stack = +stackChoice.value;
    build();
  };
  byId("closer").onclick = () => zoomBy(1.5, figures[0].canvas);
  byId("farther").onclick = () => zoomBy(1 / 1.5, figures[0].canvas);
  byId("whole").onclick = () => {
    figures.forEach(({ canvas }) => canvas.classList.remove("near"));
    whole();
  };
  new ResizeObserver(draw).observe(views);
  if (layers.stacks.some((s) => s.runs.some((run) => run.tested))) colour.value = "force";
  byId("layers").hidden = false;
  build();
}

// ---- paths in space ---------------------------------------------------------------------------

function inSpace(points, layer, space) {
  if (!Array.isArray(layer.space) || layer.space.length !== 10) return space || layer.space;
  const f = layer.space, h = f[9];
  return [0, 1, 2].map((c) => points[0].map((u, k) => u * f[c] + points[1][k] * f[3 + c] + h * f[6 + c]));
}

function spaceScene(part, layers) {
  const view = byId("space-view"), choice = byId("space-run"), top = byId("space-top"), colour = byId("space-colour");
  const stackChoice = byId("space-stack");
  layers.stacks.forEach((stack, k) => stackChoice.add(new Option(stack.name, k)));
  const stack = () => layers.stacks[+stackChoice.value];
  function choices() {
    choice.replaceChildren();
    stack().runs.forEach((run, k) => choice.add(new Option(run.name, k)));
    top.max = top.value = stack().layers.length;
  }
  function draw() {
    const run = stack().runs[+choice.value], limit = +top.value, x = [], y = [], z = [], c = [];
    const rims = [[], [], []];
    const put = (lists, points, offsets, value) => {
      for (let k = 0; k + 1 < offsets.length; k++) {
        for (let p = offsets[k]; p < offsets[k + 1]; p++) {
          lists.forEach((list, d) => list.push(points[d][p]));
          if (value) c.push(value(Math.min(p, offsets[k + 1] - 2)));
        }
        lists.forEach((list) => list.push(null));
        if (value) c.push(0);
      }
    };
    const every = Math.max(1, Math.floor(stack().layers.length / 30));
    stack().layers.slice(0, limit).forEach((layer, k) => {
      if (k % every === 0) put(rims, inSpace(layer.rims, layer, null), layer.rim_offsets, null);
      const paths = run.layers[k];
      if (paths.offsets.length < 2) return;
      const values = colour.value === "layer" ? null : valuesOf(paths, colour.value);
      const share = (254 * k) / Math.max(stack().layers.length - 1, 1);
      put([x, y, z], inSpace(paths.points, layer, paths.space), paths.offsets,
        (p) => (values ? (values[p] === 255 ? 0 : values[p]) : share));
    });
    const t = [0, 1, 2].map((d) => Array.from({ length: part.triangles.length / 3 }, (_, k) => part.triangles[3 * k + d]));
    const named = colour.value === "layer" || colour.value === "order";
    const scale = SCALES[named ? "order" : "value"].map((hue, k) => [k / 4, hue]);
    const ends = named ? (colour.value === "layer" ? ["bottom", "top"] : ["first", "last"])
      : ["0", short(layers.scales[colour.value]) + UNITS[colour.value]];
    const traces = [
      { type: "mesh3d", x: part.points[0], y: part.points[1], z: part.points[2], i: t[0], j: t[1], k: t[2], color: "#9aa4b1",
        opacity: 0.12, hoverinfo: "skip", ...MATT },
      { type: "scatter3d", mode: "lines", x: rims[0], y: rims[1], z: rims[2], line: { color: "#b9c2cd", width: 1.5 }, hoverinfo: "skip" },
      { type: "scatter3d", mode: "lines", x, y, z, hoverinfo: "skip", line: { color: c, width: 3, cmin: 0, cmax: 254, colorscale: scale,
        showscale: true, colorbar: { thickness: 10, len: 0.6, tickvals: [0, 254], ticktext: ends } } },
    ];
    const words = [];
    if (run.failure) {
      const [fx, fy, fz] = run.failure.where;
      traces.push({ type: "scatter3d", mode: "markers", x: [fx], y: [fy], z: [fz], marker: { size: 6, color: RED }, hoverinfo: "skip" });
      words.push({ text: `${run.failure.what} fails first`, at: run.failure.where, colour: RED });
    }
    byId("space-said").textContent = `${limit} of ${stack().layers.length}` +
      (stack().count > stack().layers.length ? ` drawn, ${stack().count} in all` : "");
    return Plotly.react(view, traces, scene(view, words, traces), CONFIG);
  }
  choices();
  stackChoice.onchange = () => {
    choices();
    draw();
  };
  choice.onchange = colour.onchange = top.oninput = draw;
  for (const control of [choice, colour, top]) control.addEventListener("change", () => printed(view));
  byId("space").hidden = false;
  whenSeen(view, draw);
}

// ---- the print --------------------------------------------------------------------------------

// The layer on top is drawn whole; of those below it what is seen: contours, fibre, supports.
const FILLS = 1, TRAVEL = 5;
function printScene(given) {
  const view = byId("print-view"), choice = byId("print-run"), top = byId("print-top");
  const alone = byId("print-alone"), travel = byId("print-travel");
  given.runs.forEach((run, k) => choice.add(new Option(run.name, k)));
  const layers = () => given.runs[+choice.value].layers;
  const begin = () => { top.max = top.value = layers().length - 1; };
  function draw() {
    const at = +top.value, lists = given.kinds.map(() => [[], [], []]);
    layers().slice(alone.checked ? at : 0, at + 1).forEach((layer) => {
      const whole = layer === layers()[at];
      layer.kind.forEach((kind, k) => {
        if (kind === TRAVEL ? !(whole && travel.checked) : kind === FILLS && !whole) return;
        lists[kind].forEach((list, c) => {
          for (let p = layer.offsets[k]; p < layer.offsets[k + 1]; p++) list.push(layer.points[c][p]);
          list.push(null);
        });
      });
    });
    const traces = lists.map(([x, y, z], kind) => ({ type: "scatter3d", mode: "lines", x, y, z, name: given.kinds[kind],
      hoverinfo: "skip", line: { color: given.colours[kind], width: kind === 2 ? 3 : 1.5 } })).filter((trace) => trace.x.length);
    const run = given.runs[+choice.value], layer = layers()[at];
    byId("print-top-said").textContent = `${layer.index + 1} of ${run.count}, ${short(layer.top)} mm`;
    byId("print-said").textContent = (layers().length < run.count ? `${layers().length} of ${run.count} layers are drawn. ` : "") +
      "Drag to turn, wheel or pinch to zoom. Below the uppermost layer only contours, fibre and supports are drawn.";
    return Plotly.react(view, traces, scene(view, [], traces), CONFIG);
  }
  byId("print-legend").innerHTML = given.kinds.map((kind, k) =>
    `<span class="legend"><i class="short" style="background:${given.colours[k]}"></i>${kind}</span>`).join(" ");
  begin();
  choice.onchange = () => { begin(); draw(); };
  top.oninput = alone.onchange = travel.onchange = draw;
  for (const control of [choice, top, alone, travel]) control.addEventListener("change", () => printed(view));
  byId("print").hidden = false;
  whenSeen(view, draw);
}

// ---- breaking load ----------------------------------------------------------------------------

// What has failed before a step, and what fails at it.
const CRACKED = "#e58646";
function breakingScene(part, given) {
  const view = byId("breaking-view"), choice = byId("breaking-run"), step = byId("breaking-step");
  given.forEach((run, k) => choice.add(new Option(run.name, k)));
  const run = () => given[+choice.value];
  const begin = () => {
    step.max = run().force.length - 1;
    step.value = run().force.indexOf(Math.max(...run().force));
  };
  const t = [0, 1, 2].map((c) => Array.from({ length: part.triangles.length / 3 }, (_, k) => part.triangles[3 * k + c]));
  const body = { type: "mesh3d", x: part.points[0], y: part.points[1], z: part.points[2], i: t[0], j: t[1], k: t[2],
    color: "#9aa4b1", opacity: 0.14, hoverinfo: "skip", ...MATT };
  const marks = (failed, chosen, name, marker) => {
    const kept = [...failed.row.keys()].filter((k) => chosen(failed.row[k]));
    const [x, y, z] = failed.points.map((column) => kept.map((k) => column[k]));
    return { type: "scatter3d", mode: "markers", name, hoverinfo: "skip", x, y, z, marker };
  };
  function draw() {
    const { cells, strands, layers, force, displacement, cracks, broken, parted } = run(), at = +step.value;
    const traces = [body,
      marks(cells, (row) => row < at, "cracked before", { size: 2.5, color: CRACKED, opacity: 0.6 }),
      marks(layers, (row) => row < at, "parted before", { size: 3.5, color: LINK, symbol: "diamond" }),
      marks(strands, (row) => row < at, "broken before", { size: 4, color: INK, symbol: "square" }),
      marks(cells, (row) => row === at, "cracks now", { size: 4, color: RED }),
      marks(layers, (row) => row === at, "parts now", { size: 5, color: RED, symbol: "diamond" }),
      marks(strands, (row) => row === at, "breaks now", { size: 5, color: RED, symbol: "square" }),
    ].filter((trace) => trace.x.length);
    byId("breaking-step-said").textContent = `${at} of ${force.length - 1}: ${short(force[at])} N at ${short(displacement[at])} mm; ` +
      `before it ${cracks[at]} cells cracked, ${short(broken[at])} mm of strand gone` +
      (parted[at] ? `, layers of ${parted[at]} cells parted` : "");
    return Plotly.react(view, traces, scene(view, [], traces), CONFIG);
  }
  const legend = [["cell cracked before", CRACKED], ["strand broken or loose before", INK], ["layers parted before", LINK], ["fails at this step", RED]];
  byId("breaking-legend").innerHTML = legend.map(([what, colour]) =>
    `<span class="legend"><i class="short" style="background:${colour}"></i>${what}</span>`).join(" ");
  begin();
  choice.onchange = () => { begin(); draw(); };
  step.oninput = draw;
  for (const control of [choice, step]) control.addEventListener("change", () => printed(view));
  byId("breaking-steps").hidden = false;
  whenSeen(view, draw);
}

// ---- charts -----------------------------------------------------------------------------------

function chart(element, given) {
  const traces = given.series.map((s) => ({
    type: "scatter", mode: s.mode, x: s.x, y: s.y, name: plain(s.name), showlegend: s.legend !== false,
    line: { color: s.colour, width: s.dash ? 1 : 2, dash: s.dash ? "dash" : "solid" },
    marker: { size: 9, color: s.colour, symbol: (s.hollow || []).map((h) => (h ? "circle-open" : "circle")) },
    hovertemplate: `${plain(s.name)}<br>%{x:.4g}, %{y:.4g}<extra></extra>`,
  }));
  const marks = [...(given.marks || []).map((x) => ({ x })), ...(given.mark ? [given.mark] : [])];
  const axis = { zeroline: false, gridcolor: "#e9edf1", linecolor: "#b9c2cd" };
  const flat = (x) => (given.x_log ? Math.log10(x) : x);
  return Plotly.newPlot(element, traces, {
    title: { text: plain(given.title), font: { size: 15 }, x: 0, xref: "paper" }, margin: { l: 56, r: 12, t: 36, b: 48 },
    xaxis: { ...axis, title: { text: given.x }, range: given.x_range, type: given.x_log ? "log" : "linear", automargin: true },
    yaxis: { ...axis, title: { text: given.y }, range: given.y_range, automargin: true },
    legend: { orientation: "h", y: -0.24 }, font: { color: INK, size: 12 }, hovermode: "closest", dragmode: false,
    shapes: marks.map((m) => ({ type: "line", x0: m.x, x1: m.x, y0: 0, y1: 1, yref: "paper", line: { color: "#8a94a3", dash: "dash", width: 1 } })),
    annotations: marks.filter((m) => m.text).map((m) => ({ x: flat(m.x), y: 0.02, yref: "paper", text: m.text, showarrow: false, xanchor: "left", font: { size: 11, color: "#5d6878" } })),
  }, CONFIG);
}

function charts(all) {
  for (const place of document.querySelectorAll("[data-charts]")) {
    const given = all[place.dataset.charts];
    if (!given.length) continue;
    place.closest("section").hidden = false;
    for (const data of given) {
      const element = document.createElement("div"), frame = document.createElement("div");
      element.className = "chart";
      frame.append(element);
      place.append(frame);
      whenSeen(element, () => chart(element, data));
    }
  }
}

// ---- start ------------------------------------------------------------------------------------

async function start() {
  document.querySelectorAll("table[data-sortable]").forEach(sortable);
  tooltips();
  const data = unpack(await inflate("data"));
  if (data.layers.stacks.some((stack) => stack.runs.length && stack.layers.length)) {
    data.layers.stacks = data.layers.stacks.filter((stack) => stack.runs.length && stack.layers.length);
    layersView(data.layers);
  }
  await new Promise((drawn) => requestAnimationFrame(() => setTimeout(drawn))); // layers first
  const program = document.createElement("script");
  program.textContent = new TextDecoder().decode(await inflate("plotly"));
  document.head.append(program);
  if (data.part) {
    partScene(data.part);
    if (!byId("layers").hidden) spaceScene(data.part, data.layers);
    if (data.breaking.length) breakingScene(data.part, data.breaking);
  } else if (byId("part-view")) byId("part-view").hidden = true;
  if (data.print.runs.length) printScene(data.print);
  charts(data.charts);
  document.body.dataset.ready = "yes";
  await printable();
}

start().catch((error) => {
  const said = byId("trouble");
  said.textContent = `The pictures cannot be drawn here (${error.message}). A browser of 2023 or later with WebGL draws them.`;
  said.hidden = false;
  console.error(error);
});
