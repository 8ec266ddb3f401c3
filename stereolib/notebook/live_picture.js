// Pictures that a kernel sends: painted as they come, acknowledged when painted; a cross is set by clicks and arrow keys.
const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export default {
  render({ model, el }) {
    const grid = document.createElement("div");
    grid.className = "stereolib-pictures";
    el.append(grid);
    const cells = [];
    let newest = 0;

    function point(kind, k, column, row) {
      const { canvas } = cells[k];
      const x = Math.round(Math.min(Math.max(column, 0), canvas.width - 1));
      const y = Math.round(Math.min(Math.max(row, 0), canvas.height - 1));
      model.set("cross", [k, x, y]);
      model.save_changes();
      model.send({ kind, picture: k, x, y });
    }

    function place(k, which = "cross") {
      const [picture, x, y] = model.get(which) || [];
      return picture === k ? [x, y] : null;
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
      canvas.addEventListener("click", (event) => {
        const box = canvas.getBoundingClientRect();
        const across = ((event.clientX - box.left) / box.width) * canvas.width;
        point("click", k, across, ((event.clientY - box.top) / box.height) * canvas.height);
      });
      canvas.addEventListener("keydown", (event) => {
        const by = STEPS[event.key];
        if (!by && event.key !== "Enter") return;
        event.preventDefault();
        const [x, y] = place(k) || [canvas.width / 2, canvas.height / 2];
        const far = event.shiftKey ? 20 : 2;
        if (by) point("move", k, x + far * by[0], y + far * by[1]);
        else point("click", k, x, y);
      });
      return (cells[k] = { figure, caption, canvas, picture: null });
    }

    function draw(k) {
      const { canvas, picture } = cells[k];
      if (!picture) return;
      const pen = canvas.getContext("2d");
      pen.drawImage(picture, 0, 0);
      const before = place(k, "before");
      const at = place(k);
      for (const [color, width] of before ? [["white", 4], ["#111", 2]] : []) {
        pen.strokeStyle = color;
        pen.lineWidth = width;
        pen.beginPath();
        pen.arc(before[0] + 0.5, before[1] + 0.5, 7, 0, 2 * Math.PI);
        pen.stroke();
      }
      if (!at) return;
      for (const [color, width] of [["white", 4], ["#111", 2]]) {
        pen.strokeStyle = color;
        pen.lineWidth = width;
        pen.beginPath();
        for (const [dx, dy] of Object.values(STEPS)) {
          pen.moveTo(at[0] + 0.5 + 4 * dx, at[1] + 0.5 + 4 * dy);
          pen.lineTo(at[0] + 0.5 + 13 * dx, at[1] + 0.5 + 13 * dy);
        }
        pen.stroke();
      }
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
        caption.textContent = captions[k] || "";
        canvas.setAttribute("aria-label", captions[k] || model.get("alt"));
        cells[k].picture = picture;
        draw(k);
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

    const crossed = () => cells.forEach((_, k) => draw(k));
    model.on("change:number", paint);
    model.on("change:quality", wait);
    model.on("change:cross", crossed);
    model.on("change:before", crossed);
    if (model.get("number")) paint();
    return () => {
      model.off("change:number", paint);
      model.off("change:quality", wait);
      model.off("change:cross", crossed);
      model.off("change:before", crossed);
    };
  },
};
