// The buttons of a spindle: one way, the other way, stop. While it turns, a word every 200 ms, so that whoever listens
// notices when they end; and a word when it shall stop, because of a press, or because nobody looks at the page any more.
const BEAT = 200; // ms
const UNHEARD = 5; // words without an answer, after which it shall stop: they would all be handed on later

function render({ model, el }) {
  const box = document.createElement("div");
  box.className = "rds-hold rds-turn";
  let turning = null; // the direction, and the timer that beats
  let unheard = 0; // words since the last answer

  const forget = () => {
    if (turning === null) return false;
    clearInterval(turning.timer);
    turning.button.classList.remove("rds-hold-on");
    turning.button.setAttribute("aria-pressed", "false");
    turning = null;
    return true;
  };
  const stop = () => forget() && model.send({ kind: "stop" });
  const turn = (button, direction) => {
    if (turning !== null && turning.direction === direction) return;
    forget();
    unheard = 0; // what was lost before is of another order
    const say = () => {
      unheard += 1;
      model.send({ kind: "turn", direction, answer: turning.answer });
      turning.answer ??= 0; // the order has gone; what comes behind it names an answer
    };
    turning = { button, direction, answer: null, timer: setInterval(() => (unheard >= UNHEARD ? stop() : say()), BEAT) };
    button.classList.add("rds-hold-on");
    button.setAttribute("aria-pressed", "true");
    say();
  };
  const add = (text, name, kind, title, act) => {
    const button = document.createElement("button");
    button.type = "button";
    button.classList.add(kind);
    button.textContent = text;
    button.setAttribute("aria-label", `${model.get("spindle")} ${name}`);
    button.title = title;
    button.addEventListener("click", () => act(button));
    box.append(button);
    return button;
  };
  const while_here = "It turns until Stop, and no longer than this page is in sight";
  const buttons = [
    add("↺ −", "reverse", "rds-order", while_here, (button) => turn(button, -1)),
    add("■", "stop", "rds-halt", "Bring the spindle to rest", () => {
      forget();
      model.send({ kind: "stop" });
    }),
    add("+ ↻", "forward", "rds-order", while_here, (button) => turn(button, 1)),
  ];
  const hidden = () => document.hidden && stop();
  window.addEventListener("pagehide", stop);
  document.addEventListener("visibilitychange", hidden);
  const sight = new ResizeObserver(() => box.clientWidth || stop()); // 0: another panel is looked at
  sight.observe(box);
  const enable = () => {
    for (const button of buttons) button.disabled = model.get("disabled");
    if (model.get("disabled")) forget();
  };
  const told = (word) => {
    if (word.kind === "forget") forget();
    if (word.kind !== "heard") return;
    unheard = 0;
    if (turning !== null) turning.answer = word.number;
  };
  model.on("change:disabled", enable);
  model.on("msg:custom", told);
  enable();
  el.append(box);
  return () => {
    stop();
    model.off("change:disabled", enable);
    model.off("msg:custom", told);
    window.removeEventListener("pagehide", stop);
    document.removeEventListener("visibilitychange", hidden);
    sight.disconnect();
  };
}
export default { render };
