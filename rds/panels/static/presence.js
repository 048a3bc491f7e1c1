// Says that a browser shows the page; and sees to it that a click does not overtake what was typed before it.
//
// A field that changes again before the kernel has answered is sent only after that answer, a click at once. So the
// first click after a change waits for one word there and back, behind which every change has been sent.

const FIELDS = ".widget-toggle-button, .widget-toggle-buttons button, .widget-upload"; // buttons that are fields
const AT_ONCE = ".rds-stop, .rds-work button, .rds-rescue button"; // what stops something waits for nothing

function render({ model, el }) {
  el.style.display = "none";
  model.send({ kind: "here" });
  let touched = 0, settled = 0, number = 0, through = null;
  const waiting = new Map(); // number of the word: the button, and what had been touched

  const pressed = (event) => {
    const app = el.closest(".rds-app");
    if (!(event.target instanceof Element) || !app || !app.contains(event.target)) return undefined;
    const button = event.target.closest("button");
    return button && !button.matches(FIELDS) ? button : null;
  };
  const touch = (event) => { if (pressed(event) === null) touched += 1; };
  const click = (event) => {
    const button = pressed(event);
    if (!button) return;
    if (button === through || touched === settled || button.matches(AT_ONCE)) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    // pressed again: once, and not never where the first word was lost with its connection
    for (const [other, each] of waiting) if (each.button === button) waiting.delete(other);
    number += 1;
    waiting.set(number, { button, touched });
    model.send({ kind: "settle", number });
  };
  const answered = (message) => {
    const each = message.kind === "settled" ? waiting.get(message.number) : undefined;
    if (each === undefined) return; // of another browser on this page
    waiting.delete(message.number);
    settled = Math.max(settled, each.touched);
    through = each.button;
    each.button.click();
    through = null;
  };
  const touches = ["input", "change", "pointerup", "keyup", "click"];
  for (const name of touches) document.addEventListener(name, touch, true);
  document.addEventListener("click", click, true);
  model.on("msg:custom", answered);
  return () => {
    for (const name of touches) document.removeEventListener(name, touch, true);
    document.removeEventListener("click", click, true);
    model.off("msg:custom", answered);
  };
}

export default { render };
