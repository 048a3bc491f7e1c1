// A live strip chart over uPlot (which stands above this in the same module, as `uPlot`).
// The kernel sends rows of float64: time, then one value per trace. The page keeps them all, so that pausing,
// slow motion and scrubbing back cost the kernel nothing.

const STEP_MS = 80; // a little more often than rows come

function render({ model, el }) {
  const style = document.createElement("style");
  style.textContent = model.get("_style");
  const box = document.createElement("div");
  box.className = "rds-strip";
  const bar = document.createElement("div");
  bar.className = "rds-strip-bar";
  el.append(style, box, bar);

  let columns = [];
  let end = 0; // s, the right edge that is shown
  let follows = true; // the right edge is the newest sample
  let speed = 1; // of the replay; 1 with `follows` is live
  let plot = null;
  let dirty = false;
  let hovered = false; // the mouse points at a time
  box.addEventListener("mouseenter", () => { hovered = true; });
  box.addEventListener("mouseleave", () => { hovered = false; dirty = true; });

  const pause = button("Pause", "Hold the picture; recording goes on");
  const slow = button("Slow motion", "Replay at a quarter of the speed from here");
  const live = button("Live", "Show the newest samples again");
  const scrub = document.createElement("input");
  Object.assign(scrub, { type: "range", min: 0, max: 1000, value: 1000, title: "Scrub back through what was recorded" });
  scrub.setAttribute("aria-label", "time shown");
  const clock = document.createElement("span");
  clock.className = "rds-strip-clock";
  bar.append(pause, slow, live, scrub, clock);

  pause.onclick = () => { follows = false; speed = 0; dirty = true; };
  slow.onclick = () => { if (follows) end = Math.max(first(), end - model.get("window")); follows = false; speed = 0.25; };
  live.onclick = () => { follows = true; speed = 1; dirty = true; };
  scrub.oninput = () => {
    follows = false; speed = 0;
    end = first() + (last() - first()) * scrub.value / 1000;
    dirty = true;
  };

  function button(text, tip) {
    const made = document.createElement("button");
    made.textContent = text; made.title = tip; made.type = "button";
    return made;
  }
  const first = () => (columns.length && columns[0].length ? columns[0][0] : 0);
  const last = () => (columns.length && columns[0].length ? columns[0][columns[0].length - 1] : 0);
  const right = () => Math.max(end, first() + model.get("window")); // a run that has just begun grows from the left
  const ink = (name, fallback) => getComputedStyle(el).getPropertyValue(name).trim() || fallback;

  function build() {
    if (plot) plot.destroy();
    const traces = model.get("traces");
    if (columns.length !== traces.length + 1) columns = [[], ...traces.map(() => [])];
    const text = ink("--rds-text", "#222"), grid = { stroke: ink("--rds-grid", "#ddd"), width: 1 };
    const scaled = (trace) => trace.scale || trace.unit;
    const units = [...new Set(traces.map(scaled))];
    const scales = { x: { time: false, range: () => [right() - model.get("window"), right()] } };
    units.forEach((unit) => { scales[unit] = { auto: true }; });
    const axes = [{ stroke: text, grid, label: "time [s]", labelSize: 20, size: 34 }];
    units.forEach((unit, i) => axes.push({
      scale: unit, stroke: text, grid: i ? { show: false } : grid, side: i ? 1 : 3, labelSize: 18,
      size: (u, shown) => 16 + 7.5 * Math.max(2, ...(shown || []).map((each) => String(each ?? "").length)),
      label: axisLabel(traces.filter((trace) => scaled(trace) === unit)),
    }));
    const series = [{ label: "time [s]", value: (u, v) => (v == null ? "–" : v.toFixed(3)) }];
    traces.forEach((trace) => series.push({
      label: `${trace.name} [${trace.unit}]`, stroke: trace.color, width: trace.width || 1.6, dash: trace.dash || [],
      scale: scaled(trace), points: { show: false }, value: (u, v) => (v == null ? "–" : v.toPrecision(5)),
    }));
    plot = new uPlot({ width: Math.max(box.clientWidth, 320), height: model.get("height"), scales, axes, series,
      cursor: { drag: { x: false, y: false } }, legend: { live: true } }, shown(), box);
  }

  // the legend names each trace; an axis names one trace, or what several have in common
  function axisLabel(traces) {
    const unit = ` [${traces[0].unit}]`;
    if (traces.length === 1) return traces[0].name + unit;
    const first = traces[0].name.split(" ")[0];
    return (traces.every((trace) => trace.name.split(" ")[0] === first) ? first : "") + unit;
  }

  // only what is in the window is handed to the chart
  function shown() {
    const time = columns[0] || [], from = lower(time, end - model.get("window")), to = lower(time, end + 1e-9);
    return columns.map((column) => column.slice(Math.max(from - 1, 0), to + 1));
  }
  function lower(values, wanted) {
    let low = 0, high = values.length;
    while (low < high) { const middle = (low + high) >> 1; if (values[middle] < wanted) low = middle + 1; else high = middle; }
    return low;
  }

  function draw() {
    if (!plot) return;
    plot.setData(shown());
    const newest = plot.data[0].length - 1; // the legend has the values at the right edge, unless the mouse asks for others
    if (newest >= 0 && !hovered) plot.setLegend({ idx: newest });
    if (last() > first()) scrub.value = 1000 * (end - first()) / (last() - first());
    const state = follows ? "live" : speed ? `${speed}×` : "paused";
    clock.textContent = `${end.toFixed(2)} s, ${state}`;
    el.dataset.samples = columns.length ? columns[0].length : 0;
    el.dataset.state = state;
    if (model.get("tells") && model.get("shown") !== end) { model.set("shown", end); model.save_changes(); }
  }

  const timer = setInterval(() => {
    if (!follows && speed) { end = Math.min(end + speed * STEP_MS / 1000, last()); dirty = true; }
    if (dirty && el.isConnected && box.clientWidth) {
      dirty = false;
      if (plot && Math.abs(plot.width - box.clientWidth) > 4) plot.setSize({ width: box.clientWidth, height: model.get("height") });
      draw();
    }
  }, STEP_MS);

  function receive(message, buffers) {
    if (message.kind === "clear") { columns = [[], ...model.get("traces").map(() => [])]; follows = true; speed = 1; end = 0; }
    if (message.kind === "rows") {
      const view = buffers[0], width = message.width;
      const values = new Float64Array(view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength));
      if (columns.length !== width) columns = Array.from({ length: width }, () => []);
      for (let i = 0; i < values.length; i += width)
        for (let j = 0; j < width; j++) columns[j].push(values[i + j]);
      if (follows) end = last();
    }
    dirty = true;
  }

  const rebuild = () => { build(); dirty = true; };
  model.on("msg:custom", receive);
  model.on("change:traces", rebuild);
  model.on("change:window change:tells", () => { dirty = true; });
  const themed = new MutationObserver(rebuild);
  themed.observe(document.body, { attributes: true, attributeFilter: ["class", "data-jp-theme-light"] });
  const app = document.querySelector(".rds-app");
  if (app) themed.observe(app, { attributes: true, attributeFilter: ["class"] });
  requestAnimationFrame(() => { build(); model.send({ kind: "all" }); });
  return () => { clearInterval(timer); themed.disconnect(); model.off("msg:custom", receive); if (plot) plot.destroy(); };
}

export default { render };
