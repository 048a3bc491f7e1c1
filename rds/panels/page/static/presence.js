// Says that a browser shows the page; and sees to it that a click neither overtakes what was typed before it nor, where
// it moves the machine, is carried out when nobody expects it any more.
//
// A field that changes again before the kernel has answered is sent only after that answer, a click at once. So the
// first click after a change waits for one word there and back, behind which every change has been sent. An order to the
// machine always does: if the answer comes late, the kernel stood still, or the connection did, and the order is given up.

const FIELDS = ".widget-toggle-button, .widget-toggle-buttons button, .widget-upload"; // buttons that are fields
const AT_ONCE = ".rds-stop, .rds-halt, .rds-work button, .rds-rescue button"; // what stops something waits for nothing
const ORDER = ".rds-order"; // what moves the machine
const MAY_ORDER = ".rds-order, .rds-may-order"; // or does so after a change of which only the kernel has heard

// the later of two clocks: one may be set back, the other one stands still while the computer sleeps
const clocks = () => [performance.now(), Date.now()];
const since = (then) => Math.max(...clocks().map((now, each) => now - then[each]));
// a page that stood still comes to a press later; of one that a widget makes of something else, the widget says how long
const lag = (event, button) => Math.max(event.isTrusted ? performance.now() - event.timeStamp : Number(button.dataset.lag ?? 0), 0);

function render({ model, el }) {
  el.style.display = "none";
  model.send({ kind: "here" });
  let touched = 0, settled = 0, through = null;
  let number = Math.floor(Math.random() * 2 ** 40); // another browser on this page hears the answers, too
  const waiting = new Map(); // number of the word: the button, when it was pressed, and what had been touched

  const pressed = (event) => {
    const app = el.closest(".rds-app");
    if (!(event.target instanceof Element) || !app || !app.contains(event.target)) return undefined;
    const button = event.target.closest("button");
    return button && !button.matches(FIELDS) ? button : null;
  };
  const forget = (which) => { for (const [other, each] of waiting) if (which(each.button)) waiting.delete(other); };
  const give_up = () => { // nothing that was pressed before may move the machine after what stops it
    const orders = [...waiting.values()].map((each) => each.button).filter((each) => each.matches(MAY_ORDER));
    forget((each) => orders.includes(each));
    for (const each of orders) each.dispatchEvent(new Event("rds-given-up"));
  };
  const touch = (event) => { if (pressed(event) === null) touched += 1; };
  const click = (event) => {
    const button = pressed(event);
    if (!button || button === through) return;
    if (button.matches(AT_ONCE)) {
      give_up();
      return;
    }
    if (touched === settled && waiting.size === 0 && !button.matches(ORDER)) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    forget((each) => each === button); // pressed again: once, and not never where the first word was lost
    number += 1;
    waiting.set(number, { button, touched, at: clocks().map((now) => now - lag(event, button)) });
    model.send({ kind: "settle", number });
  };
  const answered = (message) => {
    const each = message.kind === "settled" ? waiting.get(message.number) : undefined;
    if (each === undefined) return; // of another browser on this page
    waiting.delete(message.number);
    settled = Math.max(settled, each.touched);
    const { button } = each;
    const age = since(each.at);
    if (button.matches(ORDER) && age > model.get("patience")) {
      // a sign such as ▶ names nothing
      const what = button.closest(".rds-hold") ? button.getAttribute("aria-label") : button.textContent.trim();
      model.send({ kind: "late", what, age, moved: button.matches(".rds-moved") });
      button.dispatchEvent(new Event("rds-given-up"));
      return;
    }
    // for any button: whether it is an order may hang on a change of which only the kernel has heard
    model.send({ kind: "go", number: message.number, age });
    through = button;
    button.click();
    through = null;
  };
  const touches = ["input", "change", "pointerup", "keyup", "click"];
  for (const name of touches) document.addEventListener(name, touch, true);
  document.addEventListener("click", click, true);
  document.addEventListener("rds-unwanted", give_up); // Escape: keys.js
  model.on("msg:custom", answered);
  return () => {
    for (const name of touches) document.removeEventListener(name, touch, true);
    document.removeEventListener("click", click, true);
    document.removeEventListener("rds-unwanted", give_up);
    model.off("msg:custom", answered);
  };
}

export default { render };
