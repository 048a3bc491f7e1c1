// The s-plane: poles that are dragged by mouse, finger or arrow keys. Units: 1/s across, rad/s up.
// The kernel says where poles are and why one cannot be somewhere; the page only proposes places.

const SVG = "http://www.w3.org/2000/svg";
const TELL_MS = 60; // between proposals while a pole is dragged
const MARGIN = { left: 58, right: 12, top: 12, bottom: 40 };

function render({ model, el }) {
  const box = make("div", "rds-splane");
  const bar = make("div", "rds-splane-bar");
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("role", "group");
  svg.setAttribute("aria-label", "s-plane: poles can be moved with the arrow keys");
  box.append(svg, bar);
  el.append(box);
  let view = null; // centre (x, y) and units per pixel; the width that this is for, and what was fitted, or null: by hand
  let dragged = null; // name of the pole that is being moved, and where it is proposed
  let asked = 0, waiting = null, shownKind = "";

  const buttons = [["Fit poles", "Show the poles of the error", () => fit(false)], ["Fit all", "Show the observer's pole too", () => fit(true)],
    ["+", "Closer", () => zoom(0.7)], ["−", "Further away", () => zoom(1 / 0.7)]];
  for (const [text, tip, act] of buttons) {
    const button = make("button");
    Object.assign(button, { textContent: text, title: tip, type: "button", onclick: () => { act(); draw(); } });
    if (text.length === 1) button.setAttribute("aria-label", tip); // a sign
    bar.append(button);
  }
  const hint = make("span", "rds-splane-hint");
  hint.textContent = "Drag a pole, or use the arrow keys (Shift: 10, Alt: 0.1). Circles: rad/s; rays: damping ratio ζ. Dashed: limit of the sample period. Small crosses: the loop's poles over the cloud.";
  bar.append(hint);

  function make(tag, name = "") { const made = document.createElement(tag); made.className = name; return made; }
  function shape(tag, attributes, parent = svg, text = "") {
    const made = document.createElementNS(SVG, tag);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text) made.textContent = text;
    parent.append(made);
    return made;
  }
  const width = () => Math.max(box.clientWidth, 320);
  const height = () => model.get("height");
  const inner = () => ({ w: width() - MARGIN.left - MARGIN.right, h: height() - MARGIN.top - MARGIN.bottom });
  const px = (x) => MARGIN.left + inner().w / 2 + (x - view.x) / view.scale;
  const py = (y) => MARGIN.top + inner().h / 2 - (y - view.y) / view.scale;
  const at = (event) => {
    const rect = svg.getBoundingClientRect();
    return [view.x + (event.clientX - rect.left - MARGIN.left - inner().w / 2) * view.scale,
      view.y - (event.clientY - rect.top - MARGIN.top - inner().h / 2) * view.scale];
  };
  const place = (pole) => (dragged && dragged.name === pole.name ? [dragged.re, dragged.im] : [pole.re, pole.im]);

  function fit(all) {
    const poles = model.get("poles").filter((pole) => all || pole.name !== "observer");
    const left = Math.min(-10, ...poles.map((pole) => pole.re)) * (all ? 1.15 : 1.9);
    const high = Math.max(5, ...poles.map((pole) => Math.abs(pole.im))) * 1.5;
    const right = -0.18 * left;
    const scale = Math.max((right - left) / inner().w, (2 * high) / inner().h);
    view = { x: right - (scale * inner().w) / 2, y: 0, scale, width: inner().w, all };
  }
  function zoom(factor) { view.scale = Math.min(Math.max(view.scale * factor, 1e-4), 1e3); view.x *= factor; view.all = null; }
  function fitWidth() { // what was seen across stays in sight when the page is made narrower or wider
    if (view.all !== null) fit(view.all);
    else { view.scale *= view.width / inner().w; view.width = inner().w; }
  }

  const step = (span, count) => {
    const rough = span / count, power = 10 ** Math.floor(Math.log10(rough));
    return power * [1, 2, 5, 10].find((nice) => nice * power >= rough);
  };

  function draw() {
    if (!view) fit(false);
    else if (view.width !== inner().w) fitWidth();
    const focus = document.activeElement && svg.contains(document.activeElement) ? document.activeElement.dataset.pole : null;
    const { w, h } = inner();
    svg.setAttribute("width", width()); svg.setAttribute("height", height());
    svg.replaceChildren();
    const clip = shape("clipPath", { id: "rds-splane-clip" });
    shape("rect", { x: MARGIN.left, y: MARGIN.top, width: w, height: h }, clip);
    const plot = shape("g", { "clip-path": "url(#rds-splane-clip)" });
    const half = { x: (w / 2) * view.scale, y: (h / 2) * view.scale };
    grid(plot, half, w, h);
    limit(plot);
    cloud(plot);
    shape("rect", { x: MARGIN.left, y: MARGIN.top, width: w, height: h, class: "rds-splane-frame" });
    for (const pole of model.get("poles")) marks(pole);
    if (focus) { const again = svg.querySelector(`[data-pole="${focus}"]`); if (again) again.focus(); }
  }

  function grid(plot, half, w, h) {
    const [x0, x1] = [view.x - half.x, view.x + half.x], [y0, y1] = [view.y - half.y, view.y + half.y];
    if (x1 > 0) {
      shape("rect", { x: px(0), y: MARGIN.top, width: Math.max(px(x1) - px(0), 0), height: h, class: "rds-splane-unstable" }, plot);
      shape("text", { x: 0, y: 0, "text-anchor": "end", class: "rds-splane-note", transform: `translate(${px(0) + 16} ${MARGIN.top + 8}) rotate(-90)` }, plot, "unstable");
    }
    const tick = step(Math.min(x1 - x0, y1 - y0), 5);
    for (let r = tick; r < Math.hypot(Math.max(-x0, x1), Math.max(Math.abs(y0), y1)) && r < 60 * tick; r += tick)
      shape("path", { d: `M${px(0)} ${py(r)}A${r / view.scale} ${r / view.scale} 0 0 0 ${px(0)} ${py(-r)}`, class: "rds-splane-grid" }, plot);
    for (const damping of [0.3, 0.5, 0.7, 0.9]) {
      const far = 4 * (half.x + half.y), x = -far * damping, y = far * Math.sqrt(1 - damping ** 2);
      for (const side of [1, -1]) shape("path", { d: `M${px(0)} ${py(0)}L${px(x)} ${py(side * y)}`, class: "rds-splane-grid" }, plot);
      const reach = 0.86 * Math.min(-x0, y1); // one circle, on which the labels keep apart
      if (reach > 60 * view.scale) shape("text", { x: px(-reach * damping) + 3, y: py(reach * Math.sqrt(1 - damping ** 2)) + 4, class: "rds-splane-note" }, plot, `ζ ${damping}`);
    }
    shape("path", { d: `M${px(x0)} ${py(0)}H${px(x1)}M${px(0)} ${MARGIN.top}V${MARGIN.top + h}`, class: "rds-splane-axis" }, plot);
    const middle = MARGIN.top + h;
    for (let x = Math.ceil(x0 / tick) * tick; x <= x1; x += tick)
      shape("text", { x: px(x), y: middle + 16, "text-anchor": "middle", class: "rds-splane-tick" }, svg, number(x));
    for (let y = Math.ceil(y0 / tick) * tick; y <= y1; y += tick)
      shape("text", { x: MARGIN.left - 6, y: py(y) + 4, "text-anchor": "end", class: "rds-splane-tick" }, svg, number(y));
    shape("text", { x: MARGIN.left + w / 2, y: height() - 6, "text-anchor": "middle", class: "rds-splane-tick" }, svg, "real part [1/s]");
    shape("text", { x: 14, y: MARGIN.top + h / 2, "text-anchor": "middle", class: "rds-splane-tick", transform: `rotate(-90 14 ${MARGIN.top + h / 2})` }, svg, "imaginary part [rad/s]");
  }
  const number = (value) => String(Number(value.toPrecision(6))).replace("-", "−");

  function limit(plot) {
    const points = model.get("limit");
    if (!points.length) return;
    const upper = points.map(([x, y]) => `${px(x)} ${py(y)}`), lower = points.map(([x, y]) => `${px(x)} ${py(-y)}`).reverse();
    shape("path", { d: `M${upper.join("L")}L${lower.join("L")}`, class: "rds-splane-limit" }, plot);
  }
  function cloud(plot) {
    const points = model.get("cloud");
    const d = points.map(([x, y]) => `M${px(x) - 2} ${py(y)}h4m-2 -2v4`).join("");
    if (d) shape("path", { d, class: "rds-splane-cloud" }, plot);
  }

  function marks(pole) {
    const [re, im] = place(pole), pair = pole.name === "pair";
    const refused = dragged && dragged.name === pole.name && model.get("refused");
    (pair ? [im, -im] : [im]).forEach((y, copy) => {
      const edge = MARGIN.left + 10, x = Math.max(px(re), edge), out = px(re) < edge;
      const spot = Math.min(Math.max(py(y), MARGIN.top + 8), MARGIN.top + inner().h - 8);
      const group = shape("g", { class: `rds-splane-pole rds-splane-${pole.name}${refused ? " rds-splane-refused" : ""}`, "data-pole": copy ? "" : pole.name, transform: `translate(${x} ${spot})` });
      shape("rect", { x: -15, y: -15, width: 30, height: 30, class: "rds-splane-grip" }, group);
      if (out) shape("path", { d: "M4 -7L-6 0L4 7", class: "rds-splane-mark" }, group);
      else if (pole.name === "observer") shape("path", { d: "M0 -8L8 0L0 8L-8 0Z", class: "rds-splane-mark" }, group);
      else shape("path", { d: "M-7 -7L7 7M-7 7L7 -7", class: "rds-splane-mark" }, group);
      const label = pole.name === "observer" ? `observer ${number(Number(re.toPrecision(4)))}` : refused ? "refused" : "";
      if (label && !copy) shape("text", { x: out ? 10 : 12, y: -10, class: "rds-splane-note" }, group, label);
      group.addEventListener("pointerdown", (event) => grab(event, pole, copy));
      if (copy) return;
      group.setAttribute("tabindex", "0");
      group.setAttribute("role", "slider");
      group.setAttribute("aria-label", pole.label);
      group.setAttribute("aria-valuenow", re.toPrecision(5));
      group.setAttribute("aria-valuetext", pair ? `${re.toPrecision(4)} ± ${im.toPrecision(4)} i, 1/s` : `${re.toPrecision(5)} 1/s`);
      group.addEventListener("keydown", (event) => key(event, pole));
    });
  }

  function grab(event, pole, copy) {
    event.preventDefault();
    const first = svg.querySelector(`[data-pole="${pole.name}"]`);
    if (first) first.focus();
    const [x, y] = at(event), sign = copy ? -1 : 1, off = px(pole.re) < MARGIN.left + 10 ? [0, 0] : [pole.re - x, pole.im - sign * y];
    let moved = false;
    const move = (now) => {
      const [mx, my] = at(now);
      if (!moved && Math.hypot(mx - x, my - y) < 2 * view.scale) return;
      moved = true;
      const im = pole.name === "pair" ? Math.max(sign * my + off[1], 0) : 0;
      dragged = { name: pole.name, re: round(mx + off[0]), im: Math.abs(im) < 4 * view.scale ? 0 : round(im) };
      tell(false);
      draw();
    };
    const drop = () => {
      document.removeEventListener("pointermove", move);
      document.removeEventListener("pointerup", drop);
      document.removeEventListener("pointercancel", drop);
      if (moved) tell(true);
    };
    document.addEventListener("pointermove", move);
    document.addEventListener("pointerup", drop);
    document.addEventListener("pointercancel", drop);
  }
  const round = (value) => { const unit = 10 ** Math.floor(Math.log10(view.scale)); return Number((Math.round(value / unit) * unit).toPrecision(12)); };

  const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  function key(event, pole) {
    const way = KEYS[event.key];
    if (!way || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    event.stopPropagation();
    const size = event.shiftKey ? 10 : event.altKey ? 0.1 : 1, [re, im] = place(pole);
    const up = pole.name === "pair" ? Math.max(im + way[1] * size, 0) : 0;
    dragged = { name: pole.name, re: Number((re + way[0] * size).toPrecision(12)), im: Number(up.toPrecision(12)) };
    tell(true);
    draw();
  }

  // at most every TELL_MS, and the last place always; `done`: the pole was let go
  function tell(done) {
    clearTimeout(waiting);
    const send = () => {
      asked = performance.now();
      model.send({ kind: "move", name: dragged.name, re: dragged.re, im: dragged.im, done });
    };
    const rest = TELL_MS - (performance.now() - asked);
    if (done || rest <= 0) send();
    else waiting = setTimeout(() => dragged && send(), rest);
  }

  function received(message) {
    if (message.kind === "settled") { clearTimeout(waiting); dragged = null; draw(); }
  }
  const changed = () => {
    const kind = model.get("poles").map((pole) => pole.name).join();
    if (kind !== shownKind) { shownKind = kind; view = null; }
    if (el.isConnected && box.clientWidth) draw();
  };
  model.on("msg:custom", received);
  for (const name of ["poles", "limit", "cloud", "refused"]) model.on(`change:${name}`, changed);
  const sized = new ResizeObserver(() => { if (box.clientWidth) changed(); });
  sized.observe(box);
  svg.addEventListener("wheel", (event) => { if (event.ctrlKey) { event.preventDefault(); zoom(event.deltaY > 0 ? 1.15 : 1 / 1.15); draw(); } }, { passive: false });
  return () => { sized.disconnect(); clearTimeout(waiting); model.off("msg:custom", received); model.off(null, changed); };
}

export default { render };
