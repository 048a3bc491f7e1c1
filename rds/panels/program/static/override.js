// The feed override: a slider. Less of it is told at once; more, while something moves, is an order, which presence.js
// lets go if it is not late. What was not carried out does not stay in sight.

function render({ model, el }) {
  const label = document.createElement("label");
  label.className = "rds-override";
  const name = document.createElement("span");
  name.textContent = "Override [%]";
  const slider = document.createElement("input");
  Object.assign(slider, { type: "range", min: 0, max: 200, step: 5, title: model.get("tip") });
  const shown = document.createElement("output");
  const raise = document.createElement("button"); // pressed by the slider only
  Object.assign(raise, { type: "button", hidden: true, textContent: "The override" });
  raise.className = "rds-order rds-moved";
  let asked = 0; // what this page wants
  let sent = Math.floor(Math.random() * 2 ** 40), heard = sent; // numbers of words: another browser hears the answers, too
  let waits = false; // whether an order has not been let go yet
  let acted = null; // when the hand moved, ms of performance.now(): a page that stood still comes to it later

  const show = (percent) => {
    shown.textContent = percent;
    slider.setAttribute("aria-valuetext", `${percent} %`);
  };
  const put = () => { // what holds; while something is under way, what was asked for stays
    slider.disabled = model.get("disabled");
    if (waits || heard !== sent) return;
    asked = slider.value = model.get("value");
    show(asked);
  };
  const tell = (ordered) => {
    sent += 1;
    model.send({ kind: "set", percent: asked, ordered, number: sent });
  };
  const moved = () => {
    const lag = acted === null ? 0 : performance.now() - acted;
    const most = Math.min(asked, model.get("value"));
    acted = null;
    asked = slider.valueAsNumber;
    show(asked);
    if (asked <= most || !model.get("moves")) return tell(false);
    waits = true;
    raise.dataset.lag = lag;
    raise.click();
  };
  const let_go = (ordered) => {
    waits = false;
    if (ordered) tell(true);
    else put();
  };
  const answered = (word) => {
    if (word.number !== sent) return;
    heard = sent;
    put();
  };
  for (const each of ["keydown", "pointerdown", "pointermove"]) {
    slider.addEventListener(each, (event) => { if (event.buttons || event.key) acted = event.timeStamp; });
  }
  slider.addEventListener("input", moved);
  raise.addEventListener("click", () => let_go(true));
  raise.addEventListener("rds-given-up", () => let_go(false));
  for (const each of ["value", "disabled"]) model.on(`change:${each}`, put);
  model.on("msg:custom", answered);
  put();
  label.append(name, slider, shown, raise);
  el.append(label);
  return () => {
    for (const each of ["value", "disabled"]) model.off(`change:${each}`, put);
    model.off("msg:custom", answered);
  };
}

export default { render };
