// Invisible: a word every few seconds for as long as a browser shows the page, however far in the background.
const BEAT = 5000; // ms; browsers let a page in the background beat once a minute at least

function render({ model }) {
  const say = () => model.send({ kind: "here" });
  const timer = setInterval(say, BEAT);
  say();
  return () => clearInterval(timer);
}
export default { render };
