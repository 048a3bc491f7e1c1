// A way around the page's kernel, which one call of a student's code may hold for ever, or which may have died: the
// server that the page came from stops the machine, says where that code is, and ends it.

const BEAT = 1000; // ms
const HELD = 5; // beats without an answer, after which the page says so
const PATIENCE = 15000; // ms for the server
const TOLD = "rds-told"; // what the page says once it has been begun again

function render({ model, el }) {
  const config = JSON.parse(document.getElementById("jupyter-config-data")?.textContent ?? "{}");
  el.classList.add("rds-rescue");
  if (!config.kernelId) return undefined; // JupyterLab, which interrupts and restarts kernels by buttons of its own
  const kernel = `kernel/${config.kernelId}`;
  const box = document.createElement("div");
  box.className = "rds-rescue-box";
  box.setAttribute("role", "alert");
  el.append(box);

  // what the box says: of an emergency stop, of a kernel that does not answer, of one that was ended
  const said = { stopped: null, held: null, told: null };
  const again = button("Begin again", "Ends what is at work in this page, and opens it again", end);
  const seen = button("OK", "Take this away", () => say("told", null));
  function button(text, tip, act) {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = text;
    made.title = tip;
    made.addEventListener("click", act);
    return made;
  }
  function say(what, text, kind = "warning") {
    said[what] = text === null ? null : Object.assign(document.createElement("p"), { textContent: text });
    said[what]?.classList.add(`rds-rescue-${kind}`);
    const parts = [said.stopped, said.told, said.held, said.held && again, !said.held && said.told && seen];
    box.replaceChildren(...parts.filter(Boolean));
    box.hidden = !box.childElementCount;
  }

  async function ask(method, path, body) {
    const cookie = /(?:^|;\s*)_xsrf=([^;]*)/.exec(document.cookie);
    const response = await fetch(new URL(`${config.baseUrl}rds/${path}`, location.href), {
      method,
      body: body && JSON.stringify(body),
      headers: cookie ? { "X-XSRFToken": cookie[1] } : {},
      signal: AbortSignal.timeout(PATIENCE),
    });
    if (!response.ok) throw new Error(`the page's server refused (${response.status})`);
    return response.json();
  }
  const failed = (error) => // fetch's own words for a server that is not there, or hangs, help nobody
    error instanceof TypeError || error.name === "TimeoutError" ? "the page's server does not answer" : error.message;

  let waiting = false, missed = 0, answers = 0;
  const tick = () => {
    if (waiting) missed += 1;
    const look_now = missed > 0 && missed % HELD === 0;
    if (look_now) look();
    if (missed > HELD && !look_now) return; // a kernel that comes back after hours has few of them to answer
    waiting = true;
    model.send({ kind: "beat" }); // again and again: one that was under way when the connection broke is lost
  };
  const answered = (message) => {
    if (message.kind !== "beat") return;
    waiting = false;
    missed = 0;
    answers += 1;
    if (said.held) say("held", null);
    if (said.stopped) say("stopped", null); // the kernel says it in its own line
  };
  async function look() {
    let text;
    try {
      ({ text } = await ask("GET", kernel));
    } catch (error) {
      text = `This page gets no answer: ${failed(error)}. Look after \`rds app\`, where it was started.`;
    }
    if (missed) say("held", text);
  }
  async function end() {
    again.disabled = true;
    try {
      const { text } = await ask("DELETE", kernel);
      sessionStorage.setItem(TOLD, text);
      location.reload();
    } catch (error) {
      say("held", `It could not be ended: ${failed(error)}. End \`rds app\` where it was started, and start it again.`);
    }
    again.disabled = false;
  }
  const pressed = async (event) => {
    if (!(event.target instanceof Element)) return;
    if (missed && event.target.closest(".rds-app .rds-work button")) look(); // Stop is not heard either
    if (!event.target.closest(".rds-app .rds-stop")) return;
    const before = answers;
    let stopped;
    try {
      stopped = await ask("POST", "emergency-stop", { channels: model.get("channels") });
    } catch (error) {
      const text = `Emergency stop failed: ${failed(error)}. Cut the power, or run \`rds estop\` in a terminal.`;
      stopped = { text, kind: "error" };
    }
    if (!missed) await new Promise((go) => setTimeout(go, 1.5 * BEAT)); // if the kernel is there, it says so itself
    if (answers === before) say("stopped", stopped.text, stopped.kind);
  };

  say("told", sessionStorage.getItem(TOLD));
  sessionStorage.removeItem(TOLD);
  ask("GET", "emergency-stop").catch(() => {}); // so that it is ready; if it is not, the button says so
  const timer = setInterval(tick, BEAT);
  document.addEventListener("click", pressed, true);
  model.on("msg:custom", answered);
  return () => {
    clearInterval(timer);
    document.removeEventListener("click", pressed, true);
    model.off("msg:custom", answered);
  };
}

export default { render };
