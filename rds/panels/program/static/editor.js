// A text editor for part programs: line numbers, marks at their words with the message behind the line, the line that
// runs. A textarea does the editing; what is drawn over it are only the lines in sight, so that long programs stay fast.

const QUIET_MS = 250; // after the last key, before the text is sent

function render({ model, el }) {
  const box = document.createElement("div");
  box.className = "rds-editor";
  box.style.setProperty("--rds-editor-height", `${model.get("height")}px`);
  const gutter = document.createElement("div");
  gutter.className = "rds-editor-gutter";
  gutter.setAttribute("aria-hidden", "true");
  const place = document.createElement("div");
  place.className = "rds-editor-place";
  const over = document.createElement("div");
  over.className = "rds-editor-over";
  over.setAttribute("aria-hidden", "true");
  const area = document.createElement("textarea");
  Object.assign(area, { spellcheck: false, wrap: "off", value: model.get("text") });
  area.setAttribute("aria-label", model.get("label"));
  area.setAttribute("autocapitalize", "off");
  area.setAttribute("autocomplete", "off");
  place.append(over, area);
  box.append(gutter, place);
  const list = document.createElement("div");
  list.className = "rds-editor-list";
  list.setAttribute("role", "status");
  el.append(box, list);

  let timer = 0, lines = area.value.split("\n"), frame = 0;
  const metrics = () => {
    const style = getComputedStyle(area);
    const canvas = metrics.canvas || (metrics.canvas = document.createElement("canvas").getContext("2d"));
    canvas.font = `${style.fontSize} ${style.fontFamily}`;
    return { row: parseFloat(style.lineHeight), char: canvas.measureText("0".repeat(50)).width / 50,
             pad: parseFloat(style.paddingLeft), top: parseFloat(style.paddingTop) };
  };
  // tabs are drawn as wide as the textarea draws them
  const across = (text) => { let n = 0; for (const c of text) n = c === "\t" ? n + 8 - (n % 8) : n + 1; return n; };
  const piece = (kind, left, top, width, height, text) => {
    const made = document.createElement("div");
    made.className = kind;
    made.style.cssText = `left:${left}px;top:${top}px;height:${height}px;` + (width === null ? "" : `width:${width}px`);
    if (text) made.textContent = text;
    return made;
  };

  function draw() {
    frame = 0;
    if (!area.clientHeight) return;
    const { row, char, pad, top } = metrics();
    const first = Math.max(0, Math.floor((area.scrollTop - top) / row)), last = first + Math.ceil(area.clientHeight / row) + 1;
    const at = new Map();
    for (const mark of model.get("marks")) if (mark.line > first && mark.line <= last + 1) at.set(mark.line, [...(at.get(mark.line) || []), mark]);
    const running = model.get("running"), numbers = [], drawn = [];
    for (let n = first + 1; n <= Math.min(last + 1, lines.length); n++) {
      const y = top + (n - 1) * row - area.scrollTop, marks = at.get(n) || [];
      const bad = marks.some((mark) => mark.kind === "error");
      const number = piece("rds-editor-number", 0, y, null, row, `${n === running ? "▶ " : bad ? "✖ " : marks.length ? "⚠ " : ""}${n}`);
      if (marks.length) number.classList.add(bad ? "rds-editor-bad" : "rds-editor-warned");
      if (n === running) number.classList.add("rds-editor-now");
      numbers.push(number);
      if (n === running) drawn.push(piece("rds-editor-running", 0, y, area.clientWidth, row));
      if (!marks.length) continue;
      const text = lines[n - 1];
      for (const mark of marks) {
        const from = mark.column ? across(text.slice(0, mark.column - 1)) : 0;
        const wide = mark.column && mark.length ? mark.length : Math.max(across(text), 1) - from;
        const word = piece(`rds-editor-word rds-editor-${mark.kind}`, pad + from * char - area.scrollLeft, y, Math.max(wide, 1) * char, row);
        word.dataset.word = mark.column ? text.slice(mark.column - 1, mark.column - 1 + mark.length) : "";
        drawn.push(word);
      }
      const says = marks.map((mark) => mark.text).join("  ·  ");
      drawn.push(piece(`rds-editor-says rds-editor-${bad ? "error" : "warning"}`, pad + (across(text) + 2) * char - area.scrollLeft, y, null, row, says));
    }
    gutter.replaceChildren(...numbers);
    over.replaceChildren(...drawn);
    box.dataset.running = running;
  }
  const redraw = () => { frame = frame || requestAnimationFrame(draw); };

  function tell() {
    const marks = model.get("marks"), shown = marks.slice(0, 50).map((mark) => {
      const button = document.createElement("button");
      button.type = "button";
      button.className = `rds-editor-${mark.kind}`;
      button.textContent = `${mark.kind === "error" ? "✖" : "⚠"} ${mark.line ? `line ${mark.line}: ` : ""}${mark.text}`;
      button.title = "Go there";
      button.onclick = () => go(mark.line, mark.column, mark.length);
      return button;
    });
    list.replaceChildren(...shown);
    if (marks.length > shown.length) list.append(`and ${marks.length - shown.length} more`);
    area.setAttribute("aria-invalid", String(marks.some((mark) => mark.kind === "error")));
  }

  function go(line, column, length) {
    if (!line) return;
    const before = lines.slice(0, line - 1).reduce((sum, text) => sum + text.length + 1, 0);
    const from = before + Math.max(column - 1, 0);
    area.focus();
    area.setSelectionRange(from, column ? from + length : before + (lines[line - 1] || "").length);
    show(line);
  }
  function show(line) {
    const { row, top } = metrics(), y = top + (line - 1) * row;
    if (y < area.scrollTop + row || y > area.scrollTop + area.clientHeight - 2 * row) area.scrollTop = y - area.clientHeight / 2;
    redraw();
  }

  function send() {
    clearTimeout(timer);
    timer = 0;
    if (model.get("text") !== area.value) { model.set("text", area.value); model.save_changes(); }
  }
  area.addEventListener("input", () => {
    lines = area.value.split("\n");
    clearTimeout(timer);
    timer = setTimeout(send, QUIET_MS);
    redraw();
  });
  const caret = () => {
    const line = area.value.slice(0, area.selectionStart).split("\n").length;
    if (line !== model.get("caret")) { model.set("caret", line); model.save_changes(); }
  };
  for (const each of ["keyup", "click"]) area.addEventListener(each, caret);
  area.addEventListener("blur", send);
  area.addEventListener("scroll", redraw);
  area.addEventListener("keydown", (event) => {
    event.stopPropagation(); // JupyterLab has shortcuts of its own
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "s") { event.preventDefault(); send(); model.send({ kind: "save", text: area.value }); }
  });
  model.on("change:text", () => {
    if (timer || model.get("text") === area.value) return; // what is being typed counts
    area.value = model.get("text");
    lines = area.value.split("\n");
    area.scrollTop = 0;
    redraw();
  });
  model.on("change:marks", () => { tell(); redraw(); });
  model.on("change:running", () => { if (model.get("running")) show(model.get("running")); redraw(); });
  model.on("msg:custom", (message) => { if (message.kind === "go") go(message.line, 0, 0); });
  model.on("change:locked", lock);
  function lock() { area.readOnly = model.get("locked"); box.classList.toggle("rds-editor-locked", area.readOnly); }
  const sized = new ResizeObserver(redraw);
  sized.observe(area);
  lock();
  tell();
  redraw();
  return () => { send(); sized.disconnect(); };
}

export default { render };
