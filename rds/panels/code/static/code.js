// The editor of a user's Python file, over CodeMirror (which stands above this in the same module, as `CM`): completion
// of the interface's names, each fault below its line, files taken by drop.

const QUIET_MS = 250; // after the last key, before the text is sent
const SAID_PX = 76; // what is said of a line, below it
const LARGEST = 1 << 20; // bytes of a file that is dropped

// the page's own colours, which follow light and dark
const look = CM.HighlightStyle.define([
  { tag: CM.tags.keyword, class: "rds-code-keyword" },
  { tag: [CM.tags.string, CM.tags.special(CM.tags.string)], class: "rds-code-string" },
  { tag: [CM.tags.number, CM.tags.bool, CM.tags.null], class: "rds-code-number" },
  { tag: CM.tags.comment, class: "rds-code-comment" },
  { tag: [CM.tags.function(CM.tags.definition(CM.tags.variableName)), CM.tags.definition(CM.tags.className)], class: "rds-code-defined" },
]);

class Says extends CM.WidgetType {
  constructor(text, fault) { super(); this.text = text; this.fault = fault; }
  eq(other) { return other.text === this.text && other.fault === this.fault; }
  toDOM() {
    const made = document.createElement("div");
    made.className = `rds-code-says rds-code-${this.fault ? "fault" : "warning"}`;
    made.textContent = `${this.fault ? "✖" : "⚠"} ${window.rdsText ? window.rdsText(this.text) : this.text}`;
    return made;
  }
  ignoreEvent() { return false; }
}

const setMarks = CM.StateEffect.define();
const marked = CM.StateField.define({
  create: () => CM.Decoration.none,
  update(shown, change) {
    shown = shown.map(change.changes);
    for (const effect of change.effects) if (effect.is(setMarks)) {
      const doc = change.state.doc, made = [];
      for (const mark of effect.value) {
        const line = doc.line(Math.min(Math.max(mark.line, 1), doc.lines));
        if (mark.line) made.push(CM.Decoration.line({ class: mark.fault ? "rds-code-bad" : "rds-code-warned" }).range(line.from));
        made.push(CM.Decoration.widget({ widget: new Says(mark.text, mark.fault), block: true, side: mark.line ? 1 : -1 })
          .range(mark.line ? line.to : line.from));
      }
      shown = CM.Decoration.set(made, true);
    }
    return shown;
  },
  provide: (field) => CM.EditorView.decorations.from(field),
});

function render({ model, el }) {
  el.classList.add("rds-code");
  let timer = 0, view = null;

  const options = (after) => model.get("words").filter((word) => word.after === after).map((word) => (
    { label: word.label, detail: word.detail, info: window.rdsText ? window.rdsText(word.info) : word.info, boost: 10, type: word.detail === "function" ? "function" : "variable" }));
  function complete(context) {
    const key = context.matchBefore(/params\[\s*["']\w*/);
    if (key) {
      const from = key.from + key.text.search(/\w*$/);
      return { from, options: options("params"), validFor: /^\w*$/ };
    }
    const member = context.matchBefore(/\b\w+\.\w*/);
    if (member) {
      const of = options(member.text.split(".")[0]);
      return of.length ? { from: member.from + member.text.indexOf(".") + 1, options: of, validFor: /^\w*$/ } : null;
    }
    const word = context.matchBefore(/\w+/);
    return word || context.explicit ? { from: word ? word.from : context.pos, options: options(""), validFor: /^\w*$/ } : null;
  }
  const run = () => { send(); model.send({ kind: "run", text: view.state.doc.toString() }); return true; };
  const language = CM.python();
  const extensions = [
    CM.lineNumbers(), CM.highlightActiveLineGutter(), CM.highlightSpecialChars(), CM.history(), CM.drawSelection(),
    CM.indentOnInput(), CM.EditorView.lineWrapping, CM.indentUnit.of("    "), CM.bracketMatching(), CM.closeBrackets(), CM.highlightActiveLine(),
    CM.syntaxHighlighting(look), CM.EditorState.tabSize.of(4), marked, language, CM.search({ top: true }),
    CM.autocompletion({ override: [complete, CM.localCompletionSource, CM.globalCompletion], icons: false }),
    CM.keymap.of([{ key: "Mod-Enter", run }, ...CM.closeBracketsKeymap, ...CM.searchKeymap, ...CM.completionKeymap, ...CM.defaultKeymap,
      ...CM.historyKeymap, CM.indentWithTab]),
    CM.EditorView.contentAttributes.of({ "aria-label": `${model.get("label")}; Escape, then Tab leaves the editor`,
      autocapitalize: "off", autocorrect: "off", spellcheck: "false" }),
    CM.EditorView.updateListener.of((update) => {
      if (update.docChanged && !update.transactions.some((each) => each.annotation(CM.Transaction.remote))) {
        clearTimeout(timer);
        timer = setTimeout(send, QUIET_MS);
      }
    }),
    CM.EditorView.domEventHandlers({ blur: () => send() }),
  ];
  const state = () => CM.EditorState.create({ doc: model.get("text"), extensions });

  function send() {
    clearTimeout(timer);
    timer = 0;
    const text = view.state.doc.toString();
    if (model.get("text") !== text) { model.set("text", text); model.save_changes(); }
  }
  function mark() {
    const marks = model.get("marks");
    view.dispatch({ effects: setMarks.of(marks), annotations: CM.Transaction.remote.of(true) });
    const line = view.state.doc.lineAt(view.state.selection.main.head);
    if (view.hasFocus && marks.some((each) => each.line === line.number)) { // what is said below the line is in sight, too
      view.dispatch({ effects: CM.EditorView.scrollIntoView(line.to, { y: "nearest", yMargin: SAID_PX }) });
    }
    view.contentDOM.setAttribute("aria-invalid", String(marks.some((each) => each.fault)));
  }
  function go(line) {
    const at = view.state.doc.line(Math.min(Math.max(line, 1), view.state.doc.lines));
    setTimeout(() => { // once the tab is in sight
      view.dispatch({ selection: { anchor: at.to }, effects: CM.EditorView.scrollIntoView(at.to, { y: "center" }) });
      view.focus();
      el.dataset.at = line;
    }, 100);
  }

  async function drop(event) {
    const file = event.dataTransfer && event.dataTransfer.files[0];
    el.classList.remove("rds-code-over");
    if (!file) return;
    event.preventDefault();
    event.stopPropagation();
    model.send({ kind: "drop", name: file.name }, undefined, [await file.slice(0, LARGEST + 1).arrayBuffer()]);
  }
  const over = (event) => {
    if (![...(event.dataTransfer ? event.dataTransfer.types : [])].includes("Files")) return;
    event.preventDefault();
    el.classList.add("rds-code-over");
  };
  el.addEventListener("dragover", over);
  el.addEventListener("dragleave", () => el.classList.remove("rds-code-over"));
  el.addEventListener("drop", drop, true);
  el.addEventListener("keydown", (event) => event.stopPropagation()); // JupyterLab, and the page, have keys of their own

  view = new CM.EditorView({ state: state(), parent: el });
  model.on("change:text change:file", () => {
    const text = model.get("text"), other = view.state.doc.toString();
    if (el.dataset.file !== model.get("file")) { // another file: another history
      clearTimeout(timer);
      timer = 0;
      el.dataset.file = model.get("file");
      view.setState(state());
    } else if (!timer && text !== other) { // what is being typed counts
      view.dispatch({ changes: { from: 0, to: other.length, insert: text }, annotations: CM.Transaction.remote.of(true) });
    }
    mark();
  });
  model.on("change:marks", mark);
  model.on("msg:custom", (message) => { if (message.kind === "go") go(message.line); });
  el.dataset.file = model.get("file");
  mark();
  return () => { send(); view.destroy(); };
}

export default { render };
