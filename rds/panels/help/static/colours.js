// The colours of a help page: those that its address or the page around it names, else the browser's.
// The theme reads the choice from the browser's storage as its body begins, and its own button changes it there.
(() => {
  const name = (value) => {
    if (value !== "dark" && value !== "light") return;
    try { localStorage.setItem("theme", value); } catch { /* a browser that keeps nothing */ }
    if (document.body) document.body.dataset.theme = value;
    else addEventListener("DOMContentLoaded", () => { document.body.dataset.theme = value; });
  };
  name(new URLSearchParams(location.search).get("colours"));
  addEventListener("message", (event) => { if (event.source === parent) name(event.data?.colours); });
})();
