// Says how wide the place is that it stands in, in steps, once it has stayed that wide; and names the canvas there.

const STEP = 20; // px: a scroll bar that comes or goes makes no other picture of a figure
const BORDERS = 10; // px, of the figure and around it
const QUIET_MS = 150;

function render({ model, el }) {
  Object.assign(el.style, { height: "0", minHeight: "0", margin: "0", overflow: "hidden" });
  let told = 0, timer = 0, place = null;
  const called = () => place?.querySelectorAll("canvas").forEach((canvas) => {
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", model.get("name"));
  });
  const come = new MutationObserver(called); // a canvas comes after this, and another one with each figure
  model.on("change:name", called);
  const seen = new ResizeObserver((entries) => {
    if (!place && (place = el.closest(".rds-figure"))) { // it is nowhere yet while it is rendered
      come.observe(place, { childList: true, subtree: true });
      called();
    }
    const width = Math.floor((entries.at(-1).contentRect.width - BORDERS) / STEP) * STEP;
    clearTimeout(timer);
    if (width > 0 && width !== told) timer = setTimeout(() => { told = width; model.send({ kind: "width", width }); }, QUIET_MS);
  });
  seen.observe(el);
  return () => { come.disconnect(); model.off("change:name", called); seen.disconnect(); clearTimeout(timer); };
}

export default { render };
