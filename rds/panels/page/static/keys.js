// A panel without a mouse. Ctrl+Enter presses its Run, Escape its Stop, which ends the run and is no emergency stop; of a
// run whose Stop is not in sight yet it is pressed as soon as it is. What folds away is opened by Enter or space. The list
// of panels is one stop of Tab, within which arrows move. Labels belong to their fields, and what is said in a notice is
// read out. A panel begins at its top, however far the one before was scrolled. And JupyterLab, whose cells are deleted and
// run by keys, hears none that is meant for a panel: dd on a button would delete the cell that shows it.

const HEADER = ".jupyter-widget-Collapse-header";
const RUN = "button.rds-run", STOP = ".rds-work button";
const STEPS = { ArrowDown: 1, ArrowRight: 1, ArrowUp: -1, ArrowLeft: -1 };
const LOOK = 50; // ms
const NOT_OF_LAB = "data-lm-suppress-shortcuts";
const set = (element, name, value) => { if (element.getAttribute(name) !== value) element.setAttribute(name, value); };
let count = 0;

function render({ el }) {
  el.style.display = "none";
  let app = null;

  const label = () => {
    for (const header of app.querySelectorAll(HEADER)) {
      const open = String(header.parentElement.classList.contains("jupyter-widget-Collapse-open"));
      if (header.tabIndex !== 0) { header.tabIndex = 0; header.setAttribute("role", "button"); }
      set(header, "aria-expanded", open);
    }
    for (const field of app.querySelectorAll(".rds-field")) {
      const name = field.querySelector("label[title]:not(.widget-label)");
      const buttons = field.querySelector(".widget-toggle-buttons"), control = field.querySelector("input, select, textarea");
      if (!name) continue;
      if (buttons) { set(buttons, "role", "group"); set(buttons, "aria-label", name.textContent); continue; }
      if (!control) continue;
      if (!control.id) { count += 1; control.id = `rds-field-${count}`; }
      set(name, "for", control.id);
      set(control, "aria-invalid", String(field.classList.contains("rds-refused")));
    }
    for (const each of app.querySelectorAll("input[title], select[title], textarea[title]")) {
      const named = [...(each.labels ?? [])].some((label) => label.textContent.trim());
      if (each.title && !named && !each.hasAttribute("aria-label")) set(each, "aria-label", each.title);
    }
    for (const notice of app.querySelectorAll(".rds-notice")) set(notice, "aria-live", "polite");
    const nav = app.querySelector(".rds-nav");
    if (nav) { set(nav, "role", "toolbar"); set(nav, "aria-label", "Panels"); }
    for (const each of app.querySelectorAll(".rds-nav button")) set(each, "tabindex", each.matches(".rds-here") ? "0" : "-1");
    for (const each of app.querySelectorAll(".rds-progress [role=progressbar], .rds-progress .progress")) {
      set(each, "role", "progressbar");
      set(each, "aria-label", "progress");
    }
  };
  let pending = false, unwanted = false; // Run was pressed, and then Escape, before there was a Stop
  const chosen = (button) => { pending = button?.matches(RUN) ?? false; unwanted = false; };
  const clicked = (event) => { // by hand: those that others make of a press come later
    if (event.isTrusted && event.target instanceof Element && app.contains(event.target)) chosen(event.target.closest("button"));
  };
  const stop = () => {
    const button = press(STOP);
    if (button) {
      pending = unwanted = false;
      button.click();
    } else if (pending) {
      if (!unwanted) document.dispatchEvent(new Event("rds-unwanted")); // what still waits is given up: presence.js
      unwanted = true;
    }
  };
  const press = (which) => [...app.querySelectorAll(which)].find((each) => each.offsetParent && !each.disabled);
  const keep = (event) => { // but for Ctrl+S and the like; what has the focus says so itself
    const { target, key } = event;
    if (app.contains(target)) target.toggleAttribute(NOT_OF_LAB, !(event.ctrlKey || event.metaKey) || key === "Enter");
  };
  const pressed = (event) => {
    if (!(event.target instanceof Element) || event.defaultPrevented) return;
    if (event.target.matches(HEADER) && (event.key === "Enter" || event.key === " ") && !event.ctrlKey) {
      event.preventDefault();
      event.target.click();
    } else if (event.key === "Enter" && (event.ctrlKey || event.metaKey) && !event.target.closest(".cm-editor")) {
      const button = press(RUN), at = document.activeElement;
      if (!button) return;
      event.preventDefault();
      at.blur(); // what was typed holds
      at.focus();
      chosen(button);
      button.click();
    } else if (event.key === "Escape" && !event.target.closest(".cm-editor")) {
      stop();
    } else if (event.key in STEPS && event.target.matches(".rds-nav button")) {
      const all = [...app.querySelectorAll(".rds-nav button")];
      event.preventDefault();
      all[(all.indexOf(event.target) + STEPS[event.key] + all.length) % all.length].focus();
    }
  };
  const watch = setInterval(() => { if (unwanted) stop(); else if (pending && press(STOP)) pending = false; }, LOOK);
  let due = 0;
  const seen = new MutationObserver((changes) => {
    due ||= setTimeout(() => { due = 0; label(); }, 50); // once for what comes together
    const came = (each) => each.type === "childList" ? each.target.matches(".rds-panel")
      : (each.oldValue ?? "").includes("rds-away") && !each.target.matches(".rds-away");
    if (changes.some(came)) app.scrollTop = 0;
  });
  const begun = requestAnimationFrame(() => {
    app = el.closest(".rds-app");
    if (!app) return;
    label();
    seen.observe(app, { childList: true, subtree: true, attributes: true, attributeFilter: ["class"], attributeOldValue: true });
    app.addEventListener("keydown", pressed, true); // before the fields, which let no key out of them
    window.addEventListener("keydown", keep, true);
    window.addEventListener("click", clicked, true); // before presence.js, which holds some back
  });
  return () => {
    cancelAnimationFrame(begun);
    clearTimeout(due);
    clearInterval(watch);
    seen.disconnect();
    window.removeEventListener("keydown", keep, true);
    window.removeEventListener("click", clicked, true);
    if (app) app.removeEventListener("keydown", pressed, true);
  };
}

export default { render };
