// What folds away can be opened without a mouse: its header takes the focus, and Enter or space does what a click does.
// And a panel begins at its top, however far the one before was scrolled.

const HEADER = ".jupyter-widget-Collapse-header";

function render({ el }) {
  el.style.display = "none";
  let app = null;

  const label = () => {
    for (const header of app.querySelectorAll(HEADER)) {
      const open = String(header.parentElement.classList.contains("jupyter-widget-Collapse-open"));
      if (header.tabIndex !== 0) { header.tabIndex = 0; header.setAttribute("role", "button"); }
      if (header.getAttribute("aria-expanded") !== open) header.setAttribute("aria-expanded", open);
    }
  };
  const pressed = (event) => {
    if (!(event.target instanceof Element) || !event.target.matches(HEADER)) return;
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    event.target.click();
  };
  const seen = new MutationObserver((changes) => {
    label();
    if (changes.some((each) => each.type === "childList" && each.target.matches(".rds-panel"))) app.scrollTop = 0;
  });
  const begun = requestAnimationFrame(() => {
    app = el.closest(".rds-app");
    if (!app) return;
    label();
    seen.observe(app, { childList: true, subtree: true, attributes: true, attributeFilter: ["class"] });
    app.addEventListener("keydown", pressed);
  });
  return () => {
    cancelAnimationFrame(begun);
    seen.disconnect();
    if (app) app.removeEventListener("keydown", pressed);
  };
}

export default { render };
