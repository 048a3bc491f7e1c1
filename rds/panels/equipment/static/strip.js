// A strip chart over uPlot (which stands above this in the same module, as `uPlot`): lanes that are linked in time.
// The kernel sends rows of float64: time, then one value per trace. The page keeps them all, so that pausing, slow
// motion, scrubbing, zooming and measuring cost the kernel nothing.

const STEP_MS = 80; // a little more often than rows come
const WHOLE_MS = 400; // between two drawings of a whole run
const AGAIN_MS = 2000; // between two askings of a page that has missed what is drawn
const MOST = 3000; // points of a trace that are drawn: more are thinned to their extremes
const LOWEST = 116; // px of a lane
const LETTER = 7.7; // px, of an axis's label
const AXIS = 34; // px below the last lane
// numbers at an axis as all others of the page are: in some browsers' own way 1500 is 1.500
const plain = (u, shown) => shown.map((value) => (value == null ? null : String(Number(value.toPrecision(9)))));

function render({ model, el }) {
  const style = document.createElement("style");
  style.textContent = model.get("_style");
  const box = document.createElement("div");
  box.className = "rds-strip";
  const bar = document.createElement("div");
  bar.className = "rds-strip-bar";
  const tools = document.createElement("div");
  tools.className = "rds-strip-bar rds-strip-tools";
  const sights = document.createElement("div"); // the two cursors' places, for the keyboard
  sights.className = "rds-strip-bar";
  const read = document.createElement("div");
  read.className = "rds-strip-read";
  el.append(style, box, bar, tools, sights, read);

  let columns = [];
  let ghost = null; // rows of an earlier run: {name, columns}
  let end = 0; // s, the right edge that is shown
  let wide = model.get("window"); // s that are shown; Infinity: the whole run
  let follows = true; // the right edge is the newest sample
  let speed = 1; // of the replay; 1 with `follows` is live
  let plots = []; // one for each lane: {plot, lane, of: indices of its traces}
  let hidden = new Set(); // lanes
  let marks = null; // the two cursors, s
  let next = 0; // which of them a click moves
  let dirty = false, drawn = 0, hovered = false;
  box.addEventListener("mouseenter", () => { hovered = true; });
  box.addEventListener("mouseleave", () => { hovered = false; dirty = true; });

  const make = (text, tip, act) => {
    const made = document.createElement("button");
    Object.assign(made, { textContent: text, title: tip, type: "button", onclick: act });
    return made;
  };
  const slider = (label, act) => {
    const made = document.createElement("input");
    Object.assign(made, { type: "range", min: 0, max: 1000, value: 1000, title: label, oninput: act });
    made.setAttribute("aria-label", label);
    return made;
  };
  const hold = () => { if (follows) { follows = false; speed = 0; } };
  const scrub = slider("time shown", () => { follows = false; speed = 0; end = first() + (last() - first()) * scrub.value / 1000; place().dispatchEvent(new CustomEvent("rds-time", { detail: { from: "strip", time: end } })); dirty = true; });
  const clock = document.createElement("span");
  clock.className = "rds-strip-clock";
  bar.append(
    make("Pause", "Hold the picture; recording goes on", () => { follows = false; speed = 0; dirty = true; }),
    make("Slow motion", "Replay at a quarter of the speed from here", () => { if (follows) end = Math.max(first(), end - Math.min(wide, last() - first())); follows = false; speed = 0.25; }),
    make("Live", "Show the newest samples again", () => { follows = true; speed = 1; end = last(); wide = Number.isFinite(wide) ? wide : model.get("window"); dirty = true; }),
    scrub, clock);
  const zoom = (by) => { hold(); wide = Math.min(Math.max((Number.isFinite(wide) ? wide : span()) * by, 0.01), Math.max(span(), model.get("window"))); dirty = true; };
  const lanesBar = document.createElement("span");
  lanesBar.className = "rds-strip-lanes";
  const measure = make("Cursors", "Two cursors: click in a lane to place them in turn, and read the differences", () => {
    marks = marks ? null : [left() + (right() - left()) / 3, left() + (right() - left()) * 2 / 3];
    next = 0;
    dirty = true;
  });
  tools.append(
    make("Whole run", "Zoom to the whole run, also while it goes on (double-click)", () => whole()),
    make("+", "Zoom in around the right edge; drag in a lane to zoom into a stretch", () => zoom(0.5)),
    make("−", "Zoom out", () => zoom(2)),
    measure, lanesBar,
    make("Save picture", "Save the lanes as they are shown, as a PNG file", () => picture()));
  const sliders = ["cursor A", "cursor B"].map((label, i) => slider(label, () => {
    marks[i] = left() + (right() - left()) * sliders[i].value / 1000;
    dirty = true;
  }));
  sights.append(...sliders.flatMap((each, i) => { const text = document.createElement("span"); text.textContent = "AB"[i]; return [text, each]; }));
  sights.style.display = "none";

  const first = () => (columns.length && columns[0].length ? columns[0][0] : 0);
  const last = () => (columns.length && columns[0].length ? columns[0][columns[0].length - 1] : 0);
  const span = () => last() - first();
  const right = () => (Number.isFinite(wide) ? Math.max(end, first() + wide) : Math.max(last(), first() + 0.1)); // a run that has just begun grows from the left
  const left = () => (Number.isFinite(wide) ? right() - wide : first());
  const ink = (name, fallback) => getComputedStyle(el).getPropertyValue(name).trim() || fallback;
  function whole() { wide = Infinity; dirty = true; }

  function build() {
    plots.forEach(({ plot }) => plot.destroy());
    plots = [];
    box.replaceChildren();
    const traces = model.get("traces");
    if (columns.length !== traces.length + 1) columns = [[], ...traces.map(() => [])];
    const all = [...new Set([...traces].sort((a, b) => (a.rank || 0) - (b.rank || 0)).map((trace) => trace.scale))];
    lanesBar.replaceChildren(...(all.length > 1 ? all : []).map((lane) => {
      const made = make(laneName(traces, lane), "Show or hide this lane", () => { hidden.has(lane) ? hidden.delete(lane) : hidden.add(lane); build(); dirty = true; });
      made.setAttribute("aria-pressed", String(!hidden.has(lane)));
      return made;
    }));
    const lanes = all.filter((lane) => !hidden.has(lane));
    const weights = lanes.map((lane) => traces.find((trace) => trace.scale === lane).weight || 1);
    const sum = weights.reduce((total, each) => total + each, 0), room = model.get("height") - AXIS;
    const text = ink("--rds-text", "#222"), grid = { stroke: ink("--rds-grid", "#ddd"), width: 1 };
    lanes.forEach((lane, i) => {
      const of = traces.flatMap((trace, k) => (trace.scale === lane ? [k] : []));
      const isLast = i === lanes.length - 1, height = Math.max(room * weights[i] / sum, LOWEST);
      const axes = [{ stroke: text, grid, label: isLast ? say("time [s]") : undefined, labelSize: isLast ? 18 : 0, size: isLast ? AXIS - 2 : 4, values: isLast ? plain : (u, shown) => shown.map(() => "") },
        { scale: "y", stroke: text, grid, size: 58, labelSize: 18, label: axisLabel(of.map((k) => traces[k]), height), space: 18, values: plain }];
      const series = [{ label: "time [s]", value: (u, v) => (v == null ? "–" : v.toFixed(3)) }];
      of.forEach((k) => series.push({
        label: `${traces[k].name} [${traces[k].unit}]`, stroke: traces[k].color, width: traces[k].width || 1.6, dash: traces[k].dash || [],
        scale: "y", points: { show: false }, value: (u, v) => (v == null ? "–" : v.toPrecision(5)),
      }));
      if (ghost) of.forEach((k) => series.push({ label: `${traces[k].name}, earlier`, stroke: traces[k].color, width: 1.4, dash: [2, 4], scale: "y", points: { show: false }, value: (u, v) => (v == null ? "–" : v.toPrecision(5)) }));
      const plot = new uPlot({
        width: Math.max(box.clientWidth, 280), height: height + (isLast ? AXIS : 0), padding: [6, 8, 0, 0],
        scales: { x: { time: false, range: () => [left(), right()] }, y: { auto: true } }, axes, series,
        cursor: { sync: { key: sync }, drag: { x: true, y: false, setScale: false, dist: 6 }, points: { size: 5 } }, legend: { live: true },
        hooks: {
          draw: [(u) => overlay(u, i === 0)],
          setSelect: [(u) => {
            if (u.select.width < 6) return;
            const from = u.posToVal(u.select.left, "x"), to = u.posToVal(u.select.left + u.select.width, "x");
            hold(); wide = Math.max(to - from, 0.002); end = to; dirty = true;
            u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          }],
        },
      }, shown(of), box);
      plot.over.addEventListener("click", (event) => {
        if (!marks || moved > 5) return;
        marks[next] = plot.posToVal(event.offsetX, "x");
        next = 1 - next;
        dirty = true;
      });
      plot.over.addEventListener("dblclick", whole);
      plot.root.dataset.lane = lane;
      plots.push({ plot, lane, of });
    });
  }
  const sync = `rds-strip-${Math.random()}`;
  // what the machine beside it shows is marked, and it shows what is scrubbed to
  const place = () => el.closest(".rds-live") || el;
  let beside = null;
  const heard = ({ detail }) => { if (detail.from === "scene") { beside = detail.time; dirty = true; } };
  let moved = 0, downAt = 0;
  box.addEventListener("mousedown", (event) => { downAt = event.clientX; }, true);
  box.addEventListener("mouseup", (event) => { moved = Math.abs(event.clientX - downAt); }, true);

  const laneName = (traces, lane) => traces.find((trace) => trace.scale === lane).lane || lane;
  const say = (text) => (window.rdsText ? window.rdsText(text) : text); // in the page's language, where it is drawn
  // the legend names each trace; an axis names the quantity, and its unit, which is all that a low lane has room for
  function axisLabel(traces, height) {
    const of = new Set(traces.map((trace) => trace.name.split(" ")[0]));
    const lane = traces[0].lane || traces[0].name;
    const text = say(`${of.size === 1 && lane !== traces[0].name ? `${[...of][0]} ` : ""}${lane} [${traces[0].unit}]`);
    return text.length * LETTER > height ? `[${traces[0].unit}]` : text;
  }

  // marks of what happened, and the cursors
  function overlay(u, named) {
    const ctx = u.ctx, { top, height } = u.bbox, ratio = devicePixelRatio || 1;
    const line = (time, color, dash, word) => {
      if (time < left() || time > right()) return;
      const x = Math.round(u.valToPos(time, "x", true));
      ctx.save();
      Object.assign(ctx, { strokeStyle: color, fillStyle: color, lineWidth: 1.4 * ratio, font: `600 ${11 * ratio}px system-ui, sans-serif` });
      ctx.setLineDash(dash.map((each) => each * ratio));
      ctx.beginPath(); ctx.moveTo(x, top); ctx.lineTo(x, top + height); ctx.stroke();
      if (named && word) { // beside its line, on the side that has room
        const wide = ctx.measureText(word).width + 3 * ratio;
        ctx.fillText(word, x + wide > u.bbox.left + u.bbox.width ? x - wide : x + 3 * ratio, top + 11 * ratio);
      }
      ctx.restore();
    };
    for (const event of model.get("events")) line(event.time, event.fault ? ink("--rds-error", "#a4001d") : ink("--rds-warning", "#8a4b00"), event.fault ? [] : [3, 3], event.text);
    if (beside !== null) line(beside, ink("--rds-quiet", "#57606a"), [], "");
    if (marks) marks.forEach((time, i) => line(time, ink("--rds-accent", "#00598c"), [], "AB"[i]));
  }

  // only what is in the window is handed to the chart; of very many points the extremes of each stretch
  function shown(of) {
    const time = columns[0] || [], from = Math.max(lower(time, left()) - 1, 0), to = Math.min(lower(time, right() + 1e-9) + 1, time.length);
    const step = Math.ceil((to - from) / (MOST / 2));
    const of_ = of.map((k) => columns[k + 1] || []);
    let x, ys;
    if (step <= 1) { x = time.slice(from, to); ys = of_.map((column) => column.slice(from, to)); }
    else {
      x = []; ys = of_.map(() => []);
      for (let i = from; i < to; i += step) {
        const stop = Math.min(i + step, to), middle = time[(i + stop) >> 1] ?? time[i];
        x.push(time[i], middle);
        of_.forEach((column, k) => {
          let low = Infinity, high = -Infinity;
          for (let j = i; j < stop; j++) { const v = column[j]; if (v < low) low = v; if (v > high) high = v; }
          if (low > high) low = high = NaN;
          const rises = column[stop - 1] >= column[i];
          ys[k].push(rises ? low : high, rises ? high : low);
        });
      }
    }
    const clean = (values) => values.map((v) => (Number.isNaN(v) ? null : v));
    return [x, ...ys.map(clean), ...(ghost ? of.map((k) => clean(at(ghost.columns, k + 1, x))) : [])];
  }
  // the values of an earlier run at the times x
  function at(rows, k, x) {
    const time = rows[0], values = rows[k] || [];
    return x.map((t) => {
      const j = lower(time, t);
      if (j >= time.length || (j === 0 && time[0] > t + 1e-9)) return NaN;
      if (j === 0) return values[0];
      const share = (t - time[j - 1]) / (time[j] - time[j - 1] || 1);
      return values[j - 1] + share * (values[j] - values[j - 1]);
    });
  }
  function lower(values, wanted) {
    let low = 0, high = values.length;
    while (low < high) { const middle = (low + high) >> 1; if (values[middle] < wanted) low = middle + 1; else high = middle; }
    return low;
  }

  function draw() {
    if (!plots.length) return;
    for (const { plot, of } of plots) {
      plot.setData(shown(of));
      const newest = plot.data[0].length - 1; // the legend has the values at the right edge, unless the mouse asks for others
      if (newest >= 0 && (!hovered || plot.cursor.idx == null)) plot.setLegend({ idx: newest });
    }
    if (span() > 0) scrub.value = 1000 * (end - first()) / span();
    const state = follows ? "live" : speed ? `${speed}×` : "paused";
    clock.textContent = `${end.toFixed(2)} s, ${state}`;
    el.dataset.samples = columns.length ? columns[0].length : 0;
    el.dataset.state = state;
    el.dataset.lanes = plots.length;
    el.dataset.until = last().toFixed(3);
    el.dataset.marks = model.get("events").map((event) => `${event.time.toFixed(3)} ${event.text}${event.fault ? " (red)" : ""}`).join("; ");
    el.dataset.from = left().toFixed(3);
    el.dataset.ghost = ghost ? ghost.name : "";
    tell();
  }

  function tell() {
    measure.setAttribute("aria-pressed", String(!!marks));
    sights.style.display = marks ? "" : "none";
    if (!marks) { read.replaceChildren(); return; }
    const [a, b] = marks, traces = model.get("traces");
    sliders.forEach((each, i) => { if (document.activeElement !== each) each.value = 1000 * (marks[i] - left()) / (right() - left()); });
    const row = (tag, cells) => { const made = document.createElement("tr"); cells.forEach((text, i) => { const cell = document.createElement(tag); cell.textContent = text; if (i) cell.className = "number"; made.append(cell); }); return made; };
    const table = document.createElement("table");
    const hertz = b !== a ? `, ${(1 / Math.abs(b - a)).toPrecision(4)} Hz` : "";
    table.append(row("th", ["", `A, ${a.toFixed(3)} s`, `B, ${b.toFixed(3)} s`, `B − A, ${(b - a).toFixed(3)} s${hertz}`]));
    traces.forEach((trace, k) => {
      if (hidden.has(trace.scale)) return;
      const [x, y] = at(columns, k + 1, [a, b]), say = (v) => (Number.isNaN(v) ? "–" : v.toPrecision(5));
      table.append(row("td", [`${trace.name} [${trace.unit}]`, say(x), say(y), say(y - x)]));
    });
    read.replaceChildren(table);
  }

  // all lanes on one canvas, with a legend of its own, as they are shown
  function picture() {
    const ratio = devicePixelRatio || 1, head = 20 * ratio;
    const parts = plots.map(({ plot, of }) => ({ canvas: plot.ctx.canvas, of }));
    const out = document.createElement("canvas");
    out.width = Math.max(...parts.map(({ canvas }) => canvas.width));
    out.height = parts.reduce((sum, { canvas }) => sum + canvas.height + head, 0);
    const ctx = out.getContext("2d"), traces = model.get("traces");
    ctx.fillStyle = ink("--rds-back", "#fff");
    ctx.fillRect(0, 0, out.width, out.height);
    ctx.font = `${12 * ratio}px system-ui, sans-serif`;
    let y = 0;
    for (const { canvas, of } of parts) {
      let x = 62 * ratio;
      for (const k of of) {
        Object.assign(ctx, { strokeStyle: traces[k].color, lineWidth: (traces[k].width || 1.6) * ratio });
        ctx.setLineDash((traces[k].dash || []).map((each) => each * ratio));
        ctx.beginPath(); ctx.moveTo(x, y + 12 * ratio); ctx.lineTo(x + 22 * ratio, y + 12 * ratio); ctx.stroke();
        ctx.fillStyle = ink("--rds-text", "#222");
        const word = `${traces[k].name} [${traces[k].unit}]`;
        ctx.fillText(word, x + 27 * ratio, y + 16 * ratio);
        x += ctx.measureText(word).width + 46 * ratio;
      }
      if (y === 0 && ghost) ctx.fillText(`dotted: ${ghost.name}`, x, y + 16 * ratio);
      ctx.drawImage(canvas, 0, y + head);
      y += canvas.height + head;
    }
    const link = document.createElement("a");
    link.download = "strip.png";
    link.href = out.toDataURL("image/png");
    link.click();
  }

  const timer = setInterval(() => {
    if (!follows && speed) { end = Math.min(end + speed * STEP_MS / 1000, last()); dirty = true; }
    const now = performance.now();
    // it comes in sight with its traces: without them, the page has missed their word
    if (around && box.clientWidth && !model.get("traces").length && now - asked > AGAIN_MS) {
      asked = now;
      model.send({ kind: "all" });
    }
    if (dirty && el.isConnected && box.clientWidth && (Number.isFinite(wide) || now - drawn > WHOLE_MS)) {
      dirty = false;
      drawn = now;
      for (const { plot } of plots) if (Math.abs(plot.width - box.clientWidth) > 4) plot.setSize({ width: box.clientWidth, height: plot.height });
      draw();
    }
  }, STEP_MS);

  function unpacked(view, width) {
    const values = new Float64Array(view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength));
    const found = Array.from({ length: width }, () => []);
    for (let i = 0; i < values.length; i += width) for (let j = 0; j < width; j++) found[j].push(values[i + j]);
    return found;
  }
  function receive(message, buffers) {
    if (message.kind === "clear") { columns = [[], ...model.get("traces").map(() => [])]; beside = null; el.dataset.samples = 0; follows = true; speed = 1; end = 0; wide = model.get("window"); }
    if (message.kind === "rows") {
      const more = unpacked(buffers[0], message.width);
      if (columns.length !== message.width) columns = more;
      else more.forEach((column, j) => { for (const value of column) columns[j].push(value); });
      if (follows) end = last();
    }
    if (message.kind === "ghost") {
      const rows = unpacked(buffers[0], message.width);
      ghost = model.get("ghost") && rows[0].length ? { name: model.get("ghost"), columns: rows } : null;
      build();
    }
    dirty = true;
  }

  const rebuild = () => { build(); dirty = true; };
  model.on("msg:custom", receive);
  const retraced = () => { hidden = new Set(); rebuild(); }, widened = () => { wide = model.get("window"); dirty = true; }, marked = () => { dirty = true; };
  model.on("change:traces", retraced);
  model.on("change:window", widened);
  model.on("change:events", marked);
  const sized = new ResizeObserver(marked); // the lanes are as wide as their place, at rest as well
  sized.observe(box);
  const themed = new MutationObserver(rebuild);
  themed.observe(document.body, { attributes: true, attributeFilter: ["class", "data-jp-theme-light"] });
  const app = document.querySelector(".rds-app");
  if (app) themed.observe(app, { attributes: true, attributeFilter: ["class", "lang"] });
  let around = null, asked = performance.now();
  const begin = () => { if (around) return; around = place(); around.addEventListener("rds-time", heard); build(); model.send({ kind: "all" }); };
  requestAnimationFrame(begin);
  const late = setTimeout(begin, 250); // a page behind others has no frames
  return () => { clearInterval(timer); clearTimeout(late); around?.removeEventListener("rds-time", heard); themed.disconnect(); sized.disconnect(); model.off("msg:custom", receive); model.off("change:traces", retraced); model.off("change:window", widened); model.off("change:events", marked); plots.forEach(({ plot }) => plot.destroy()); };
}

export default { render };
