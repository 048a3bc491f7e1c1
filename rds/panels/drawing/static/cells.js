// A grid of cells to fill with the mouse or the keyboard, with the outline that is cut drawn over it.

const QUIET_MS = 150;

function render({ model, el }) {
  const box = document.createElement("div");
  box.className = "rds-cells";
  const bar = document.createElement("div");
  bar.className = "rds-cells-bar";
  const canvas = document.createElement("canvas");
  canvas.tabIndex = 0;
  canvas.setAttribute("role", "application");
  const said = document.createElement("p");
  said.className = "rds-cells-said";
  said.setAttribute("role", "status");
  box.append(bar, canvas, said);
  el.append(box);

  let cells = read(), row = 0, column = 0, paints = null, timer = 0, frame = 0, outlined = true;
  const before = [];
  const fill = button("Draw", "Fill cells with the mouse", () => choose(true));
  const wipe = button("Erase", "Empty cells with the mouse", () => choose(false));
  const undo = button("Undo", "Take the last stroke back", () => { if (before.length) { cells = before.pop(); changed(); } });
  const clear = button("Clear", "Empty all cells", () => { remember(); cells = cells.map((line) => line.map(() => false)); changed(); });
  bar.append(fill, wipe, undo, clear);
  let draws = true;
  choose(true);

  function button(text, tip, act) {
    const made = document.createElement("button");
    Object.assign(made, { textContent: text, title: tip, type: "button", onclick: act });
    return made;
  }
  function choose(on) { draws = on; fill.setAttribute("aria-pressed", String(on)); wipe.setAttribute("aria-pressed", String(!on)); }
  function read() { return model.get("text").split("\n").map((line) => [...line].map((cell) => cell === "#")); }
  const wide = () => cells[0].length, high = () => cells.length;
  const size = () => Math.max(4, Math.min(26, Math.floor((canvas.parentElement.clientWidth - 40) / wide()), Math.floor(430 / high())));
  const ink = (name) => getComputedStyle(el).getPropertyValue(name).trim();
  function remember() { before.push(cells.map((line) => line.slice())); if (before.length > 50) before.shift(); }
  function set(r, c, on) {
    if (r < 0 || c < 0 || r >= high() || c >= wide() || cells[r][c] === on) return;
    cells[r][c] = on;
    changed();
  }
  function changed() {
    clearTimeout(timer);
    timer = setTimeout(send, QUIET_MS);
    outlined = false; // until the kernel has traced it again
    redraw();
  }
  function send() {
    timer = 0;
    const text = cells.map((line) => line.map((on) => (on ? "#" : ".")).join("")).join("\n");
    if (text !== model.get("text")) { model.set("text", text); model.save_changes(); } else { outlined = true; redraw(); }
  }

  function draw() {
    frame = 0;
    if (!canvas.parentElement.clientWidth) return;
    const s = size(), ratio = window.devicePixelRatio || 1, left = 30, top = 18;
    const width = left + wide() * s + 8, height = top + high() * s + 8;
    canvas.width = width * ratio; canvas.height = height * ratio;
    canvas.style.width = `${width}px`; canvas.style.height = `${height}px`;
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    pen.font = "11px system-ui, sans-serif"; pen.fillStyle = ink("--rds-quiet");
    pen.textAlign = "center"; pen.textBaseline = "bottom";
    for (let c = 5; c <= wide(); c += 5) pen.fillText(c, left + (c - 0.5) * s, top - 2);
    pen.textAlign = "right"; pen.textBaseline = "middle";
    for (let r = 5; r <= high(); r += 5) pen.fillText(r, left - 4, top + (r - 0.5) * s);
    pen.fillStyle = ink("--rds-quiet"); pen.globalAlpha = 0.65;
    for (let r = 0; r < high(); r++) for (let c = 0; c < wide(); c++) if (cells[r][c]) pen.fillRect(left + c * s, top + r * s, s, s);
    pen.globalAlpha = 1;
    pen.strokeStyle = ink("--rds-line"); pen.lineWidth = 1;
    pen.beginPath();
    for (let c = 0; c <= wide(); c++) { pen.moveTo(left + c * s + 0.5, top); pen.lineTo(left + c * s + 0.5, top + high() * s); }
    for (let r = 0; r <= high(); r++) { pen.moveTo(left, top + r * s + 0.5); pen.lineTo(left + wide() * s, top + r * s + 0.5); }
    pen.stroke();
    if (outlined) {
      pen.strokeStyle = "#D55E00"; pen.lineWidth = 2.5;
      for (const ring of model.get("rings")) {
        pen.beginPath();
        ring.forEach(([c, r], i) => (i ? pen.lineTo(left + c * s, top + r * s) : pen.moveTo(left + c * s, top + r * s)));
        pen.stroke();
      }
    }
    if (document.activeElement === canvas) {
      pen.strokeStyle = ink("--rds-accent"); pen.lineWidth = 3;
      pen.strokeRect(left + column * s + 1, top + row * s + 1, s - 1, s - 1);
    }
    canvas.setAttribute("aria-label", `drawing of ${wide()} × ${high()} cells; arrow keys go, space fills or empties`);
    box.dataset.filled = cells.flat().filter(Boolean).length;
    box.dataset.rings = outlined ? model.get("rings").length : -1;
    box.dataset.cell = s;
  }
  const redraw = () => { frame = frame || requestAnimationFrame(draw); };

  function at(event) {
    const place = canvas.getBoundingClientRect(), s = size();
    return [Math.floor((event.clientY - place.top - 18) / s), Math.floor((event.clientX - place.left - 30) / s)];
  }
  canvas.addEventListener("pointerdown", (event) => {
    const [r, c] = at(event);
    if (r < 0 || c < 0 || r >= high() || c >= wide()) return;
    remember();
    paints = event.button === 2 ? false : draws;
    canvas.setPointerCapture(event.pointerId);
    [row, column] = [r, c];
    set(r, c, paints);
    redraw();
  });
  canvas.addEventListener("pointermove", (event) => {
    if (paints === null) return;
    const [r, c] = at(event), steps = Math.max(Math.abs(r - row), Math.abs(c - column), 1), [r0, c0] = [row, column];
    for (let k = 1; k <= steps; k++) set(Math.round(r0 + (r - r0) * k / steps), Math.round(c0 + (c - c0) * k / steps), paints);
    row = Math.min(Math.max(r, 0), high() - 1); column = Math.min(Math.max(c, 0), wide() - 1);
  });
  canvas.addEventListener("pointerup", () => { paints = null; });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("focus", redraw);
  canvas.addEventListener("blur", redraw);
  canvas.addEventListener("keydown", (event) => {
    const move = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key];
    if (move) {
      row = Math.min(Math.max(row + move[0], 0), high() - 1); column = Math.min(Math.max(column + move[1], 0), wide() - 1);
      if (event.shiftKey) set(row, column, true);
    } else if (event.key === " " || event.key === "Enter") { remember(); set(row, column, !cells[row][column]); }
    else if (event.key === "Delete" || event.key === "Backspace") { remember(); set(row, column, false); }
    else if (event.key.toLowerCase() === "z" && (event.ctrlKey || event.metaKey)) undo.click();
    else return;
    event.preventDefault(); event.stopPropagation();
    said.textContent = `row ${row + 1}, column ${column + 1}, ${cells[row][column] ? "filled" : "empty"}`;
    redraw();
  });
  model.on("change:text", () => { if (!timer) { cells = read(); row = Math.min(row, high() - 1); column = Math.min(column, wide() - 1); redraw(); } });
  model.on("change:rings", () => { if (!timer) outlined = true; redraw(); });
  model.on("msg:custom", () => { if (!timer) outlined = true; redraw(); });
  said.textContent = "Draw with the mouse (right button erases), or arrow keys and space; Shift and arrows draw.";
  const sized = new ResizeObserver(redraw);
  sized.observe(box);
  const themed = new MutationObserver(redraw), app = document.querySelector(".rds-app");
  if (app) themed.observe(app, { attributes: true, attributeFilter: ["class"] });
  redraw();
  return () => { if (timer) send(); sized.disconnect(); themed.disconnect(); };
}

export default { render };
