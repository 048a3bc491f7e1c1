// Invisible: a word every few seconds for as long as a browser shows the page, however far in the background.
const BEAT = 5000; // ms; browsers let a page in the background beat once a minute at least

function render({ model }) {
  const say = () => model.send({ kind: document.hidden ? "in background" : "in sight" });
  const timer = setInterval(say, BEAT);
  document.addEventListener("visibilitychange", say); // before its beats come seldom
  say();
  return () => {
    clearInterval(timer);
    document.removeEventListener("visibilitychange", say);
  };
}
export default { render };
