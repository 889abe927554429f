// A picture and its reading. The picture is a PNG of what stands still and the pixels that differ from it, in runs: how
// many, where each begins, how long each is, and their colours. A click sends where it was, as shares of the width and of
// the height from below.
export default {
  render({ model, el }) {
    const canvas = document.createElement("canvas");
    const words = document.createElement("div");
    const context = canvas.getContext("2d", { alpha: false, willReadFrequently: true });
    canvas.style.cssText = `display: block; width: ${model.get("width")}px; max-width: 98%; height: auto`;
    canvas.setAttribute("role", "img");
    words.style.cssText = "line-height: 1.5; max-width: 68em; min-height: 4.5em";
    words.setAttribute("role", "status");
    words.setAttribute("aria-live", "polite");
    let still, ground, image, pixels;

    async function show() {
      const wanted = model.get("still");
      if (wanted !== still) {
        const bitmap = await createImageBitmap(new Blob([wanted], { type: "image/png" }));
        if (wanted !== model.get("still")) return; // a newer one is being read
        canvas.width = bitmap.width;
        canvas.height = bitmap.height;
        context.drawImage(bitmap, 0, 0);
        image = context.getImageData(0, 0, canvas.width, canvas.height);
        pixels = new Uint32Array(image.data.buffer);
        ground = pixels.slice();
        still = wanted;
      }
      pixels.set(ground);
      const { buffer, byteOffset, byteLength } = model.get("moving");
      const runs = new Uint32Array(buffer.slice(byteOffset, byteOffset + byteLength));
      const count = runs[0] ?? 0;
      for (let run = 1, colours = 1 + 2 * count; run <= count; run++) {
        const length = runs[run + count];
        pixels.set(runs.subarray(colours, colours + length), runs[run]);
        colours += length;
      }
      context.putImageData(image, 0, 0);
    }

    function say() {
      canvas.setAttribute("aria-label", model.get("reading"));
      words.textContent = model.get("reading");
    }

    function changed() {
      say();
      show();
    }

    if (model.get("clickable")) {
      canvas.style.cursor = "crosshair";
      canvas.title = "Click on the branch to see the orbit there";
      canvas.addEventListener("click", event =>
        model.send({ x: event.offsetX / canvas.clientWidth, y: 1 - event.offsetY / canvas.clientHeight }));
    }
    model.on("change", changed);
    changed();
    el.append(canvas, words);
    return () => model.off("change", changed);
  },
};
