// A slider beside a number: while it is dragged it shows what it would be, and says it when it is let go.

function render({ model, el }) {
  const slider = document.createElement("input");
  slider.type = "range";
  slider.className = "rds-slider";
  const put = () => {
    const [low, high] = [model.get("low"), model.get("high")];
    Object.assign(slider, { min: low, max: high, step: (high - low) / 200, disabled: model.get("disabled") });
    slider.value = model.get("value");
    slider.setAttribute("aria-label", model.get("label"));
    slider.title = model.get("label");
  };
  slider.addEventListener("input", () => { slider.title = slider.valueAsNumber.toPrecision(4); });
  slider.addEventListener("change", () => model.send({ kind: "set", value: slider.valueAsNumber }));
  for (const each of ["value", "low", "high", "label", "disabled"]) model.on(`change:${each}`, put);
  put();
  el.append(slider);
  return () => { for (const each of ["value", "low", "high", "label", "disabled"]) model.off(`change:${each}`, put); };
}

export default { render };
