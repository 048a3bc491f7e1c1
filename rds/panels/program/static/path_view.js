// A part program's path from one side: rapids, straight feeds, arcs, travel limits, what is beyond them, and the tool.
// Points come once for each program, the tool ten times a second; which side is shown is the page's own affair.

const VIEWS = { XY: [0, 1], YZ: [1, 2], ZX: [0, 2] };
const KINDS = [ // colours of Okabe and Ito, on light and on dark; line styles differ as well
  { colors: ["#D55E00", "#E69F00"], dash: [6, 4], width: 1.2, label: "rapid" },
  { colors: ["#0072B2", "#56B4E9"], dash: [], width: 1.6, label: "straight feed" },
  { colors: ["#009E73", "#1FC79A"], dash: [], width: 2.4, label: "arc feed" },
];

function render({ model, el }) {
  const box = document.createElement("div");
  box.className = "rds-path";
  const bar = document.createElement("div");
  bar.className = "rds-path-bar";
  const canvas = document.createElement("canvas");
  canvas.setAttribute("role", "img");
  const legend = document.createElement("p");
  legend.className = "rds-path-legend";
  box.append(bar, canvas, legend);
  el.append(box);

  let parts = [], beyond = new Float32Array(0), frame = 0;
  let whole = false; // the whole travel, or the path alone
  const buttons = Object.keys(VIEWS).map((name) => button(name, `Seen along ${"XYZ".replace(name[0], "").replace(name[1], "")}`, () => { model.set("side", name); model.save_changes(); }));
  const wide = button("Whole travel", "Show all of the machine's travel, or the path alone", () => { whole = !whole; redraw(); });
  bar.append(...buttons, wide);
  const samples = KINDS.map((kind) => {
    const item = document.createElement("span");
    item.innerHTML = `<svg width="28" height="8" aria-hidden="true"><line x1="0" x2="28" y1="4" y2="4" stroke-width="${kind.width + 0.6}" stroke-dasharray="${kind.dash}"/></svg> ${kind.label}`;
    legend.append(item);
    return item.querySelector("line");
  });
  for (const [sign, words] of [["○", "start"], ["■", "end"], ["✕", "beyond the travel"], ["◎", "tool"], ["┄", "travel limits"]]) {
    const item = document.createElement("span");
    item.textContent = `${sign} ${words}`;
    legend.append(item);
  }

  function button(text, tip, act) {
    const made = document.createElement("button");
    Object.assign(made, { textContent: text, title: tip, type: "button", onclick: act });
    return made;
  }
  const ink = (name) => getComputedStyle(el).getPropertyValue(name).trim();

  function frameOf(axis) {
    const low = model.get("low"), high = model.get("high"), travel = model.get("travel");
    if (whole || low.length < 3) return [travel[axis][0], travel[axis][1]];
    return [low[axis], high[axis]];
  }

  function draw() {
    frame = 0;
    const width = canvas.clientWidth, height = model.get("height"), ratio = window.devicePixelRatio || 1;
    if (!width) return;
    canvas.width = width * ratio; canvas.height = height * ratio; canvas.style.height = `${height}px`;
    const dark = Boolean(el.closest(".rds-dark"));
    const side = model.get("side"), [across, up] = VIEWS[side], pen = canvas.getContext("2d");
    buttons.forEach((each) => each.setAttribute("aria-pressed", String(each.textContent === side)));
    wide.setAttribute("aria-pressed", String(whole));
    pen.scale(ratio, ratio);
    pen.clearRect(0, 0, width, height);
    const left = 50, right = 14, bottom = 34, top = 10;
    const [x0, x1] = frameOf(across), [y0, y1] = frameOf(up);
    const span = Math.max(x1 - x0, 1e-3), rise = Math.max(y1 - y0, 1e-3), margin = 0.06 * Math.max(span, rise);
    const scale = Math.min((width - left - right) / (span + 2 * margin), (height - top - bottom) / (rise + 2 * margin));
    const cx = (x0 + x1) / 2, cy = (y0 + y1) / 2, mx = (left + width - right) / 2, my = (top + height - bottom) / 2;
    const X = (v) => mx + (v - cx) * scale, Y = (v) => my - (v - cy) * scale;
    axes(pen, { left, right: width - right, top, bottom: height - bottom, X, Y, scale, cx, cy, mx, my, across, up });
    pen.save();
    pen.beginPath(); pen.rect(left, top, width - left - right, height - top - bottom); pen.clip();
    const travel = model.get("travel");
    stroke(pen, ink("--rds-quiet"), [8, 3, 2, 3], 1);
    pen.strokeRect(X(travel[across][0]), Y(travel[up][1]), (travel[across][1] - travel[across][0]) * scale, (travel[up][1] - travel[up][0]) * scale);
    parts.forEach((points, kind) => {
      const color = KINDS[kind].colors[dark ? 1 : 0];
      samples[kind].setAttribute("stroke", color);
      stroke(pen, color, KINDS[kind].dash, KINDS[kind].width);
      pen.beginPath();
      let on = false;
      for (let i = 0; i < points.length; i += 3) {
        const u = points[i + across], v = points[i + up];
        if (Number.isNaN(u)) { on = false; continue; }
        if (on) pen.lineTo(X(u), Y(v)); else pen.moveTo(X(u), Y(v));
        on = true;
      }
      pen.stroke();
    });
    const text = ink("--rds-text"), ends = model.get("ends");
    stroke(pen, text, [], 1.6);
    pen.fillStyle = text;
    if (ends.length === 2) {
      circle(pen, X(ends[0][across]), Y(ends[0][up]), 6);
      pen.fillRect(X(ends[1][across]) - 3, Y(ends[1][up]) - 3, 6, 6);
    }
    stroke(pen, ink("--rds-error"), [], 2);
    for (let i = 0; i < beyond.length; i += 3) cross(pen, X(beyond[i + across]), Y(beyond[i + up]));
    const tool = model.get("tool");
    if (tool.length === 3) {
      stroke(pen, "#CC79A7", [], 2.5);
      circle(pen, X(tool[across]), Y(tool[up]), 8);
      pen.beginPath(); pen.arc(X(tool[across]), Y(tool[up]), 2, 0, 7); pen.fillStyle = "#CC79A7"; pen.fill();
    }
    pen.restore();
    canvas.setAttribute("aria-label", `${side} view of the path; ${model.get("sentence")}`);
    box.dataset.points = parts.reduce((sum, points) => sum + points.length / 3, 0);
    box.dataset.beyond = beyond.length / 3;
    box.dataset.tool = tool.length === 3 ? tool.map((value) => value.toFixed(3)).join(" ") : "";
  }
  function stroke(pen, color, dash, width) { pen.strokeStyle = color; pen.setLineDash(dash); pen.lineWidth = width; }
  function circle(pen, x, y, r) { pen.beginPath(); pen.arc(x, y, r, 0, 7); pen.stroke(); }
  function cross(pen, x, y) { pen.beginPath(); pen.moveTo(x - 5, y - 5); pen.lineTo(x + 5, y + 5); pen.moveTo(x - 5, y + 5); pen.lineTo(x + 5, y - 5); pen.stroke(); }

  function axes(pen, f) {
    pen.font = "12px system-ui, sans-serif";
    pen.fillStyle = ink("--rds-text");
    const step = nice(70 / f.scale), stepUp = nice(40 / f.scale);
    stroke(pen, ink("--rds-grid"), [], 1);
    pen.textAlign = "center"; pen.textBaseline = "top";
    for (let v = Math.ceil((f.cx - (f.mx - f.left) / f.scale) / step) * step; f.X(v) <= f.right; v += step) {
      line(pen, f.X(v), f.top, f.X(v), f.bottom); pen.fillText(plain(v, step), f.X(v), f.bottom + 3);
    }
    pen.textAlign = "right"; pen.textBaseline = "middle";
    for (let v = Math.ceil((f.cy - (f.bottom - f.my) / f.scale) / stepUp) * stepUp; f.Y(v) >= f.top; v += stepUp) {
      line(pen, f.left, f.Y(v), f.right, f.Y(v)); pen.fillText(plain(v, stepUp), f.left - 4, f.Y(v));
    }
    pen.textAlign = "center"; pen.textBaseline = "bottom";
    pen.fillText(`${"XYZ"[f.across]} [mm]`, (f.left + f.right) / 2, f.bottom + 33);
    pen.save(); pen.translate(12, (f.top + f.bottom) / 2); pen.rotate(-Math.PI / 2); pen.textBaseline = "middle";
    pen.fillText(`${"XYZ"[f.up]} [mm]`, 0, 0); pen.restore();
  }
  function line(pen, a, b, c, d) { pen.beginPath(); pen.moveTo(a, b); pen.lineTo(c, d); pen.stroke(); }
  function nice(least) { const base = 10 ** Math.floor(Math.log10(least)); return [1, 2, 5, 10].map((m) => m * base).find((m) => m >= least * 0.999); }
  function plain(value, step) { return value.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9))).replace(/^-(0(\.0*)?)$/, "$1"); }

  const redraw = () => { frame = frame || requestAnimationFrame(draw); };
  const floats = (view) => new Float32Array(view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength));
  function receive(message, buffers) {
    if (message.kind !== "points") return;
    parts = buffers.slice(0, 3).map(floats);
    beyond = floats(buffers[3]);
    redraw();
  }
  model.on("msg:custom", receive);
  for (const name of ["side", "low", "high", "travel", "ends", "tool"]) model.on(`change:${name}`, redraw);
  const sized = new ResizeObserver(redraw);
  sized.observe(canvas);
  const themed = new MutationObserver(redraw);
  themed.observe(document.body, { attributes: true, attributeFilter: ["class", "data-jp-theme-light"] });
  const app = document.querySelector(".rds-app");
  if (app) themed.observe(app, { attributes: true, attributeFilter: ["class"] });
  model.send({ kind: "all" });
  redraw();
  return () => { sized.disconnect(); themed.disconnect(); model.off("msg:custom", receive); };
}

export default { render };
