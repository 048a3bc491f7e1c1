// Says how wide the place is that it stands in, in steps, once it has stayed that wide.

const STEP = 20; // px: a scroll bar that comes or goes makes no other picture of a figure
const BORDERS = 10; // px, of the figure and around it
const QUIET_MS = 150;

function render({ model, el }) {
  Object.assign(el.style, { height: "0", minHeight: "0", margin: "0", overflow: "hidden" });
  let told = 0, timer = 0;
  const seen = new ResizeObserver((entries) => {
    const width = Math.floor((entries.at(-1).contentRect.width - BORDERS) / STEP) * STEP;
    clearTimeout(timer);
    if (width > 0 && width !== told) timer = setTimeout(() => { told = width; model.send({ kind: "width", width }); }, QUIET_MS);
  });
  seen.observe(el);
  return () => { seen.disconnect(); clearTimeout(timer); };
}

export default { render };
