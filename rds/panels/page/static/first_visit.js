// An axis that follows a sine, and its error: one period of samples, shown again and again while it is in sight.

const FRAME_MS = 50;
const NS = "http://www.w3.org/2000/svg";

function render({ model, el }) {
  const svg = document.createElementNS(NS, "svg");
  svg.setAttribute("viewBox", "0 0 640 132");
  svg.setAttribute("role", "img");
  svg.classList.add("rds-alive");
  el.append(svg);
  const add = (tag, attributes, text) => {
    const made = document.createElementNS(NS, tag);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text) made.textContent = text;
    svg.append(made);
    return made;
  };
  let rows = [], timer = 0, at = 0, parts = null;

  function build() {
    svg.replaceChildren();
    const axis = model.get("axis"), unit = model.get("unit");
    const top = Math.max(...rows.map((row) => Math.abs(row[1]))) * 1.15, most = Math.max(...rows.map((row) => Math.abs(row[3]))) * 1.2 || 1;
    const x = (value) => 120 + 100 * value / top, along = (i) => 270 + 360 * i / (rows.length - 1);
    svg.setAttribute("aria-label", `The ${axis} axis follows a sine of ${(top / 1.15).toPrecision(2)} ${unit}, simulated; its error stays below ${(most / 1.2).toPrecision(2)} ${unit}`);
    add("rect", { x: 10, y: 74, width: 220, height: 10, rx: 3, class: "rds-alive-rail" });
    add("text", { x: 10, y: 16 }, `${axis} axis, simulated`);
    const wanted = add("path", { d: "M0 50l-6 -11h12z", class: "rds-alive-wanted" });
    const table = add("rect", { x: -30, y: 56, width: 60, height: 20, rx: 4, class: "rds-alive-table" });
    const line = (k, middle, scale, kind) => add("path", { class: kind, d: rows.map((row, i) => `${i ? "L" : "M"}${along(i).toFixed(1)} ${(middle - row[k] * scale).toFixed(1)}`).join("") });
    add("text", { x: 270, y: 16 }, `reference and measured position [${unit}]`);
    line(1, 45, 22 / top, "rds-alive-reference");
    line(2, 45, 22 / top, "rds-alive-measured");
    add("text", { x: 270, y: 86 }, `error [${unit}], up to ${(most / 1.2).toPrecision(2)}`);
    line(3, 110, 18 / most, "rds-alive-error");
    const now = add("path", { d: "M0 22V130", class: "rds-alive-now" });
    parts = { wanted, table, now, x, along };
    show();
  }
  function show() {
    const row = rows[at];
    parts.wanted.setAttribute("transform", `translate(${parts.x(row[1]).toFixed(1)} 0)`);
    parts.table.setAttribute("transform", `translate(${parts.x(row[2]).toFixed(1)} 0)`);
    parts.now.setAttribute("transform", `translate(${parts.along(at).toFixed(1)} 0)`);
    el.dataset.at = at;
  }
  function step() {
    if (!rows.length || !el.isConnected || !svg.clientWidth || document.hidden) return;
    at = (at + Math.round(FRAME_MS / 1000 * (rows.length / (rows[rows.length - 1][0] || 1)))) % rows.length;
    show();
  }
  function receive(message, buffers) {
    if (message.kind !== "rows") return;
    const view = buffers[0], values = new Float64Array(view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength));
    rows = [];
    for (let i = 0; i < values.length; i += 4) rows.push(values.slice(i, i + 4));
    build();
    clearInterval(timer);
    if (!matchMedia("(prefers-reduced-motion: reduce)").matches) timer = setInterval(step, FRAME_MS);
  }
  model.on("msg:custom", receive);
  requestAnimationFrame(() => model.send({ kind: "here" }));
  return () => { clearInterval(timer); model.off("msg:custom", receive); };
}

export default { render };
