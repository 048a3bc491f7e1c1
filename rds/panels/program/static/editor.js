// The editor of part programs, over CodeMirror (which stands above this in the same module, as `CM`): marks at their
// words with the message behind the line and below the text, the line that runs, and what each word means.

const QUIET_MS = 250; // after the last key, before the text is sent
const SHOWN = 50; // messages below the text
const SIGNS = { error: "✖", warning: "⚠", running: "▶" };

const language = CM.StreamLanguage.define({
  token(stream) {
    if (stream.match(/^\(.*?(\)|$)/) || stream.match(/^;.*/)) return "comment";
    if (stream.match(/^o\s*(<[^>]*>|\d+)\s*[a-z]*/i)) return "keyword";
    if (stream.match(/^#\s*(<[^>]*>|\d+)/)) return "variableName";
    if (stream.match(/^[gm]\s*[\d.]+/i)) return "keyword";
    if (stream.match(/^[-+]?[\d.]+/)) return "number";
    stream.next();
    return null;
  },
});
const look = CM.HighlightStyle.define([
  { tag: CM.tags.keyword, class: "rds-editor-code" },
  { tag: CM.tags.variableName, class: "rds-editor-parameter" },
  { tag: CM.tags.comment, class: "rds-editor-comment" },
]);

class Says extends CM.WidgetType {
  constructor(text, kind) { super(); this.text = text; this.kind = kind; }
  eq(other) { return other.text === this.text && other.kind === this.kind; }
  toDOM() {
    const made = document.createElement("span");
    made.className = `rds-editor-says rds-editor-${this.kind}`;
    made.setAttribute("aria-hidden", "true"); // it is said below the text, too
    made.textContent = this.text;
    return made;
  }
}

class Numbered extends CM.GutterMarker {
  constructor(text, kind) { super(); this.text = text; this.elementClass = `rds-editor-number-${kind}`; }
  eq(other) { return other.text === this.text && other.elementClass === this.elementClass; }
  toDOM() { return document.createTextNode(this.text); }
}

// What lies on the lines: decorations that move with the text, the kind of each marked line, and the line that runs.
const setMarks = CM.StateEffect.define(), setRunning = CM.StateEffect.define();
const marked = CM.StateField.define({
  create: () => ({ shown: CM.Decoration.none, kinds: new Map(), running: 0 }),
  update(found, change) {
    let { shown, kinds, running } = found;
    shown = shown.map(change.changes);
    for (const effect of change.effects) {
      if (effect.is(setRunning)) running = effect.value;
      if (effect.is(setMarks)) [shown, kinds] = drawn(change.state.doc, effect.value);
    }
    return { shown, kinds, running };
  },
  provide: (field) => [
    CM.EditorView.decorations.from(field, (found) => found.shown),
    CM.EditorView.decorations.compute([field, "doc"], (state) => {
      const { running } = state.field(field), { doc } = state;
      if (running < 1 || running > doc.lines) return CM.Decoration.none;
      return CM.Decoration.set([CM.Decoration.line({ class: "rds-editor-running" }).range(doc.line(running).from)]);
    }),
    CM.lineNumberMarkers.compute([field, "doc"], (state) => {
      const { kinds, running } = state.field(field), { doc } = state, signs = new Map(kinds);
      if (running) signs.set(running, "running");
      const there = [...signs].filter(([number]) => number >= 1 && number <= doc.lines).sort(([a], [b]) => a - b);
      return CM.RangeSet.of(there.map(([number, kind]) => new Numbered(`${SIGNS[kind]} ${number}`, kind).range(doc.line(number).from)));
    }),
  ],
});

function drawn(doc, marks) {
  const ranges = [], kinds = new Map(), said = new Map();
  for (const { line: number, column, length, text, kind } of marks) {
    if (number < 1 || number > doc.lines) continue; // of the whole program, or of a line that is gone
    const line = doc.line(number), from = Math.min(line.from + Math.max(column - 1, 0), line.to);
    const to = column && length ? Math.min(from + length, line.to) : line.to;
    const attributes = { "data-word": column ? doc.sliceString(from, to) : "" };
    if (to > from) ranges.push(CM.Decoration.mark({ class: `rds-editor-word rds-editor-${kind}`, attributes }).range(from, to));
    if (kinds.get(number) !== "error") kinds.set(number, kind);
    said.set(number, [...(said.get(number) || []), text]);
  }
  for (const [number, texts] of said) {
    ranges.push(CM.Decoration.widget({ widget: new Says(texts.join("  ·  "), kinds.get(number)), side: 1 }).range(doc.line(number).to));
  }
  return [CM.Decoration.set(ranges, true), kinds];
}

// What stands at `at` of a line: "G2", "X", "sub", "SIN", or nothing in a comment.
function wordAt(text, at) {
  const plain = text.replace(/\([^)]*\)?|;.*/g, (comment) => " ".repeat(comment.length));
  const words = /(o\s*(?:<[^>]*>|\d+)\s*)([a-z]+)|#\s*(?:<[^>]*>|\d+)|([a-z]{2,})(?=\s*\[)|([gm])\s*(\d+(?:\.\d+)?)|([a-z])/gi;
  for (const found of plain.matchAll(words)) {
    const [whole, o, keyword, name, letter, number, other] = found, from = found.index + (o ? o.length : 0);
    const value = /^\s*[-+]?[\d.]*/.exec(plain.slice(found.index + whole.length))[0];
    const to = found.index + whole.length + (other ? value.trimEnd().length : 0);
    if (at < from || at > to) continue;
    const said = keyword ? keyword.toLowerCase() : name ? name.toUpperCase() : letter ? letter.toUpperCase() + Number(number) : other;
    return said ? { said: other ? said.toUpperCase() : said, from, to } : null;
  }
  return null;
}

const say = (text) => (window.rdsText ? window.rdsText(text) : text);

function completions(words) {
  const of = (kind) => words.filter((word) => word.kind === kind).map(({ label, info }, n) => ({ label, detail: say(info), boost: -n / 10 }));
  return (context) => {
    const [codes, keywords, functions] = ["code", "o", "function"].map(of);
    const line = context.state.doc.lineAt(context.pos), before = line.text.slice(0, context.pos - line.from);
    if (/;|\([^)]*$/.test(before)) return null; // in a comment
    const word = /(?:^|[^a-z#<])([gm][\d.]*)$/i.exec(before), after = /^\s*o\s*(?:<[^>]*>|\d+)\s*([a-z]*)$/i.exec(before);
    if (after) return { from: context.pos - after[1].length, options: keywords, validFor: /^[a-z]*$/i };
    const called = /\[[^\]]*?([a-z]+)$/i.exec(before);
    if (called) return { from: context.pos - called[1].length, options: functions, validFor: /^[a-z]*$/i };
    if (word) return { from: context.pos - word[1].length, options: codes, validFor: /^[gm][\d.]*$/i };
    return context.explicit && /(^|\s)$/.test(before) ? { from: context.pos, options: codes, validFor: /^[gm][\d.]*$/i } : null;
  };
}

function render({ model, el }) {
  const box = document.createElement("div");
  box.className = "rds-editor";
  box.style.setProperty("--rds-editor-height", `${model.get("height")}px`);
  const list = document.createElement("div");
  list.className = "rds-editor-list";
  list.setAttribute("role", "status");
  el.append(box, list);

  let timer = 0;
  const words = model.get("words"), meanings = new Map(words.map(({ label, info }) => [label, info]));
  const locked = new CM.Compartment(), lock = () => CM.EditorState.readOnly.of(model.get("locked"));
  const hover = CM.hoverTooltip((view, at) => {
    const line = view.state.doc.lineAt(at), word = wordAt(line.text, at - line.from), info = word && meanings.get(word.said);
    if (!info) return null;
    const create = () => {
      const dom = document.createElement("div");
      dom.className = "rds-editor-meaning";
      const name = document.createElement("b");
      name.textContent = word.said;
      dom.append(name, ` ${say(info)}`);
      return { dom };
    };
    return { pos: line.from + word.from, end: line.from + word.to, above: true, create };
  });
  const save = (view) => { send(); model.send({ kind: "save", text: view.state.doc.toString() }); return true; };
  const extensions = [
    CM.lineNumbers(), CM.highlightSpecialChars(), CM.history(), CM.drawSelection(), CM.highlightActiveLine(),
    CM.EditorState.tabSize.of(8), CM.syntaxHighlighting(look), language, marked, CM.search({ top: true }),
    words.length ? [hover, CM.autocompletion({ override: [completions(words)], icons: false, selectOnOpen: false })] : [],
    // Enter ends the line: what is offered is taken once an arrow key has chosen it
    CM.keymap.of([{ key: "Mod-s", run: save, preventDefault: true }, ...CM.searchKeymap, ...CM.completionKeymap, ...CM.defaultKeymap, ...CM.historyKeymap]),
    CM.EditorView.contentAttributes.of({ "aria-label": model.get("label"), tabindex: "0", autocapitalize: "off", autocorrect: "off", spellcheck: "false" }),
    CM.EditorView.updateListener.of((update) => {
      if (update.docChanged && !update.transactions.some((each) => each.annotation(CM.Transaction.remote))) {
        clearTimeout(timer);
        timer = setTimeout(send, QUIET_MS);
      }
      if (update.selectionSet || update.docChanged) {
        const caret = update.state.doc.lineAt(update.state.selection.main.head).number;
        if (caret !== model.get("caret")) { model.set("caret", caret); model.save_changes(); }
      }
    }),
    CM.EditorView.domEventHandlers({ blur: () => send() }),
    locked.of(lock()),
  ];
  const fresh = () => CM.EditorState.create({ doc: model.get("text"), extensions });
  const view = new CM.EditorView({ state: fresh(), parent: box });
  box.view = view; // for whoever asks the page for the whole text, of which only the lines in sight are there

  function send() {
    clearTimeout(timer);
    timer = 0;
    const text = view.state.doc.toString();
    if (model.get("text") !== text) { model.set("text", text); model.save_changes(); }
  }
  const tell = (...effects) => view.dispatch({ effects, annotations: CM.Transaction.remote.of(true) });

  function mark() {
    const marks = model.get("marks"), shown = marks.slice(0, SHOWN).map((each) => {
      const button = document.createElement("button");
      button.type = "button";
      button.className = `rds-editor-${each.kind}`;
      button.textContent = `${each.kind === "error" ? "✖" : "⚠"} ${each.line ? `line ${each.line}: ` : ""}${each.text}`;
      button.title = "Go there";
      button.onclick = () => go(each.line, each.column, each.length);
      return button;
    });
    list.replaceChildren(...shown);
    if (marks.length > shown.length) list.append(`and ${marks.length - shown.length} more`);
    view.contentDOM.setAttribute("aria-invalid", String(marks.some((each) => each.kind === "error")));
    tell(setMarks.of(marks));
  }
  function go(number, column, length) {
    if (number < 1 || number > view.state.doc.lines) return;
    const line = view.state.doc.line(number), from = Math.min(line.from + Math.max(column - 1, 0), line.to);
    const to = column ? Math.min(from + length, line.to) : line.to;
    view.dispatch({ selection: { anchor: from, head: to }, effects: CM.EditorView.scrollIntoView(from, { y: "center" }) });
    view.focus();
  }
  function run() {
    const number = model.get("running"), there = number >= 1 && number <= view.state.doc.lines;
    box.dataset.running = number;
    tell(setRunning.of(number), ...(there ? [CM.EditorView.scrollIntoView(view.state.doc.line(number).from, { y: "nearest", yMargin: 38 })] : []));
  }
  function shut() {
    tell(locked.reconfigure(lock()));
    box.classList.toggle("rds-editor-locked", model.get("locked"));
  }

  box.addEventListener("keydown", (event) => event.stopPropagation()); // JupyterLab, and the page, have keys of their own
  model.on("change:text", () => {
    if (timer || model.get("text") === view.state.doc.toString()) return; // what is being typed counts
    view.setState(fresh()); // another program: nobody undoes it into the one before
    model.set("caret", 1); // where its cursor is, from which it may be run
    model.save_changes();
    mark();
    run();
    shut();
  });
  model.on("change:marks", mark);
  model.on("change:running", run);
  model.on("change:locked", shut);
  model.on("msg:custom", (message) => { if (message.kind === "go") go(message.line, 0, 0); });
  mark();
  run();
  shut();
  return () => { send(); view.destroy(); };
}

export default { render };
