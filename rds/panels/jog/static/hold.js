// Two buttons of an axis, minus and plus. Held: a word every 50 ms, so that whoever listens notices when they end; and
// a word when they are let go, by whatever happens to the pointer, the focus or the page. By step: one word a click, which
// is an order that presence.js lets go if it is not late.
const BEAT = 50; // ms
const UNHEARD = 10; // words without an answer, after which it counts as let go: a kernel that was held up, or a
// connection that broke, hands on all of them later, when nobody holds the button any more. Each names the last answer
// that was heard, and moves nothing if that is old; the first word of a press only asks for one

function render({ model, el }) {
  const box = document.createElement("div");
  box.className = "rds-hold";
  let held = null; // the button, and the timer that beats
  let unheard = 0; // words since the last answer

  const release = () => {
    if (held === null) return;
    clearInterval(held.timer);
    held.button.classList.remove("rds-hold-on");
    held = null;
    model.send({ kind: "release" });
  };
  const press = (button, direction) => {
    if (button.disabled || held !== null || model.get("by_step")) return;
    const say = () => {
      unheard += 1;
      model.send({ kind: "hold", direction, answer: held.answer });
    };
    unheard = 0; // what was lost before is of another press
    const timer = setInterval(() => (button.disabled || unheard >= UNHEARD ? release() : say()), BEAT);
    held = { button, timer, say, answer: null }; // the last answer that was heard
    button.classList.add("rds-hold-on");
    say();
  };
  const keys = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 };
  const buttons = [-1, 1].map((direction) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = direction < 0 ? "◀ −" : "+ ▶";
    button.setAttribute("aria-label", `${model.get("axis")} ${direction < 0 ? "minus" : "plus"}`);
    button.title = "Hold it, or the arrow keys while it has the focus";
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      button.setPointerCapture(event.pointerId);
      press(button, direction);
    });
    button.addEventListener("click", () => { if (model.get("by_step")) model.send({ kind: "step", direction }); });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) button.addEventListener(name, release);
    button.addEventListener("contextmenu", (event) => event.preventDefault());
    button.addEventListener("keydown", (event) => {
      const way = keys[event.key] ?? (event.key === " " || event.key === "Enter" ? direction : 0);
      if (!way) return;
      event.preventDefault();
      if (event.repeat) return;
      if (model.get("by_step")) {
        const [minus, plus] = buttons, each = way < 0 ? minus : plus;
        each.dataset.lag = performance.now() - event.timeStamp; // for presence.js
        each.click();
      }
      else press(button, way);
    });
    button.addEventListener("keyup", release);
    box.append(button);
    return button;
  });
  const hidden = () => document.hidden && release();
  window.addEventListener("blur", release);
  window.addEventListener("pagehide", release);
  document.addEventListener("visibilitychange", hidden);
  const sight = new ResizeObserver(() => box.clientWidth || release()); // 0: another panel is looked at
  sight.observe(box);
  const enable = () => {
    for (const button of buttons) button.disabled = model.get("disabled");
    if (model.get("disabled")) release();
  };
  const set_way = () => {
    for (const button of buttons) button.classList.toggle("rds-order", model.get("by_step"));
    release();
  };
  const told = (word) => {
    if (word.kind !== "heard") return;
    unheard = 0;
    if (held === null) return;
    const first = held.answer === null;
    held.answer = word.number;
    if (first) held.say(); // the word that moves: the one before has only asked for this answer
  };
  model.on("change:disabled", enable);
  model.on("change:by_step", set_way);
  model.on("msg:custom", told);
  enable();
  set_way();
  el.append(box);
  return () => {
    release();
    model.off("change:disabled", enable);
    model.off("change:by_step", set_way);
    model.off("msg:custom", told);
    window.removeEventListener("blur", release);
    window.removeEventListener("pagehide", release);
    document.removeEventListener("visibilitychange", hidden);
    sight.disconnect();
  };
}
export default { render };
