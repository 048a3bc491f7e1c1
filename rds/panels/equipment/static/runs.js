// The runs of a folder as a table: ticked, starred, noted, sorted by a column. All of it is the kernel's; this shows it.

const COLUMNS = [["when", "time"], ["axes", "axes"], ["mode", "mode"], ["controller", "controller"], ["changed", "changed"],
  ["rms", "RMS error"], ["fit", "fit"], ["verdict", "timing"], ["note", "note"]];

function render({ model, el }) {
  el.classList.add("rds-runs");
  const table = document.createElement("table");
  const empty = document.createElement("p");
  empty.textContent = "No run yet. Each run will be a row here: what was chosen and changed, its error, its verdict, and your note.";
  el.append(empty, table);
  let sorted = "when", down = true;
  const make = (tag, text, attributes) => { const made = document.createElement(tag); if (text) made.textContent = text; return Object.assign(made, attributes); };
  const worth = (row) => { const value = row[sorted]; const number = parseFloat(value); return sorted === "when" ? value : Number.isNaN(number) ? String(value) : number; };

  function draw() {
    const many = new Set(model.get("rows").map((row) => row.axes)).size > 1; // one axis in all of them need not be said
    const columns = COLUMNS.filter(([key]) => many || key !== "axes");
    const rows = [...model.get("rows")], ticked = model.get("ticked");
    empty.style.display = rows.length ? "none" : "";
    table.style.display = rows.length ? "" : "none";
    rows.sort((a, b) => { const x = worth(a), y = worth(b); return (x < y ? -1 : x > y ? 1 : 0) * (down ? -1 : 1); });
    const head = make("tr");
    head.append(make("th", "", { title: "tick to open, to lay over each other, to compare" }), make("th", "★", { title: "star" }));
    for (const [key, words] of columns) {
      const cell = make("th"), button = make("button", words + (key === sorted ? (down ? " ▾" : " ▴") : ""), { type: "button", title: key === "changed" ? "what is not as in the run before; sort by this" : "sort by this" });
      cell.scope = "col";
      cell.setAttribute("aria-sort", key === sorted ? (down ? "descending" : "ascending") : "none");
      button.onclick = () => { down = key === sorted ? !down : key === "when"; sorted = key; draw(); };
      cell.append(button);
      head.append(cell);
    }
    const body = make("tbody");
    for (const row of rows) {
      const line = make("tr", "", { className: ticked.includes(row.name) ? "rds-runs-ticked" : "" });
      line.dataset.run = row.name;
      const when = new Date(1000 * row.when).toLocaleString(undefined, { day: "2-digit", month: "short", hour: "2-digit", minute: "2-digit", second: "2-digit", hour12: false });
      const tick = make("input", "", { type: "checkbox", checked: ticked.includes(row.name) });
      tick.setAttribute("aria-label", `choose the run of ${when}`);
      tick.onchange = () => {
        const others = model.get("ticked").filter((name) => name !== row.name);
        model.set("ticked", tick.checked ? [...others, row.name] : others);
        model.save_changes();
        line.className = tick.checked ? "rds-runs-ticked" : "";
      };
      const star = make("button", row.star ? "★" : "☆", { type: "button", className: "rds-runs-star" });
      star.setAttribute("aria-label", "star");
      star.setAttribute("aria-pressed", String(row.star));
      star.onclick = () => model.send({ kind: "star", name: row.name, on: !row.star });
      for (const part of [tick, star]) { const cell = make("td"); cell.append(part); line.append(cell); }
      for (const [key] of columns) {
        const cell = make("td");
        if (key === "note") {
          const note = make("input", "", { type: "text", value: row.note, placeholder: "note", maxLength: 200 });
          note.setAttribute("aria-label", `note on the run of ${when}`);
          note.onchange = () => model.send({ kind: "note", name: row.name, text: note.value });
          note.onkeydown = (event) => event.stopPropagation();
          cell.append(note);
        } else if (key === "when") {
          const open = make("button", when, { type: "button", title: `open ${row.name}`, className: "rds-runs-open" });
          open.onclick = () => model.send({ kind: "open", name: row.name });
          cell.append(open);
          if (row.state !== "whole") cell.append(make("div", row.state, { className: "rds-runs-state" }));
        } else cell.textContent = row[key];
        if (key === "rms" || key === "fit") cell.className = "number";
        line.append(cell);
      }
      body.append(line);
    }
    const header = make("thead");
    header.append(head);
    table.replaceChildren(header, body);
  }
  model.on("change:rows", draw);
  model.on("change:ticked", draw);
  draw();
}

export default { render };
