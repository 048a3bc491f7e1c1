// Says which colours the browser prefers, or JupyterLab where it is around the page; and tells the help in its frame those
// that are shown, as the help is of another origin.

function render({ model, el }) {
  el.style.display = "none";
  const browsers = matchMedia("(prefers-color-scheme: dark)");
  const body = document.body.dataset;
  const say = () => {
    const alone = body.voila !== undefined || body.jpThemeLight === undefined; // on the page of `rds app`
    model.send({ kind: "prefers", dark: alone ? browsers.matches : body.jpThemeLight === "false" });
  };
  const tell = () => {
    const colours = model.get("dark") ? "dark" : "light";
    for (const guide of document.querySelectorAll(".rds-app .rds-guide")) {
      for (const frame of guide.querySelectorAll("iframe")) frame.contentWindow.postMessage({ colours }, "*");
      for (const link of guide.querySelectorAll("a")) link.href = link.href.replace(/colours=\w+/, `colours=${colours}`);
    }
  };
  const loaded = ({ target }) => target instanceof HTMLIFrameElement && target.closest(".rds-guide") && tell();
  document.addEventListener("load", loaded, true); // a help that is shown again has the colours of its first time
  const seen = new MutationObserver(say); // of JupyterLab's own choice
  seen.observe(document.body, { attributes: true, attributeFilter: ["data-jp-theme-light"] });
  browsers.addEventListener("change", say);
  model.on("change:dark", tell);
  say();
  return () => {
    seen.disconnect();
    document.removeEventListener("load", loaded, true);
    browsers.removeEventListener("change", say);
    model.off("change:dark", tell);
  };
}

export default { render };
