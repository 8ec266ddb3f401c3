// Lines of code in full, and a button that copies them.
export default {
  render({ model, el }) {
    const button = document.createElement("button");
    const code = document.createElement("pre");
    code.tabIndex = 0; // so that it can be scrolled and selected from the keyboard
    button.className = "jupyter-button";
    button.title = "Puts the lines on the clipboard.";
    el.append(button, code);

    function show() {
      code.textContent = model.get("code");
      button.textContent = "copy";
    }

    button.addEventListener("click", async () => {
      try {
        await navigator.clipboard.writeText(code.textContent);
        button.textContent = "copied";
      } catch {
        getSelection().selectAllChildren(code); // where a page may not write there
        button.textContent = "selected: press Ctrl-C";
      }
    });
    model.on("change:code", show);
    show();
    return () => model.off("change:code", show);
  },
};
