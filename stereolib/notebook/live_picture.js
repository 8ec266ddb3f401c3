// Pictures that a kernel sends: painted as they come, acknowledged when painted, and clicked on.
export default {
  render({ model, el }) {
    const grid = document.createElement("div");
    grid.className = "stereolib-pictures";
    el.append(grid);
    const cells = [];
    let newest = 0;

    function ask(kind, picture, x, y) {
      model.send({ kind, picture, x: Math.round(x), y: Math.round(y) });
    }

    function cell(k) {
      if (cells[k]) return cells[k];
      const figure = document.createElement("figure");
      const caption = document.createElement("figcaption");
      const canvas = document.createElement("canvas");
      canvas.tabIndex = 0;
      canvas.setAttribute("role", "img");
      figure.append(caption, canvas);
      grid.append(figure);
      let cross = null; // moved with the arrow keys
      canvas.addEventListener("click", (event) => {
        const box = canvas.getBoundingClientRect();
        cross = [
          ((event.clientX - box.left) / box.width) * canvas.width,
          ((event.clientY - box.top) / box.height) * canvas.height,
        ];
        ask("click", k, ...cross);
      });
      canvas.addEventListener("keydown", (event) => {
        const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
        if (!by && event.key !== "Enter") return;
        event.preventDefault();
        cross = cross || [canvas.width / 2, canvas.height / 2];
        const far = event.shiftKey ? 20 : 2;
        if (by) cross = [cross[0] + far * by[0], cross[1] + far * by[1]];
        ask("click", k, ...cross);
      });
      return (cells[k] = { figure, caption, canvas });
    }

    async function paint() {
      const number = model.get("number");
      const captions = model.get("captions");
      const frames = model.get("frames");
      const pictures = await Promise.all(
        frames.map((frame) => createImageBitmap(new Blob([frame], { type: "image/jpeg" }))),
      );
      if (number < newest) return;
      newest = number;
      pictures.forEach((picture, k) => {
        const { figure, caption, canvas } = cell(k);
        figure.hidden = false;
        if (canvas.width !== picture.width) canvas.width = picture.width;
        if (canvas.height !== picture.height) canvas.height = picture.height;
        canvas.getContext("2d").drawImage(picture, 0, 0);
        caption.textContent = captions[k] || "";
        canvas.setAttribute("aria-label", captions[k] || model.get("alt"));
      });
      if (!pictures.length && captions.length) cell(0).caption.textContent = captions[0];
      cells.slice(pictures.length || captions.length).forEach(({ figure }) => (figure.hidden = true));
      grid.dataset.quality = model.get("quality");
      grid.dataset.about = model.get("about");
      grid.dataset.painted = number;
      model.set("painted", number);
      model.save_changes();
    }

    function wait() {
      if (model.get("quality") === "waiting") grid.dataset.quality = "waiting";
    }

    model.on("change:number", paint);
    model.on("change:quality", wait);
    if (model.get("number")) paint();
    return () => {
      model.off("change:number", paint);
      model.off("change:quality", wait);
    };
  },
};
