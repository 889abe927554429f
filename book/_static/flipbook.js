// Flip-books: a slider that turns precomputed frames. Ground and frame are put together at their own size in a canvas,
// so that nothing of the ground shines through where the browser scales the picture. Printing opens what is folded.
"use strict";

document.addEventListener("DOMContentLoaded", () => {
  for (const book of document.querySelectorAll(".flipbook")) {
    const frames = JSON.parse(book.querySelector("script").textContent);
    const label = book.querySelector(".flipbook-slider");
    const slider = label.querySelector("input");
    const still = book.querySelector("img");
    const caption = book.querySelector("figcaption");
    const canvas = document.createElement("canvas");
    const load = (source) => {
      const image = new Image();
      image.src = source;
      return image.decode().then(() => image);
    };
    let whole;
    canvas.className = "flipbook-frame";
    canvas.style.width = `${book.dataset.width}px`;
    canvas.setAttribute("role", "img");
    canvas.hidden = true;
    still.after(canvas);
    caption.setAttribute("aria-live", "polite");
    label.hidden = false;
    slider.addEventListener("input", async () => {
      const turned = slider.value;
      const { value, reading, picture } = frames[slider.valueAsNumber];
      caption.textContent = reading;
      label.querySelector("output").textContent = value;
      slider.setAttribute("aria-valuetext", value);
      whole ??= load(book.dataset.whole);
      const [ground, frame] = await Promise.all([whole, load(picture)]);
      if (slider.value !== turned) return; // a later frame is on its way
      canvas.width = ground.naturalWidth;
      canvas.height = ground.naturalHeight;
      const context = canvas.getContext("2d");
      context.drawImage(ground, 0, 0);
      context.drawImage(frame, 0, 0);
      canvas.setAttribute("aria-label", reading);
      still.hidden = true;
      canvas.hidden = false;
    });
  }
});

window.addEventListener("beforeprint", () => {
  for (const folded of document.querySelectorAll("details:not(.scene)")) folded.open = true;
});
