// The colours of a help page: those that its address or the page around it names, else the browser's.
(() => {
  const KEPT = "rds-colours"; // for the pages that are opened from this one
  const browsers = matchMedia("(prefers-color-scheme: dark)");
  let named = null;

  const show = () => { document.documentElement.dataset.colours = named ?? (browsers.matches ? "dark" : "light"); };
  const name = (value) => {
    if (value !== "dark" && value !== "light") return;
    named = value;
    try { sessionStorage.setItem(KEPT, value); } catch { /* a browser that keeps nothing */ }
    show();
  };
  try { name(sessionStorage.getItem(KEPT)); } catch { /* the same */ }
  name(new URLSearchParams(location.search).get("colours"));
  show();
  browsers.addEventListener("change", show);
  addEventListener("message", (event) => { if (event.source === parent) name(event.data?.colours); });
})();
