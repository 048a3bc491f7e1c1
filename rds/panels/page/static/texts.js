// Exchanges the texts of the page: those of elements, their titles, labels and examples. A table has the English text on
// the left; {} in it stands for whatever is there, {t} for a text that is exchanged in its turn. What somebody wrote
// (code, files, programs) is left alone, and what is not in the table stays.

const APART = "textarea, pre, code, script, style, .cm-editor, .rds-guide iframe, .rds-strip-clock b";
const NAMES = ["title", "aria-label", "placeholder"];
const MOST_KNOWN = 5000;

function exchanger(table) {
  const exact = new Map(), patterns = [], known = new Map();
  for (const [from, to] of Object.entries(table)) {
    if (!/\{t?\}/.test(from)) { exact.set(from, to); continue; }
    const kinds = [...from.matchAll(/\{(t?)\}/g)].map((each) => each[1]);
    const source = from.split(/\{t?\}/).map((part) => part.replace(/[.*+?^${}()|[\]\\]/g, "\\$&")).join("(.+?)");
    patterns.push({ pattern: new RegExp(`^${source}$`, "s"), kinds, to, fixed: from.replace(/\{t?\}/g, "").length });
  }
  patterns.sort((a, b) => b.fixed - a.fixed); // what says most comes first
  const find = (text) => {
    if (exact.has(text)) return exact.get(text);
    for (const { pattern, kinds, to } of patterns) {
      const found = pattern.exec(text);
      if (!found) continue;
      const parts = found.slice(1).map((part, i) => (kinds[i] ? find(part) : part));
      if (parts.includes(null)) continue;
      let next = 0;
      return to.replace(/\{t?\}/g, () => parts[next++]);
    }
    return null;
  };
  return (text) => {
    const bare = text.trim().replace(/\s+/g, " ");
    if (!/\p{L}{2}/u.test(bare)) return null; // numbers and signs
    if (!known.has(bare)) { if (known.size > MOST_KNOWN) known.clear(); known.set(bare, find(bare)); }
    const found = known.get(bare);
    return found === null ? null : text.replace(text.trim(), () => found);
  };
}

function render({ model, el }) {
  el.style.display = "none";
  const made = new Map(); // text nodes and elements to what was put there: {before, after} by name
  let app = null, exchange = null;

  const put = (node, name, now, write) => {
    const kept = made.get(node) || {};
    if (kept[name] && kept[name].after === now) return;
    const after = exchange(now);
    if (after === null || after === now) { delete kept[name]; return; }
    kept[name] = { before: now, after };
    made.set(node, kept);
    write(after);
  };
  const visit = (node) => {
    if (node.nodeType === Node.TEXT_NODE) {
      if (node.data.trim() && !node.parentElement?.closest(APART)) put(node, "", node.data, (text) => { node.data = text; });
    } else if (node.nodeType === Node.ELEMENT_NODE) {
      for (const name of NAMES) if (node.hasAttribute(name) && !node.closest(".cm-editor")) put(node, name, node.getAttribute(name), (text) => node.setAttribute(name, text));
      if (!node.matches(APART)) node.childNodes.forEach(visit);
    }
  };
  const restore = () => {
    for (const [node, kept] of made) for (const [name, { before, after }] of Object.entries(kept)) {
      if (name === "" && node.data === after) node.data = before;
      else if (name && node.getAttribute(name) === after) node.setAttribute(name, before);
    }
    made.clear();
  };
  const seen = new MutationObserver((changes) => {
    for (const { type, target, addedNodes, attributeName, removedNodes } of changes) {
      if (type === "childList") { addedNodes.forEach(visit); removedNodes.forEach((each) => each.isConnected || forget(each)); }
      else if (type === "characterData") visit(target);
      else if (target.hasAttribute(attributeName) && !target.closest(".cm-editor")) put(target, attributeName, target.getAttribute(attributeName), (text) => target.setAttribute(attributeName, text));
    }
  });
  const forget = (node) => { if (made.size > MOST_KNOWN) for (const each of made.keys()) if (!each.isConnected) made.delete(each); };

  const change = () => {
    if (!app) return;
    seen.disconnect();
    restore();
    const language = model.get("language");
    exchange = language ? exchanger(model.get("texts")) : null;
    window.rdsText = (text) => (exchange && exchange(text)) || text; // for what is drawn
    document.documentElement.lang = app.lang = language || "en";
    if (!exchange) return;
    visit(app);
    seen.observe(app, { childList: true, subtree: true, characterData: true, attributes: true, attributeFilter: NAMES });
  };
  const begun = requestAnimationFrame(() => {
    app = el.closest(".rds-app");
    model.send({ kind: "prefers", languages: [...(navigator.languages || [navigator.language])] });
    change();
  });
  model.on("change:language", change);
  return () => { cancelAnimationFrame(begun); seen.disconnect(); model.off("change:language", change); };
}

export default { render };
