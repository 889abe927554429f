// A picture and its reading. A click sends where it was, as shares of the width and of the height from below.
export default {
  render({ model, el }) {
    const image = document.createElement("img");
    const words = document.createElement("div");
    image.style.cssText = "display: block; max-width: 98%; height: auto";
    image.width = model.get("width");
    words.style.cssText = "line-height: 1.5; max-width: 68em; min-height: 4.5em";
    words.setAttribute("role", "status");
    words.setAttribute("aria-live", "polite");
    let address = "";

    function show() {
      const old = address;
      address = URL.createObjectURL(new Blob([model.get("value")], { type: "image/png" }));
      image.onload = () => old && URL.revokeObjectURL(old);
      image.src = address;
    }

    function say() {
      image.alt = model.get("reading");
      words.textContent = model.get("reading");
    }

    function click(event) {
      model.send({ x: event.offsetX / image.clientWidth, y: 1 - event.offsetY / image.clientHeight });
    }

    if (model.get("clickable")) {
      image.style.cursor = "crosshair";
      image.title = "Click on the branch to see the orbit there";
      image.addEventListener("click", click);
    }
    model.on("change:value", show);
    model.on("change:reading", say);
    show();
    say();
    el.append(image, words);
    return () => {
      model.off("change:value", show);
      model.off("change:reading", say);
      URL.revokeObjectURL(address);
    };
  },
};
