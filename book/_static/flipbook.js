// Flip-books: a slider that turns precomputed frames. The first move lays the frames over the still picture.
"use strict";

document.addEventListener("DOMContentLoaded", () => {
  for (const book of document.querySelectorAll(".flipbook")) {
    const frames = JSON.parse(book.querySelector("script").textContent);
    const label = book.querySelector(".flipbook-slider");
    const slider = label.querySelector("input");
    const still = book.querySelector("img");
    const caption = book.querySelector("figcaption");
    const screen = document.createElement("div");
    const whole = new Image();
    const frame = new Image();
    screen.className = "flipbook-screen";
    screen.style.width = `${book.dataset.width}px`;
    screen.hidden = true;
    whole.src = book.dataset.whole;
    whole.alt = "";
    frame.className = "flipbook-frame";
    screen.append(whole, frame);
    still.after(screen);
    caption.setAttribute("aria-live", "polite");
    label.hidden = false;
    slider.addEventListener("input", () => {
      const { value, reading, picture } = frames[slider.valueAsNumber];
      frame.src = picture;
      frame.alt = reading;
      caption.textContent = reading;
      label.querySelector("output").textContent = value;
      slider.setAttribute("aria-valuetext", value);
      still.hidden = true;
      screen.hidden = false;
    });
  }
});
