// The machine in motion. The kernel sends what it looks like, once, and rows of float64: time, then the columns named.
// All that moves is worked out here: playing, the trail, the magnified error and the cut cost the kernel nothing.

const SPEEDS = [0.25, 0.5, 1, 2, 5, 20];
const BEHIND = 0.15; // s that a picture is behind the newest row of a run that goes on
const SOFT_MS = 100; // between two pictures where no graphics card draws them
const FRAME_MS = 17; // the most that the browser takes to begin a picture that was asked for
const MOST_TRAIL = 6000;
const SLOWER = 20; // a spindle is drawn turning so many times slower

function render({ model, el }) {
  el.classList.add("rds-scene");
  const make = (tag, words = {}, ...inside) => { const made = Object.assign(document.createElement(tag), words); made.append(...inside); return made; };
  const button = (text, tip, act) => make("button", { type: "button", textContent: text, title: tip, onclick: act });
  const opener = button("Show the machine", "The machine in motion: its axes, its trail, what it cuts", () => setOpen(!model.get("shows")));
  const canvas = make("canvas", { tabIndex: 0 });
  canvas.setAttribute("role", "img");
  const play = button("Play", "Play from here, or from the beginning", () => { caughtUp = false; if (playing) playing = false; else { follows = false; if (now >= last()) now = first(); playing = true; } wake(); });
  const pace = make("select", { title: "how fast it is played", onchange: () => { follows = false; wake(); } }, ...SPEEDS.map((each) => make("option", { value: each, textContent: `${each}×` })));
  pace.setAttribute("aria-label", "speed of playing");
  pace.value = 1;
  const scrub = slider("time", 0, 1000, 0, () => { playing = follows = caughtUp = false; now = first() + (last() - first()) * scrub.value / 1000; tellTime(); wake(); });
  const clock = make("span", { className: "rds-strip-clock" });
  const toggles = {};
  for (const [name, text, tip] of [["trail", "Trail", "Where the tool has been, coloured by its error"], ["ghost", "Model", "The modelled machine, translucent over the measured one"], ["work", "Part", "The finished part against the intended one: green as intended, orange too high, purple too low"]]) {
    toggles[name] = button(text, tip, () => { on[name] = !on[name]; stale = true; wake(); });
  }
  const on = { trail: true, ghost: false, work: false };
  const magnify = slider("errors magnified", 0, 300, 0, () => { stale = true; wake(); });
  const factor = () => Math.round(10 ** (magnify.value / 100));
  const times = make("span", { className: "rds-scene-times" });
  const read = make("p", { className: "rds-scene-read" });
  const bars = make("div", { className: "rds-scene-bars" }, make("div", { className: "rds-strip-bar" }, play, pace, scrub, clock),
    make("div", { className: "rds-strip-bar" }, ...Object.values(toggles), make("span", { textContent: "Errors" }), magnify, times, button("View", "The whole machine, or the part alone; drag to turn it, + and − to come nearer", () => { const { size, middle } = scene(); camera = camera?.near ? { yaw: 0.62, pitch: 0.42, far: 2.0 * size, middle } : null; wake(); })));
  el.append(opener, canvas, bars, read);

  function slider(label, min, max, value, act) {
    const made = make("input", { type: "range", min, max, value, title: label, oninput: act });
    made.setAttribute("aria-label", label);
    return made;
  }

  let painter = null, shapes = null, camera = null, failed = "";
  let columns = [], tips = [], wanted = [], errors = [], largest = 0; // by row, in the work's frame
  let now = 0, playing = false, caughtUp = false, follows = true, stale = true, due = 0, waits = 0, drawn = 0, before = 0, pictures = 0, turned = 0, told = -1;
  let stock = null, cutTo = 0, cutNow = true, intended = null;

  const first = () => (columns.length && columns[0].length ? columns[0][0] : 0);
  const last = () => (columns.length && columns[0].length ? columns[0][columns[0].length - 1] : 0);
  const scene = () => model.get("scene");
  const ink = (name, fallback) => getComputedStyle(el).getPropertyValue(name).trim() || fallback;
  const index = () => { const time = columns[0] || []; let low = 0, high = time.length; while (low < high) { const mid = (low + high) >> 1; if (time[mid] <= now + 1e-9) low = mid + 1; else high = mid; } return low - 1; };

  // joint values of a row: as measured, else modelled, else wanted; between two rows what is between
  function joints(kinds, row = index()) {
    const names = model.get("columns");
    return scene().joints.map((name) => {
      for (const kind of kinds) {
        const k = names.indexOf(`${name}_${kind}`);
        if (k < 0 || row < 0) continue;
        const values = columns[k + 1], time = columns[0], here = values[row];
        if (row + 1 >= values.length || arguments.length > 1) return here;
        const share = Math.min(Math.max((now - time[row]) / (time[row + 1] - time[row] || 1), 0), 1);
        return here + share * (values[row + 1] - here);
      }
      return 0;
    });
  }
  const MEASURED = ["measured", "modelled", "reference"], WANTED = ["reference", "measured", "modelled"], MODELLED = ["modelled", "measured", "reference"];

  // the tool of a row, by its column; a plain one where there are none
  const PLAIN = { radius: 3, profile: [0, 0], length: 0, rings: [[0, 0], [3, 0]] };
  function toolAt(row) {
    const k = model.get("columns").indexOf("tool"), tools = model.get("tools");
    return tools[k < 0 || row < 0 ? Object.keys(tools)[0] : columns[k + 1][row]] || PLAIN;
  }

  function follow(from) { // rows from there on are new
    const contour = model.get("columns").indexOf("contour_error") + 1;
    for (let i = from; i < columns[0].length; i++) {
      const is = tipOf(scene(), joints(MEASURED, i)), should = tipOf(scene(), joints(WANTED, i)), { length } = toolAt(i);
      is[2] -= length; should[2] -= length;
      tips.push(is);
      wanted.push(should);
      errors.push(contour ? Math.abs(columns[contour][i]) || 0 : Math.hypot(...is.map((value, k) => value - should[k])));
      largest = Math.max(largest, errors[i]);
    }
  }
  const color = (share) => { const [a, b, part] = share < 0.5 ? ["#0072B2", "#E69F00", 2 * share] : ["#E69F00", "#D55E00", 2 * share - 1]; const from = rgb(a), to = rgb(b); return from.map((value, i) => value + part * (to[i] - value)); };

  function prepare() {
    painter = new Painter(canvas);
    shapes = { box: boxShape(painter), prism: prismShape(painter), trail: painter.shape(new Float32Array(0), null, new Float32Array(0)), wanted: painter.shape(new Float32Array(0)), stock: null, tools: new Map() };
  }
  function lathe(tool, above) { // a tool as it is drawn, up to where the spindle holds it
    if (!shapes.tools.has(tool)) { const rings = tool.rings, r = rings[rings.length - 1][0]; shapes.tools.set(tool, latheShape(painter, [...rings, [r, Math.max(above + tool.length, rings[rings.length - 1][1])]])); }
    return shapes.tools.get(tool);
  }
  function trail(until) {
    const step = Math.ceil((until + 1) / MOST_TRAIL) || 1, magnified = factor(), points = [], tints = [], plain = [];
    for (let i = 0; i <= until; i += step) {
      points.push(...wanted[i].map((value, k) => value + magnified * (tips[i][k] - value)));
      tints.push(...color(errors[i] / (largest || 1)));
      plain.push(...wanted[i]);
    }
    painter.change(shapes.trail, new Float32Array(points), new Float32Array(tints));
    painter.change(shapes.wanted, new Float32Array(plain));
  }
  function cut(until) {
    if (until < cutTo) { stock.reset(); cutTo = 0; cutNow = true; }
    for (; cutTo < until; cutTo++) { stock.cut(tips[cutTo], tips[cutTo + 1], toolAt(cutTo + 1)); cutNow = true; }
    if (!cutNow && !stale) return;
    const [points, tints] = stock.points(on.work, rgb("#B9C2CC"));
    if (!shapes.stock) shapes.stock = painter.shape(points, stock.indices, tints);
    else painter.change(shapes.stock, points, tints);
    cutNow = false;
  }

  function draw() {
    const { size, middle } = scene(), ratio = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !scene().frames) return;
    if (canvas.width !== Math.round(width * ratio)) { canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio); }
    camera ||= stock ? { yaw: 0.5, pitch: 0.62, far: 3.2 * Math.max(...stock.high.map((value, i) => value - stock.low[i])), middle: stock.high.map((value, i) => (value + stock.low[i]) / 2), near: true } : { yaw: 0.62, pitch: 0.42, far: 2.0 * size, middle };
    const row = index(), values = joints(MEASURED), frames = framesOf(scene(), values), dark = Boolean(el.closest(".rds-dark"));
    const { view, light } = viewFrom(camera, width / height);
    painter.begin(view, rgb(dark ? "#14181d" : "#f4f6f8"), light);
    if (row >= 0 && (stale || row !== drawnRow)) trail(row);
    if (stock && row >= 0) cut(row);
    drawnRow = row;
    body(frames, 1);
    const work = frames[scene().work];
    if (stock && shapes.stock) {
      painter.draw(shapes.stock, work, [0.7, 0.7, 0.7]);
      const [wide, deep] = [0, 1].map((i) => stock.high[i] - stock.low[i]), tall = stock.low[2] - scene().table; // what it is clamped on
      if (tall > 0) painter.draw(shapes.box, product(work, [0.8 * wide, 0, 0, stock.low[0] + wide / 2, 0, 0.8 * deep, 0, stock.low[1] + deep / 2, 0, 0, tall, stock.low[2] - tall / 2, 0, 0, 0, 1]), rgb("#6F7F90"));
    }
    if (on.trail && row > 0) {
      painter.draw(shapes.wanted, work, rgb(dark ? "#a9b4bf" : "#57606a"), 1, "line");
      painter.draw(shapes.trail, work, [1, 1, 1], 1, "line");
    }
    if (on.ghost && row >= 0) {
      const is = values, model_ = joints(MODELLED), magnified = factor();
      body(framesOf(scene(), is.map((value, k) => value + magnified * (model_[k] - value))), 0.28);
    }
    stale = false;
    pictures += 1;
    say(row, values);
  }
  let drawnRow = -1;

  function body(frames, alpha) {
    const tool = toolAt(index()), ghost = alpha < 1 && rgb("#D55E00");
    for (const { frame, kind, size, at: place, color: hex, spins, tool: isTool, along: axis } of scene().solids) {
      let made = product(frames[frame], shifted(...place));
      if (spins) made = product(made, turnedAbout(2, turned));
      if (axis === 0 || axis === 1) made = product(made, turnedAbout(1 - axis, Math.PI / 2));
      if (isTool) { painter.draw(lathe(tool, size[1]), product(made, shifted(0, 0, -tool.length)), ghost || rgb(hex), alpha); continue; }
      const edges = kind === "box" ? size : [size[0], size[0], size[1]];
      painter.draw(shapes[kind], product(made, [edges[0], 0, 0, 0, 0, edges[1], 0, 0, 0, 0, edges[2], 0, 0, 0, 0, 1]), ghost || rgb(hex), alpha);
    }
    for (const arm of scene().arms) {
      const a = frames[arm.from], b = frames[arm.to], from = [a[3], a[7], a[11]], way = [b[3] - from[0], b[7] - from[1], b[11] - from[2]], long = Math.hypot(...way);
      if (long > 1e-6) painter.draw(shapes.box, arm_(from, way, long, arm.width), ghost || rgb(arm.color), alpha);
    }
  }
  function arm_(from, way, long, width) { // a box from a point along a way
    const z = way.map((value) => value / long), side = Math.abs(z[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0];
    let x = [side[1] * z[2] - side[2] * z[1], side[2] * z[0] - side[0] * z[2], side[0] * z[1] - side[1] * z[0]];
    x = x.map((value) => value / Math.hypot(...x));
    const y = [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]], middle = from.map((value, i) => value + way[i] / 2);
    return [0, 1, 2].flatMap((i) => [x[i] * width, y[i] * width, z[i] * long, middle[i]]).concat([0, 0, 0, 1]);
  }

  function say(row, values) {
    const state = follows && model.get("live") ? "live" : playing ? `${pace.value}×` : "paused";
    clock.textContent = `${now.toFixed(2)} s, ${state}`;
    play.textContent = playing ? "Pause" : "Play";
    times.textContent = `×${factor()}`;
    for (const [name, each] of Object.entries(toggles)) each.setAttribute("aria-pressed", String(on[name]));
    toggles.work.style.display = stock ? "" : "none";
    if (last() > first() && document.activeElement !== scrub) scrub.value = 1000 * (now - first()) / (last() - first());
    const parts = scene().joints.map((name, k) => `${name} ${values[k].toFixed(3)}${scene().turns[k] ? "°" : " mm"}`);
    const error = row >= 0 ? errors[row] : 0, micro = (value) => `${(1000 * value).toPrecision(3)} µm`;
    let said = row < 0 ? "Nothing has moved yet." : `${parts.join(", ")}. Error ${micro(error)}; the trail goes from blue (0) to vermillion (${micro(largest)}), the grey line is the reference.`;
    if (stock && row >= 0) {
      const { gone, over, under } = on.work || !playing ? stock.numbers() : { gone: NaN };
      if (!Number.isNaN(gone)) { said += ` Cut: ${gone.toFixed(0)} mm³`; said += stock.target ? `; against the intended part at most ${over.toFixed(3)} mm too high, ${under.toFixed(3)} mm too low, walls to a cell of ${stock.cell.toFixed(2)} mm.` : "."; el.dataset.cut = gone.toFixed(1); el.dataset.over = over.toFixed(4); el.dataset.under = under.toFixed(4); }
    }
    if (read.textContent !== said) read.textContent = said;
    canvas.setAttribute("aria-label", `the machine at ${now.toFixed(1)} s`);
    Object.assign(el.dataset, { now: now.toFixed(3), pictures, rows: tips.length, state, magnified: factor(), error: error.toPrecision(4), soft: painter.soft, tip: row >= 0 ? tipOf(scene(), values).map((value) => value.toFixed(3)).join(" ") : "" });
  }

  // time, shared with the strip beside it
  const home = () => el.closest(".rds-live") || el;
  function tellTime() { if (Math.abs(now - told) > 0.02) { told = now; home().dispatchEvent(new CustomEvent("rds-time", { detail: { from: "scene", time: now } })); } }
  function heard({ detail }) { if (detail.from !== "scene" && model.get("shows")) { playing = follows = caughtUp = false; now = Math.min(Math.max(detail.time, first()), last()); wake(); } }

  function frame(time) {
    due = 0;
    if (!model.get("shows") || !el.isConnected) return;
    if (!canvas.clientWidth) { stale = true; return; } // out of sight: drawn when it has a size again
    const passed = Math.min((time - before) / 1000, 0.25);
    before = drawn = time;
    const live = model.get("live") && follows;
    if (live) { now = Math.min(now + passed, last()); if (last() - now > 3 * BEHIND) now = last() - BEHIND; }
    else if (playing && tips.length) { now = Math.min(now + passed * Number(pace.value), last()); if (now >= last()) { playing = false; caughtUp = true; } }
    const k = model.get("columns").findIndex((name) => name.startsWith(`${scene().spindle}_`)), row = index();
    if (scene().spindle && k >= 0 && row >= 0) turned += 2 * Math.PI * columns[k + 1][row] / 60 / SLOWER * passed;
    try { if (!painter) prepare(); draw(); } catch (error) { failed = String(error.message || error); read.textContent = `The machine cannot be drawn: ${failed}`; return; }
    if (playing) tellTime();
    if (playing || (live && now < last())) wake();
  }
  function wake() {
    if (due || waits || failed) return;
    const left = painter?.soft ? SOFT_MS - FRAME_MS - (performance.now() - drawn) : 0;
    if (left > 0) waits = setTimeout(() => { waits = 0; wake(); }, left); // frames that draw nothing cost, too
    else due = requestAnimationFrame(frame);
  }
  function setOpen(open) { model.set("shows", open); model.save_changes(); shown(); if (open) model.send({ kind: "all" }); }
  function shown() {
    const open = model.get("shows");
    opener.textContent = open ? "Hide the machine" : "Show the machine";
    for (const each of [canvas, bars, read]) each.style.display = open ? "" : "none";
    el.dataset.open = open;
    if (open) { stale = true; wake(); }
  }

  function clear() { columns = []; tips = []; wanted = []; errors = []; largest = 0; now = 0; cutTo = 0; drawnRow = -1; turned = 0; follows = true; caughtUp = false; playing = !model.get("live"); if (stock) stock.reset(); cutNow = stale = true; }
  function receive(message, buffers) {
    if (message.kind === "clear") clear();
    if (message.kind === "rows") {
      const view = buffers[0], values = new Float64Array(view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength)), width = message.width;
      if (columns.length !== width) columns = Array.from({ length: width }, () => []);
      const from = columns[0].length, empty = !from;
      for (let i = 0; i < values.length; i += width) for (let j = 0; j < width; j++) columns[j].push(values[i + j]);
      if (empty) now = first();
      follow(from);
      if (caughtUp && !model.get("live")) { caughtUp = false; playing = true; } // what is simulated goes on
    }
    if (message.kind === "intended") { const view = buffers[0]; intended = new Float32Array(view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength)); compare(); }
    wake();
  }
  function compare() { if (stock && intended) { stock.intend(intended); cutNow = stale = true; } }
  function restock() {
    const given = model.get("stock");
    stock = given && given.low ? new Stock(given) : null;
    camera = null;
    if (shapes) { shapes.stock = null; shapes.tools.clear(); }
    cutTo = 0;
    compare();
    stale = true;
    wake();
  }

  // the camera
  let grip = null;
  canvas.addEventListener("pointerdown", (event) => { grip = [event.clientX, event.clientY]; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointerup", () => { grip = null; });
  canvas.addEventListener("pointermove", (event) => { if (grip && camera) { turn((event.clientX - grip[0]) / 150, (event.clientY - grip[1]) / 150); grip = [event.clientX, event.clientY]; } });
  canvas.addEventListener("wheel", (event) => { if (!camera || !(event.ctrlKey || document.activeElement === canvas)) return; event.preventDefault(); camera.far *= Math.exp(event.deltaY / 800); wake(); }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const [yaw, pitch, nearer] = { ArrowLeft: [-0.1, 0, 1], ArrowRight: [0.1, 0, 1], ArrowUp: [0, -0.1, 1], ArrowDown: [0, 0.1, 1], "+": [0, 0, 0.9], "-": [0, 0, 1.1] }[event.key] || [];
    if (!nearer || !camera) return;
    event.preventDefault();
    camera.far *= nearer;
    turn(yaw, -pitch);
  });
  function turn(yaw, pitch) { camera.yaw -= yaw; camera.pitch = Math.min(Math.max(camera.pitch + pitch, -1.5), 1.5); wake(); }

  model.on("msg:custom", receive);
  model.on("change:stock change:tools", restock);
  model.on("change:scene", () => { camera = null; clear(); wake(); });
  model.on("change:shows", shown);
  const sized = new ResizeObserver(() => { stale = true; wake(); });
  sized.observe(canvas);
  const themed = new MutationObserver(() => { stale = true; wake(); });
  const app = document.querySelector(".rds-app");
  if (app) themed.observe(app, { attributes: true, attributeFilter: ["class"] });
  // shown from the start where a graphics card draws it, once
  function greet() {
    if (model.get("asked")) return;
    model.set("asked", true);
    const gl = document.createElement("canvas").getContext("webgl2"), about = gl?.getExtension("WEBGL_debug_renderer_info");
    const drawnBy = about ? gl.getParameter(about.UNMASKED_RENDERER_WEBGL) : "";
    gl?.getExtension("WEBGL_lose_context")?.loseContext();
    if (drawnBy && !SOFTWARE.test(drawnBy)) setOpen(true);
    else model.save_changes();
  }
  let place = null;
  const begun = requestAnimationFrame(() => { place = home(); place.addEventListener("rds-time", heard); restock(); greet(); shown(); if (model.get("shows")) model.send({ kind: "all" }); });
  return () => { cancelAnimationFrame(begun); cancelAnimationFrame(due); clearTimeout(waits); sized.disconnect(); themed.disconnect(); model.off("msg:custom", receive); place?.removeEventListener("rds-time", heard); painter?.gl.getExtension("WEBGL_lose_context")?.loseContext(); };
}

export default { render };
