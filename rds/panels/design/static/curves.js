// Curves beside each other, drawn again as often as they change: for numbers that follow a hand.
// `charts` comes from the kernel: title, axes with units, and series of x and y.

const SVG = "http://www.w3.org/2000/svg";
const LEAST = 245; // px of a chart: narrower, its title and its legend have no room beside each other
const MARGIN = { left: 56, right: 10, top: 24, bottom: 38 };

function render({ model, el }) {
  const box = document.createElement("div");
  box.className = "rds-curves";
  el.append(box);
  const shape = (tag, attributes, parent, text = "") => {
    const made = document.createElementNS(SVG, tag);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text) made.textContent = text;
    parent.append(made);
    return made;
  };
  const nice = (span, count) => {
    const rough = span / count || 1, power = 10 ** Math.floor(Math.log10(rough));
    return power * [1, 2, 5, 10].find((each) => each * power >= rough * 0.999);
  };
  const label = (value) => {
    if (value && (Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3)) return value.toExponential(0).replace("-", "−").replace("+", "");
    return String(Number(value.toPrecision(4))).replace("-", "−");
  };

  function bounds(chart, axis) {
    if (chart[`${axis}_range`]) return chart[`${axis}_range`];
    let low = Infinity, high = -Infinity;
    for (const series of chart.series) for (const value of series[axis]) if (value != null) { low = Math.min(low, value); high = Math.max(high, value); }
    if (!(low <= high)) return [0, 1];
    const pad = (high - low) * 0.06 || Math.abs(high) * 0.1 || 1;
    return axis === "y" ? [low - pad, high + pad] : [low, high];
  }

  function draw() {
    if (!el.isConnected || !box.clientWidth) return;
    box.replaceChildren();
    const charts = model.get("charts"), columns = Math.max(Math.min(model.get("columns"), charts.length, Math.floor(box.clientWidth / LEAST)), 1);
    const w = Math.floor((box.clientWidth - 8 * (columns - 1)) / columns), h = model.get("height");
    for (const chart of charts) one(chart, w, h);
  }

  function one(chart, w, h) {
    const svg = document.createElementNS(SVG, "svg");
    svg.setAttribute("width", w); svg.setAttribute("height", h); svg.setAttribute("role", "img");
    svg.setAttribute("aria-label", chart.aria || chart.title);
    box.append(svg);
    const iw = w - MARGIN.left - MARGIN.right, ih = h - MARGIN.top - MARGIN.bottom;
    let [x0, x1] = bounds(chart, "x"), [y0, y1] = bounds(chart, "y");
    const log = chart.log ? Math.log10 : (value) => value;
    [x0, x1] = [log(x0), log(x1)];
    if (chart.equal) {
      const unit = Math.max((x1 - x0) / iw, (y1 - y0) / ih), cx = (x0 + x1) / 2, cy = (y0 + y1) / 2;
      [x0, x1, y0, y1] = [cx - (unit * iw) / 2, cx + (unit * iw) / 2, cy - (unit * ih) / 2, cy + (unit * ih) / 2];
    }
    const px = (x) => MARGIN.left + ((log(x) - x0) / (x1 - x0)) * iw, py = (y) => MARGIN.top + ih - ((y - y0) / (y1 - y0)) * ih;
    const id = `rds-curves-${Math.random().toString(36).slice(2)}`;
    shape("rect", { x: MARGIN.left, y: MARGIN.top, width: iw, height: ih }, shape("clipPath", { id }, svg));
    const grid = [], texts = (x, y, anchor, text) => shape("text", { x, y, "text-anchor": anchor, class: "rds-splane-tick" }, svg, text);
    if (chart.log) for (let k = Math.ceil(x0 - 1e-9); k <= x1 + 1e-9; k += 1) { grid.push(`M${px(10 ** k)} ${MARGIN.top}v${ih}`); texts(px(10 ** k), h - 22, "middle", label(10 ** k)); }
    else { const step = nice(x1 - x0, Math.max(2, iw / 80)); for (let x = Math.ceil(x0 / step) * step; x <= x1 + 1e-9 * step; x += step) { grid.push(`M${px(x)} ${MARGIN.top}v${ih}`); texts(px(x), h - 22, "middle", label(Math.abs(x) < 1e-9 * step ? 0 : x)); } }
    const step = chart.y_step || nice(y1 - y0, Math.max(2, ih / 36));
    for (let y = Math.ceil(y0 / step) * step; y <= y1 + 1e-9 * step; y += step) { grid.push(`M${MARGIN.left} ${py(y)}h${iw}`); texts(MARGIN.left - 5, py(y) + 4, "end", label(Math.abs(y) < 1e-9 * step ? 0 : y)); }
    shape("path", { d: grid.join(""), class: "rds-splane-grid" }, svg);
    shape("rect", { x: MARGIN.left, y: MARGIN.top, width: iw, height: ih, class: "rds-splane-frame" }, svg);
    texts(MARGIN.left + iw / 2, h - 6, "middle", chart.x_label);
    shape("text", { x: 13, y: MARGIN.top + ih / 2, "text-anchor": "middle", class: "rds-splane-tick", transform: `rotate(-90 13 ${MARGIN.top + ih / 2})` }, svg, chart.y_label);
    shape("text", { x: MARGIN.left, y: 15, class: "rds-curves-title" }, svg, chart.title);
    const plot = shape("g", { "clip-path": `url(#${id})` }, svg);
    let right = w - MARGIN.right;
    for (const series of chart.series) {
      const spots = [];
      let pen = "M";
      series.x.forEach((x, k) => {
        const y = series.y[k];
        if (x == null || y == null || !Number.isFinite(px(x))) { pen = "M"; return; }
        spots.push(series.dots ? `M${px(x).toFixed(1)} ${py(y).toFixed(1)}m-4 0h8m-4 -4v8` : `${pen}${px(x).toFixed(1)} ${py(y).toFixed(1)}`);
        pen = "L";
      });
      const look = { d: spots.join(""), fill: "none", stroke: series.color || "var(--rds-text)", "stroke-width": series.width || 1.7 };
      if (series.dash) look["stroke-dasharray"] = series.dash;
      shape("path", look, plot);
    }
    for (const series of [...chart.series].reverse()) {
      if (!series.name) continue;
      const text = shape("text", { x: right, y: 15, "text-anchor": "end", class: "rds-splane-tick" }, svg, series.name);
      const long = text.getComputedTextLength() + 24;
      const line = { d: `M${right - long + 2} 11h16`, stroke: series.color || "var(--rds-text)", "stroke-width": series.width || 1.7, fill: "none" };
      if (series.dash) line["stroke-dasharray"] = series.dash;
      shape("path", line, svg);
      right -= long + 8;
    }
  }
  model.on("change:charts", draw);
  const sized = new ResizeObserver(draw);
  sized.observe(box);
  return () => { sized.disconnect(); model.off("change:charts", draw); };
}

export default { render };
