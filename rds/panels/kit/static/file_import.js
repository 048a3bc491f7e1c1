// A button that sends the file one chooses in parts, each after the kernel's word that the last one has come.
const PART = 2 << 20; // bytes; with its packing far below the 10 MB at which servers end a connection

function render({ model, el }) {
  const button = document.createElement("button");
  const input = document.createElement("input");
  button.className = "jupyter-widgets jupyter-button widget-upload"; // looks and waits as ipywidgets' own does
  button.title = model.get("tip");
  input.type = "file";
  input.accept = model.get("accept");
  input.style.display = "none";
  el.append(button, input);
  let file = null, word = "";

  const show = (at) => {
    button.disabled = file !== null;
    const share = file === null ? "" : ` (${Math.floor((100 * at) / Math.max(1, file.size))} %)`;
    button.textContent = model.get("text") + share;
  };
  const heard = async (message) => {
    if (file === null || message.file !== word) return; // of another browser on this page
    if (message.kind === "end") {
      file = null;
      show(0);
    } else if (message.kind === "more") {
      show(message.at);
      const { name } = file;
      try {
        const part = await file.slice(message.at, message.at + PART).arrayBuffer();
        if (!part.byteLength) throw new Error("it has become shorter");
        model.send({ kind: "part", file: word }, undefined, [part]);
      } catch (error) {
        model.send({ kind: "failed", name, why: String(error.message ?? error) });
      }
    }
  };
  const chosen = () => {
    [file = null] = input.files;
    input.value = ""; // the same file can be chosen again
    if (file === null) return;
    word = Math.random().toString(36);
    show(0);
    model.send({ kind: "begin", file: word, name: file.name, size: file.size });
  };
  const press = () => input.click();
  button.addEventListener("click", press);
  input.addEventListener("change", chosen);
  model.on("msg:custom", heard);
  show(0);
  return () => model.off("msg:custom", heard);
}
export default { render };
